"""Unit cell under refinement: stiffness at small strain of one frustum with its sheet in an endless lattice.

A smooth plate presses it, the tip is held on the board. The sensor's sheet meets the frustum node by node. The reference is
another discretisation: 20-node hexahedra, a square grid for the sheet, and a much finer root that is tied to it. Where the
frustum's side meets the sheet the stress is singular, so both converge slowly, in plan and height alike: every
direction is refined together, and the reference's limit is extrapolated.
"""

import numpy as np
import pytest
import scipy.sparse as sp
from fe import assemble, fine_disc, solid, solve_linear
from naive_sensor import NaiveSensor
from support.sensors import CORO

from softtact.fem.elements import QUAD8
from softtact.fem.extruded_mesh import extrude, grid_mesh_2d
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings, mesh_settings
from softtact.studies.decide.config import read_values

LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})
PITCH, HEIGHT, TIP_RADIUS, ROOT_RADIUS = 1.2, 0.5, 0.3, 0.6      # mm, of the default sensor; the sheet is as thick as HEIGHT
LAYERS, SHEET_LAYERS = 3, 2      # of the coarsest meshes
SOURCE = "naive solver, limit of a sheet of 4 x 4 x 2 and 8 x 8 x 4 elements, tied to roots of 80 and 320"


def refined(refinement):
    """Settings of the sensor's mesh with every element split so often in all directions."""
    finer = 2**refinement
    return MeshSettings.converging(sheet_layers=finer * SHEET_LAYERS, unprojected_penalty_ratio=0.0, refinement=refinement,
                                   frustum_heights=tuple(np.linspace(0, 1, finer * LAYERS + 1)))


def cell_stiffness(mesh, law=LAW):
    """MPa/mm of the sensor's own unit cell."""
    body = build_unit_cell(CORO, dielectric_law=law, mesh=mesh)
    naive = NaiveSensor(body, lambda x, y: (0 * x, np.tile([0.0, 0.0, -1.0], (len(x), 1))))
    matrix = sum(assemble(block.tangent(np.zeros((*nodes.shape, 3))), nodes, naive.nodes) for nodes, block in naive.parts)
    top = 3 * body.slab.cover_mesh.top_nodes + 2
    tips = 3 * (body.slab.nodes + body.support.tip) + 2
    return _lowered(naive.T.T @ matrix @ naive.T, np.isin(naive.unknowns, top), np.isin(naive.unknowns, tips))


def reference_stiffness(finer):
    """The same by the naive solver: a sheet of (4 finer)^2 elements on a root of 5 (4 finer)^2 faces."""
    cells = parts = 4 * finer
    layers, sheet_layers = finer * LAYERS, finer * SHEET_LAYERS
    lines = np.linspace(-0.5 * PITCH, 0.5 * PITCH, cells + 1)
    mesh_2d = grid_mesh_2d(lines, lines)
    sheet_mesh = extrude(mesh_2d, np.linspace(0, HEIGHT, sheet_layers + 1))
    sheet = solid(sheet_mesh, LAW)
    slope = (ROOT_RADIUS - TIP_RADIUS) / HEIGHT
    frustum = solid(extrude(fine_disc(parts), np.linspace(-HEIGHT, 0, layers + 1), scale=lambda z: ROOT_RADIUS + slope * z), LAW)
    matrix = sp.block_diag([body.stiffness(np.zeros_like(body.points)) for body in (sheet, frustum)]).tocsr()
    points = np.vstack([sheet.points, frustum.points])
    in_frustum = np.arange(len(points)) >= len(sheet.points)
    roots = np.flatnonzero(in_frustum & (points[:, 2] > -1e-9))
    held = np.zeros(points.shape, dtype=bool)
    held[:, :2] = (np.abs(np.abs(points[:, :2]) - 0.5 * PITCH) < 1e-9) & ~in_frustum[:, None]
    tip, top = points[:, 2] < -HEIGHT + 1e-9, points[:, 2] > HEIGHT - 1e-9
    held[tip, :2] = True
    held[roots] = True                               # no unknowns of their own
    keep = np.flatnonzero(~held.ravel())
    T = _tied(points, roots, lines, mesh_2d, sheet_mesh.planes[0]).tocsc()[:, keep]
    vertical = np.arange(3) == 2
    return _lowered(T.T @ matrix @ T, (top[:, None] & vertical).ravel()[keep], (tip[:, None] & vertical).ravel()[keep])


def _tied(points, roots, lines, mesh_2d, plane):
    """Sparse matrix (3 n, 3 n): every node its own, but the roots interpolated on the sheet's lower plane."""
    T = sp.lil_matrix((3 * len(points), 3 * len(points)))
    T.setdiag(np.where(np.isin(np.arange(len(points)), roots), 0.0, 1.0).repeat(3))
    size, count = lines[1] - lines[0], len(lines) - 1
    for root in roots:
        i, j = np.clip(((points[root, :2] - lines[0]) / size).astype(int), 0, count - 1)
        local = 2 * (points[root, :2] - lines[[i, j]]) / size - 1
        for node, weight in zip(plane[mesh_2d.quads[j * count + i]], QUAD8.shape(local[None])[0][0], strict=True):
            for k in range(3):
                T[3 * root + k, 3 * node + k] += weight
    return T


def _lowered(matrix, top, tips):
    """Force over depth and area (MPa/mm) when the unknowns `top` go down by 1 mm and `tips` stay."""
    x = np.where(top, -1.0, 0.0)
    free = np.flatnonzero(~(top | tips))
    matrix = matrix.tocsr()
    x[free] = solve_linear(matrix[free][:, free], -(matrix @ x)[free])
    return x @ (matrix @ x) / PITCH**2


@pytest.fixture(scope="module")
def coarse_and_fine():
    """The reference's stiffness with once and twice as many elements along each side."""
    return reference_stiffness(1), reference_stiffness(2)


@pytest.fixture(scope="module")
def limit(coarse_and_fine):
    """The reference's limit if its error is of first order, as a singularity leaves it; the test below proves that."""
    coarse, fine = coarse_and_fine
    return 2 * fine - coarse


@pytest.mark.slow
def test_the_reference_converges_with_first_order(coarse_and_fine, limit, record):
    """Then three times as many elements along each side leave a third of the first mesh's error."""
    expected = limit + (coarse_and_fine[0] - limit) / 3
    error = record("unit cell, reference with 12 x 12 x 6 sheet elements: stiffness, MPa/mm", expected=expected,
                   source="its error falls with first order", got=reference_stiffness(3))
    assert error < 1e-3      # a twentieth of what has still to fall


@pytest.mark.parametrize(("refinement", "bound"), [(0, 0.03), (1, 0.015), pytest.param(2, 0.0075, marks=pytest.mark.slow)])
def test_the_sensors_cell_converges_to_the_same_stiffness(refinement, bound, limit, record):
    """First order again: half the error with every refinement."""
    error = record(f"unit cell, sensor's mesh of even layers split {refinement} times: stiffness, MPa/mm", expected=limit,
                   source=SOURCE, got=cell_stiffness(refined(refinement)))
    assert error < bound


def test_the_default_mesh_is_a_tenth_too_stiff_at_most(limit, record):
    """One layer for the sheet, three for the frustum, and the volumetric stiffness at every point that lets it fold."""
    got = cell_stiffness(MeshSettings())
    record("unit cell, default mesh: stiffness, MPa/mm", expected=limit, source=SOURCE, got=got)
    assert limit < got < 1.12 * limit


def test_the_light_mesh_is_within_two_per_cent_with_no_more_unknowns(limit, record):
    """Its elements are smallest at the rim of tip and root, and its pressure is linear; for presses that fold no frustum."""
    got = cell_stiffness(MeshSettings.light())
    record("unit cell, light mesh: stiffness, MPa/mm", expected=limit, source=SOURCE, got=got)
    light, default = (build_unit_cell(CORO, dielectric_law=LAW, mesh=mesh) for mesh in (MeshSettings.light(), MeshSettings()))
    assert limit < got < 1.02 * limit and len(light.support.inner) == len(default.support.inner)


@pytest.mark.parametrize("truth", ["a", "b"])
def test_a_truths_elements_do_not_lock_in_nearly_incompressible_rubber(truth):
    """With K / mu0 of 200 the truths of config/decide.yaml are as near to a mesh of elements split once as with 20.

    Measured: 4.0 and 4.6 % above it, the tested model's draft mesh 7.9 and 10 %. Elements that lock would be off by a multiple.
    """
    mesh = mesh_settings(read_values("config/decide.yaml")["truths"][truth]["mesh"])
    excess = [cell_stiffness(mesh, law) / cell_stiffness(refined(1), law) - 1
              for law in (make_law("mooney_rivlin", LAW.parameters, bulk_over_shear=ratio) for ratio in (20, 200))]
    assert 0 < excess[0] < excess[1] < min(0.05, 1.25 * excess[0])
