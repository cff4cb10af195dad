"""The same press by CalculiX, from one element to a small sensor.

The element that both have gives the same nodal forces. CalculiX has neither the other two nor our projected pressure: then
what is expected is our own result, and each tolerance names what is left.
"""

import subprocess

import numpy as np
import pytest
import trimesh
from deck_study import Tables, gaussian_chains, needs_ccx, sharp
from support.laws import NEOPRENE, POLYURETHANE
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.decks import keywords
from softtact.decks.keywords import law_card
from softtact.decks.model import deck_model
from softtact.fem.elements import HEX20
from softtact.fem.solid_block import HexBlock
from softtact.geometry.meshes import place
from softtact.models.hyperelastic.build import build_sensor_body, build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.sensors.fields import Edge, SidesBelow
from softtact.sensors.frusta import Friction

pytestmark = needs_ccx
PATCH = CORO.model_copy(update={"footprint_mm": (4.8, 4.8), "edge": Edge(held="sides")})     # 4 x 4 frusta
PLATE = place(trimesh.creation.box((5.0, 5.0, 1.0)))
BAR = place(trimesh.creation.cylinder(radius=8.0, height=7.0, sections=400,
                                      transform=trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])))
SPHERE = place(trimesh.creation.icosphere(subdivisions=4, radius=3.0))


def press(body, placed, forces):
    settings = NewtonSettings(smallest_scale_n=0.1, smallest_increment_n=1e-3)
    return list(press_load_steps(body, HeightField(placed), forces, settings=settings))


def interface_error(body, load_steps, tables):
    """Largest and root mean square difference (load steps, 2) of the interface's deflection, as shares of its largest."""
    plane = np.sort(body.slab.cover_mesh.bottom_nodes)      # the cover's nodes come first in a deck, too
    errors = []
    for load_step, table in zip(load_steps, tables, strict=True):
        assert (table[:, 0] == plane + 1).all()
        ours = load_step.state.slab.displacement[plane, 2]
        difference = (table[:, 3] - ours) / np.abs(ours).max()
        errors.append((np.abs(difference).max(), np.sqrt((difference**2).mean())))
    return np.array(errors)


@pytest.mark.parametrize(("kind", "points"), [("C3D20", 3), ("C3D20R", 2)])
def test_a_distorted_element_has_the_nodal_forces_of_ccx(kind, points, tmp_path):
    """The cover's element, all nodes prescribed, so nothing is solved: element, law and node order alone.

    Tolerance: the printed digits.
    """
    rng = np.random.default_rng(0)
    coordinates, displacement = HEX20.nodes + 0.05 * rng.standard_normal((20, 3)), 0.1 * rng.standard_normal((20, 3))
    law = gaussian_chains(0.35)
    lines = keywords.nodes(coordinates, 1, name="NODES") + keywords.elements(kind, "ALL", [1], [np.arange(1, 21)])
    lines += keywords.material("RUBBER", law_card(law, no_term=1e20, dialect="CalculiX"))
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=RUBBER", "*STEP, NLGEOM", "*STATIC", "0.5, 1", "*BOUNDARY"]
    lines += [f"{n + 1}, {i + 1}, {i + 1}, {float(u)!r}" for n, row in enumerate(displacement) for i, u in enumerate(row)]
    lines += ["*NODE PRINT, NSET=NODES, FREQUENCY=1000", "RF", "*END STEP"]
    (tmp_path / "one.inp").write_text("\n".join(lines) + "\n")
    subprocess.run(["ccx", "one"], cwd=tmp_path, capture_output=True, check=True)
    found = Tables(tmp_path / "one.dat").of("NODES")[0][:, 1:]
    block = HexBlock(coordinates[None], law, reduced=points == 2, unprojected_penalty_ratio=20.0)
    expected = block.evaluate(displacement[None]).force.reshape(20, 3)
    assert found == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())


def cell_error(mesh, forces, solve, **elements):
    """Error (f,) of the force that CalculiX needs at the indentations of our unit cell under a plate."""
    body = sharp(build_unit_cell(CORO, dielectric_law=POLYURETHANE, mesh=mesh))
    depths = [load_step.state.indentation for load_step in press(body, PLATE, forces)]
    return solve(deck_model(body, PLATE, indentations_mm=depths), **elements).force / forces - 1


@pytest.mark.slow
def test_a_unit_cell_needs_nearly_the_force_of_calculix(solve):
    """The default mesh, until the sides lie on the board. Left: the elements; +5.1, +4.6, +0.6, +1.7 % measured.

    Our frusta's wide core makes them a per cent softer and comes nearer to a refined mesh; the 20-node elements gain less by it.
    """
    assert np.abs(cell_error(MeshSettings(), np.array([0.05, 0.1, 0.2, 0.3]), solve)).max() < 0.055


@pytest.mark.slow
def test_what_the_elements_differ_by_halves_with_every_element_split(solve):
    """First order, as the singular stress at tip and root leaves it; 9.6 % became 4.8 %.

    Without the stiffness at every point, which hides part of the difference. CalculiX is the stiffer one: its 20-node
    elements lose an order where they are distorted, as the wedges between roots are.
    """
    forces = np.array([0.05])
    coarse = cell_error(MeshSettings.converging(constrained_cell_edges=True), forces, solve)
    fine = cell_error(MeshSettings.converging(refinement=1, sheet_layers=2,
                                              frustum_heights=(0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)), forces, solve)
    assert (coarse > 0).all() and (np.abs(fine) < 0.6 * coarse).all()


@pytest.mark.slow
def test_a_small_sensor_gives_way_as_in_calculix(solve):
    """A sphere on 16 frusta. Left: the elements, and our facing planes against the projections of CalculiX.

    The cover's lower side a pitch wide: the nodes of a finer one meet the middles of the sheet's faces, where 20-node elements
    have no node, and would hang freely there (10 % of the interface's maximum).

    Indentation within 2 %, the interface 1.5 % of its maximum in the mean and 5.9 % where four cells meet under the sphere: the
    wedges there have 15 nodes in CalculiX, which then lose an order.
    """
    forces = [2.0, 4.0]
    body = sharp(build_sensor_body(PATCH, dielectric_law=POLYURETHANE, cover_law=NEOPRENE, surface=HeightField(SPHERE),
                                   mesh=MeshSettings(cover_heights=(0.0, 0.45, 0.8, 1.0), cover_splits=(0, 1, 2))))
    load_steps = press(body, SPHERE, forces)
    tables = solve(deck_model(body, SPHERE, forces_n=forces))
    assert tables.force[1:] == pytest.approx(forces, rel=1e-4)
    assert tables.indentation[1:] == pytest.approx([load_step.state.indentation for load_step in load_steps], rel=0.02)
    largest, rms = interface_error(body, load_steps, tables.of("INTERFACE")[1:]).T
    assert largest.max() < 0.07 and rms.max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("edge", "depth", "largest", "rms"), [
    (Edge(held="free"), 0.012, 0.04, 0.025), (Edge(held=SidesBelow(sides_below_mm=1.5)), 0.04, 0.14, 0.055)],
    ids=["free", "cover-free"])
def test_a_round_bar_across_the_whole_sensor_gives_way_as_in_calculix(edge, depth, largest, rms, solve):
    """It overhangs the pad on both sides and presses the free rim of the cover, which bulges beyond the footprint.

    Measured: with free sides the depth is 0.9 and 0.3 % off, the interface 1.8 and 0.9 % (rms). Where the sheet's sides are held,
    the bar shears its outer cells within one element, CalculiX is stiffer by 3 % and the interface 4.9 % off (rms); that its
    20-node elements there are the cause is likely, not shown.
    """
    forces = [2.0, 4.0]
    body = sharp(build_sensor_body(PATCH.model_copy(update={"edge": edge}), dielectric_law=POLYURETHANE, cover_law=NEOPRENE,
                                   surface=HeightField(BAR),
                                   mesh=MeshSettings(cover_heights=(0.0, 0.45, 0.8, 1.0), cover_splits=(0, 1, 2))))
    load_steps = press(body, BAR, forces)
    tables = solve(deck_model(body, BAR, forces_n=forces))
    assert tables.indentation[1:] == pytest.approx([load_step.state.indentation for load_step in load_steps], rel=depth)
    at_most, mean = interface_error(body, load_steps, tables.of("INTERFACE")[1:]).T
    assert at_most.max() < largest and mean.max() < rms


@pytest.mark.slow
def test_a_sphere_with_friction_on_frusta_that_may_slide_needs_nearly_the_force_of_calculix(solve):
    """The same sensor with friction of 0.3 on both sides; +1.8 and +1.3 % measured.

    At these indentations a press without friction takes 4 and 6 % less.
    """
    spec = PATCH.model_copy(update={"tips_bonded": False, "friction": Friction(object=0.3, board=0.3)})
    forces = np.array([1.0, 2.0])
    body = sharp(build_sensor_body(spec, dielectric_law=POLYURETHANE, cover_law=NEOPRENE, surface=HeightField(SPHERE),
                                   mesh=MeshSettings(cover_heights=(0.0, 0.45, 0.8, 1.0), cover_splits=(0, 1, 2))))
    depths = [load_step.state.indentation for load_step in press(body, SPHERE, forces)]
    tables = solve(deck_model(body, SPHERE, indentations_mm=depths))
    assert np.abs(tables.force / forces - 1).max() < 0.025
