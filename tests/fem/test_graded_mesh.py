"""Meshes of the cover whose elements are split here and there, and where they are split."""

import numpy as np
import pytest
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.penalty import Contact
from softtact.fem.elements import HEX20, reference_gradients
from softtact.fem.extruded_mesh import SheetMesh2D, grid_mesh_2d, merge, with_centres
from softtact.fem.graded_mesh import cover_mesh, split_depths
from softtact.fem.quadrature import gauss
from softtact.geometry.meshes import place
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.build import CURVED, EDGE, FAR, FLAT, NEAR, split_depths_of, zones
from softtact.models.hyperelastic.slab import Layer, Slab, SlabMesh

X, Y = np.array([-3.0, -1.5, -0.5, 1.0, 3.0]), np.array([-2.0, -1.0, 0.0, 2.0])
HEIGHTS = [-1.5, -0.8, -0.3, 0.0]
LAW = make_law("mooney_rivlin", {"c10": 0.1786, "c01": 0.0022}, bulk_modulus=7.0)


def random_levels(seed, caps=(0, 1, 2)):
    rng = np.random.default_rng(seed)
    depth = split_depths((len(X) - 1, len(Y) - 1), lambda low, size, depth: rng.random(len(low)) < 0.4, max(caps))
    return np.stack([np.minimum(depth, cap) for cap in caps])


def test_nodes_on_larger_elements_follow_every_quadratic_field():
    for caps in [(0, 0, 0), (0, 1, 2), (2, 1, 0), (1, 1, 3)]:
        for seed in range(3):
            mesh = cover_mesh(X, Y, HEIGHTS, random_levels(seed, caps))
            for power in ((0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 1), (1, 1, 0), (0, 0, 2), (1, 0, 1)):
                field = (mesh.points ** np.array(power)).prod(axis=1)
                assert mesh.follow @ field[:mesh.free] == pytest.approx(field, abs=1e-12), seed


def test_the_elements_fill_the_cover_and_its_faces_the_top_and_the_bottom():
    for seed in range(3):
        mesh = cover_mesh(X, Y, HEIGHTS, random_levels(seed))
        points, weights = gauss(2, 3)
        _, volumes = reference_gradients(mesh.points[mesh.hexes], HEX20.shape(points)[1], weights)
        assert volumes.sum() == pytest.approx(6 * 4 * 1.5), seed
        for faces, height in ((mesh.top, 0.0), (mesh.bottom, -1.5)):
            corner = mesh.points[faces[:, :4]]
            assert (corner[..., 2] == height).all(), seed
            assert np.prod(corner[:, 2, :2] - corner[:, 0, :2], axis=1).sum() == pytest.approx(24.0), seed


def test_the_least_volume_ratio_is_that_of_a_homogeneous_deformation():
    mesh = cover_mesh(X, Y, HEIGHTS, random_levels(0))
    gradient = np.array([[0.1, 0.3, 0.0], [-0.02, -0.2, 0.1], [0.0, 0.4, -0.5]])
    ratio = mesh.least_volume_ratio(mesh.points[:mesh.free] @ gradient.T)
    assert ratio == pytest.approx(np.linalg.det(np.eye(3) + gradient), rel=1e-12)


def test_a_corner_that_is_pushed_through_its_element_shows_in_the_least_volume_ratio_though_no_integration_point_is_inverted():
    """Along the side of 1 mm below a corner that is lowered by 0.45 mm, dz / dZ at it is 1 - 3 * 0.45."""
    mesh = cover_mesh(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.array([-1.0, 0.0]), np.zeros((1, 1, 1), dtype=int))
    lowered = np.zeros_like(mesh.points)
    lowered[np.flatnonzero((mesh.points == [1.0, 1.0, 0.0]).all(axis=1)), 2] = -0.45
    gradients, _ = reference_gradients((mesh.points + lowered)[mesh.hexes], HEX20.shape(gauss(2, 3)[0])[1], gauss(2, 3)[1])
    assert np.isfinite(gradients).all()      # which raises where a point is inverted
    assert mesh.least_volume_ratio(lowered) == pytest.approx(1 - 3 * 0.45, rel=1e-12)


@pytest.mark.parametrize("resists", [0, 1, 2])
@pytest.mark.parametrize("caps", [(0, 1, 2), (1, 0, 2)])
def test_a_split_slab_passes_the_patch_test(caps, resists):
    """A linear displacement: no force on nodes inside, to round-off, however many points of its cover resist folding."""
    none = np.zeros((0, 4), dtype=int)
    grid = grid_mesh_2d(np.linspace(-3, 3, 17), np.linspace(-2, 2, 9))   # each element under one of the cover
    mesh_2d = SheetMesh2D(merge(with_centres(grid.points[grid.quads])), np.zeros((0, 25), dtype=int), 0, (none, np.zeros(3)))
    x, y = np.linspace(-3, 3, 5), np.linspace(-2, 2, 5)
    rng = np.random.default_rng(0)
    depth = split_depths((4, 4), lambda low, size, depth: rng.random(len(low)) < 0.4, 2)
    slab = Slab(Layer(np.array([-2.0, -1.5]), LAW), Layer(np.array(HEIGHTS), LAW),
                SlabMesh(mesh_2d, x, y, np.stack([np.minimum(depth, cap) for cap in caps])), sides="held", contact=Contact())
    slab.resist_folding(resists)
    gradient = np.array([[0.1, 0.05, 0.0], [-0.02, -0.08, 0.03], [0.04, 0.0, -0.1]])
    displacement = slab.points @ gradient.T
    planes = slab.project(displacement, lambda x, y: (np.full(len(x), 1e3), np.tile([0.0, 0.0, -1.0], (len(x), 1))))
    force = slab.evaluate(displacement, planes, 0.0).force
    inside = (np.abs(slab.points - [0, 0, -1.0]) < [2.999, 1.999, 0.999]).all(axis=1)
    assert inside.sum() > 50 and np.abs(force[~inside]).max() > 0.01
    assert np.abs(force[inside]).max() < 1e-12


def punch_zones(mesh):
    lines = np.linspace(-9.6, 9.6, 9)
    return zones(HeightField(place(mesh)), lines, lines, 3), lines


def test_a_flat_punch_is_fine_at_its_edge_and_coarse_far_away():
    zone, lines = punch_zones(trimesh.creation.cylinder(radius=3.0, height=2.0, sections=96))
    centre = 0.5 * (np.linspace(lines[0], lines[-1], len(zone) + 1)[1:] + np.linspace(lines[0], lines[-1], len(zone) + 1)[:-1])
    r = np.hypot(*np.meshgrid(centre, centre))
    assert (zone[np.abs(r - 3.0) < 0.1] == EDGE).all() and (zone[r < 2.0] == FLAT).all()
    assert (zone[r > 6.5] == FAR).all() and set(np.unique(zone[(r > 4.0) & (r < 5.0)])) == {NEAR}
    splits = split_depths_of(np.array([0, 1, 1, 2, 3])[zone], (8, 8), 3)
    assert (splits[zone == EDGE] == 3).all() and splits[0, 0] == 0


def test_what_is_curved_does_not_depend_on_how_small_the_elements_become():
    """A ball's underside rises by a fifth beside its tip: far more than a flat one, in elements of any size."""
    for most in [3, 5]:
        lines = np.linspace(-9.6, 9.6, 9)
        zone = zones(HeightField(place(trimesh.creation.icosphere(subdivisions=6, radius=6.0))), lines, lines, most)
        centre = (np.arange(len(zone)) + 0.5) * 19.2 / len(zone) - 9.6
        r = np.hypot(*np.meshgrid(centre, centre))
        assert (zone[(r > 1.2) & (r < 2.0)] == CURVED).all()


def test_a_sphere_has_curved_ground_and_no_edge_where_it_first_touches():
    zone, lines = punch_zones(trimesh.creation.icosphere(subdivisions=5, radius=6.0))
    middle = len(zone) // 2
    assert (zone[middle - 2:middle + 2, middle - 2:middle + 2] < EDGE).all() and (zone == CURVED).any()
