"""Contact area of one frustum on glass against axisymmetric elements of CalculiX.

As in `test_frustum_on_glass` the root is bonded to a plate that goes down and the tip is held across; here the side's own nodes
tell how far it lies on the glass. The section has OUT quadratic quadrilaterals outwards and LOW + HIGH upwards, LOW of them in the
lowest 30 % of the side, which is what folds. Areas of coarser and finer sections are kept beside the numbers that are compared.
On 540 frusta 140 N are 0.259 N each: within the third and the last depth of either law.
"""

import itertools
import re
import shutil
import subprocess

import numpy as np
import pytest
from test_frustum_on_glass import HARD, HEIGHT, LAW, ROOT, TIP, equilibrium, frustum

from softtact.decks import keywords
from softtact.decks.keywords import law_card
from softtact.fem.extruded_mesh import grid_mesh_2d
from softtact.materials.laws.registry import make_law
from softtact.models.ftir.specimen import DARK_GAP_MM, GLASS_MESH, contact_area

LAWS = {"mooney_rivlin": LAW,
        "ogden2": make_law("ogden2", {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910}, bulk_over_shear=20.0)}
DEPTHS = {"mooney_rivlin": (0.02, 0.05, 0.1, 0.15, 0.2), "ogden2": (0.02, 0.05, 0.1, 0.12)}    # mm
# CalculiX 2.20 on the deck below, with OUT, LOW, HIGH: forces in N, areas in mm2.
PARTS = {"mooney_rivlin": (20, 48, 10), "ogden2": (16, 32, 8)}
FORCES = {"mooney_rivlin": (0.02689, 0.07102, 0.16150, 0.29841, 0.54169), "ogden2": (0.02885, 0.08287, 0.22443, 0.31304)}
AREAS = {"mooney_rivlin": (0.28579, 0.30155, 0.36934, 0.50152, 0.70461), "ogden2": (0.28510, 0.30003, 0.35666, 0.39245)}
# The same on finer sections, as far as those runs went (CalculiX gives up sooner the finer the rows that fold).
FINER_AREAS = {"mooney_rivlin": ((28, 64, 12), (0.28580, 0.30187, 0.36984)),
               "ogden2": ((20, 48, 10), (0.28529, 0.30022, 0.35724))}
SOURCE = "CalculiX 2.20, axisymmetric CAX8R"
_SECTOR = 180            # CalculiX reports the forces on the 2 degrees of its own three-dimensional elements


def section(out, low, high):
    """Plan mesh of the section, x the radius and y the height; lines gather at the rim of the tip."""
    outwards = 1 - (1 - np.linspace(0, 1, out + 1)) ** 2
    folding, rest = 0.3 * np.linspace(0, 1, low + 1) ** 1.3, 0.3 + 0.7 * (1 - (1 - np.linspace(0, 1, high + 1)[1:]) ** 1.5)
    mesh_2d = grid_mesh_2d(outwards, HEIGHT * np.concatenate([folding, rest]))
    r, z = mesh_2d.points.T
    return np.column_stack([r * (TIP + (ROOT - TIP) * z / HEIGHT), z]), mesh_2d.quads


def deck(law, parts, depths):
    """Lines of a deck that lowers the root through depths (mm), the points, and the side's nodes from the tip upwards."""
    points, quads = section(*parts)
    glass = grid_mesh_2d(np.linspace(0.0, 1.0, 21), np.array([-0.2, 0.0]))
    r, z = points.T
    side = np.flatnonzero(np.abs(r - (TIP + (ROOT - TIP) * z / HEIGHT)) < 1e-9)
    sets = {"ROOT": np.flatnonzero(z > HEIGHT - 1e-9), "TIP": np.flatnonzero(z < 1e-9), "AXIS": np.flatnonzero(r < 1e-9),
            "SIDE": side}
    numbers, plate = np.arange(1, len(quads) + 1), len(quads) + np.arange(1, 21)
    lines = ["*HEADING", "frustum on glass"] + _nodes(points, 1) + _nodes(glass.points, len(points) + 1, ", NSET=GLASS")
    lines += keywords.elements("CAX8R", "FRUSTUM", numbers, quads + 1)
    lines += keywords.elements("CAX8R", "PLATE", plate, glass.quads + len(points) + 1)
    for name, members in sets.items():
        lines += keywords.node_set(name, members + 1)
    lines += keywords.material("RUBBER", law_card(law, no_term=1e20, dialect="CalculiX"))
    lines += ["*SOLID SECTION, ELSET=FRUSTUM, MATERIAL=RUBBER", "*MATERIAL, NAME=RIGID", "*ELASTIC", "1000, 0.3",
              "*SOLID SECTION, ELSET=PLATE, MATERIAL=RIGID"]
    lines += keywords.surface("FOOT", [(n, 1) for n in numbers[:parts[0]]] + [(n, 2) for n in numbers[parts[0] - 1::parts[0]]])
    lines += keywords.surface("FLOOR", [(n, 3) for n in plate])
    lines += ["*SURFACE INTERACTION, NAME=HARD", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{HARD.stiffness:g}",
              "*CONTACT PAIR, INTERACTION=HARD, TYPE=NODE TO SURFACE", "FOOT, FLOOR"]
    for depth in depths:
        lines += ["*STEP, NLGEOM, INC=2000", "*STATIC", "0.05, 1, 1e-6, 0.05", "*BOUNDARY", "GLASS, 1, 2", "AXIS, 1, 1",
                  "TIP, 1, 1", "ROOT, 1, 1", f"ROOT, 2, 2, {-depth}",
                  "*NODE PRINT, NSET=ROOT, TOTALS=ONLY, FREQUENCY=10000", "RF", "*NODE PRINT, NSET=SIDE, FREQUENCY=10000", "U",
                  "*END STEP"]
    return lines, points, side[np.argsort(z[side])]


def _nodes(points, first, options=""):
    return [f"*NODE{options}"] + [f"{k}, {x:.12g}, {y:.12g}" for k, (x, y) in enumerate(points, start=first)]


def solve(name, folder):
    """Forces (N) and areas (mm2) that CalculiX finds at a law's DEPTHS."""
    lines, points, side = deck(LAWS[name], PARTS[name], DEPTHS[name])
    (folder / "frustum.inp").write_text("\n".join(lines) + "\n")
    subprocess.run(["ccx", "frustum"], cwd=folder, capture_output=True, check=True)
    printed = (folder / "frustum.dat").read_text()
    forces = [-_SECTOR * float(total) for total in re.findall(r"total force.*\n\s*\n\s*\S+\s+(\S+)", printed)]
    blocks = re.findall(r"displacements \(vx,vy,vz\).*\n\n((?:\s+\d+\s+\S+\s+\S+\s+\S+\n)+)", printed)
    areas = []
    for block in blocks:
        moved = {int(row[0]) - 1: [float(value) for value in row[1:3]] for row in map(str.split, block.strip().splitlines())}
        areas.append(lying_area(*(points[side] + [moved[node] for node in side]).T))
    return forces, areas


def lying_area(r, z):
    """Area (mm2) inside the radius at which a side (r, z from the tip upwards) leaves the glass by `DARK_GAP_MM`."""
    k = np.flatnonzero(z > DARK_GAP_MM)[0]
    return np.pi * np.interp(DARK_GAP_MM, z[k - 1:k + 1], r[k - 1:k + 1]) ** 2


@pytest.mark.gold
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
@pytest.mark.parametrize("name", AREAS)
def test_calculix_finds_the_areas_that_are_kept_here(name, tmp_path):
    forces, areas = solve(name, tmp_path)
    assert forces == pytest.approx(FORCES[name], rel=1e-3)
    assert areas == pytest.approx(AREAS[name], rel=1e-3)


@pytest.mark.parametrize("name", AREAS)
def test_the_kept_areas_hardly_change_with_calculix_s_mesh(name):
    """A third or a half finer changes them by less than 0.2 %, where 0.5 % was asked for."""
    finer, areas = FINER_AREAS[name]
    assert finer[1] >= 1.3 * PARTS[name][1]
    assert areas == pytest.approx(AREAS[name][:3], rel=2e-3)


def bonded(law, depths):
    """Forces (N) and areas (mm2) of our frustum, meshed as the stage meshes it, lowered through depths (mm)."""
    support = frustum(law=law, mesh=GLASS_MESH, contact=GLASS_MESH.contact)
    displacement, forces, areas = np.zeros((1, support.nodes, 3)), [], []
    for start, end in itertools.pairwise([0.0, *depths]):
        for depth in np.linspace(start, end, round((end - start) / 0.01) + 1)[1:]:
            displacement = equilibrium(support, displacement, depth)
        forces.append(-support.evaluate(displacement).force[0, support.root, 2].sum())
        areas.append(contact_area(support, displacement))
    return np.array(forces), np.array(areas)


@pytest.mark.slow
@pytest.mark.parametrize("name", AREAS)
def test_area_and_force_on_glass_meet_calculix(name, record):
    """Within 2 %: what half a row of our side's elements adds to the area, 1 %, and CalculiX's own rows."""
    forces, areas = bonded(LAWS[name], DEPTHS[name])
    for k, depth in enumerate(DEPTHS[name]):
        where = f"one frustum on glass, {name}, lowered by {depth} mm"
        assert record(f"{where}: contact area, mm2", expected=AREAS[name][k], source=SOURCE, got=areas[k]) < 0.02
        assert record(f"{where}: force, N", expected=FORCES[name][k], source=SOURCE, got=forces[k]) < 0.02
