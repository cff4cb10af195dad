"""The layered sensor: condensed against uncondensed solution, work, symmetry, rotation by 90 degrees.

Small sensors of a few frusta with the default sensor's measures.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from naive_sensor import NaiveSensor
from support.bodies import COARSE
from support.laws import LAWS
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.build import build_sensor_body, build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.models.hyperelastic.slab import Slab, SlabMesh
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

BOUND = MeshSettings(cover_heights=(0.0, 0.5, 1.0), cover_splits=(0,), far_pitches=1, frustum_heights=(0.0, 0.35, 1.0))
TIGHT = NewtonSettings(relative_tolerance=1e-8)


def small_spec(columns, rows, *, margin=0.6):
    """A sensor of columns x rows frusta with a strip of `margin` mm around them, its sides held up to the surface."""
    side = (1.2 * columns + 2 * margin, 1.2 * rows + 2 * margin)
    return CORO.model_copy(update={"footprint_mm": side, "map_shape": (4 * rows + 5, 4 * columns + 5),
                                    "edge": Edge(held="sides")})


def small_body(columns, rows, *, mesh=COARSE):
    return build_sensor_body(small_spec(columns, rows), dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=mesh)


def tilted_plate(x, y):
    """A plate that leans by 3 and 2 degrees: every point faces the same plane, so contact has no history."""
    slope = np.array([0.05, -0.03])
    normal = np.array([*slope, -1.0]) / np.linalg.norm([*slope, 1.0])
    return slope[0] * x + slope[1] * y, np.tile(normal, (len(x), 1))


def sphere(radius, *, at=(0.0, 0.0), turned=False):
    """A ball whose lowest point is at rest on the surface over `at`; its facets turned by 90 degrees or not."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    if turned:
        ball.vertices = ball.vertices @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return ball, Pose(np.array([*at, radius]))


def folding_body():
    """2 x 2 frusta whose slab glides on its sides, so that the frusta take the whole force and fold."""
    body = build_sensor_body(small_spec(2, 2, margin=0.0), dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=COARSE)
    fixed = body.slab
    slab = Slab(*fixed.layers, SlabMesh(fixed.sheet_mesh_2d, fixed.x_lines, fixed.y_lines,
                                       constrained_cell_edges=COARSE.constrained_cell_edges),
                sides="symmetric", contact=fixed.top.contact)
    return LayeredBody(slab, body.support, body.cells.roots)


CASES = {"sides held": (lambda: small_body(2, 2), [0.5, 1.0, 2.0, 4.0, 8.0]),
         "cover bound to the sheet's plan": (lambda: small_body(2, 2, mesh=BOUND), [0.5, 1.0, 2.0, 4.0]),
         "sides gliding, frusta folded": (folding_body, [0.2, 0.4, 0.8, 1.4, 2.0, 2.6, 3.2, 4.0])}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_condensing_the_frusta_changes_nothing(case, record):
    """All unknowns in one matrix, plain Newton steps, own contact sums: the states have to agree at every load step."""
    source = "the same energies with all unknowns in one sparse matrix"
    build, forces = CASES[case]
    body = build()
    naive = NaiveSensor(body, tilted_plate)
    for load_step in press_load_steps(body, tilted_plate, forces, settings=TIGHT):
        naive.press_to(load_step.force_n, load_step.state.history)
        slab, support = load_step.state.slab.displacement, load_step.state.support.displacement
        # unbalanced forces of up to 1e-7 N over the softest stiffness of 0.03 N/mm
        assert max(np.abs(naive.slab - slab).max(), np.abs(naive.support - support).max()) < 4e-6
    deviation = max(np.abs(naive.slab - slab).max(), np.abs(naive.support - support).max())
    record(f"2 x 2 frusta, {case}, {load_step.force_n:g} N: largest deviation of a displacement, mm", expected=0.0, source=source,
           got=deviation)
    record(f"2 x 2 frusta, {case}: depth", expected=naive.depth, source=source, got=load_step.state.indentation)
    error = record(f"2 x 2 frusta, {case}: stored energy", expected=naive.energy, source=source, got=load_step.state.energy)
    assert error < 1e-6
    assert ("folded" in case) == sides_touch(body, load_step.state.support)


def sides_touch(body, state):
    """Whether a frustum's side lies on the board."""
    touching = (state.gaps < 0) & (body.support.point_area > 0) & (body.support.point_neighbour < 0)
    tips = 9 * len(body.support.mesh.layer(0))                # the first points are those of the tips
    return bool(touching[:, tips:].any())


def test_the_work_of_the_force_is_the_stored_energy_to_second_order_in_the_load_step(record):
    """Frictionless, so nothing is lost. The trapezoidal rule's error falls to a quarter with half the step."""
    source = "energy stored in rubber and contacts: conservation of energy"
    body, errors = small_body(2, 2), []
    for steps in (3, 6, 12):
        work, stored = work_and_energy(body, np.linspace(2.0, 6.0, steps + 1))
        errors.append(record(f"work between 2 N and 6 N in {steps} steps", expected=stored, source=source, got=work))
    assert errors[0] > 3 * errors[1] > 9 * errors[2] and errors[2] < 1e-3


def work_and_energy(body, forces):
    """Work (mJ) of the force from the first load step to the last, and the growth of the stored energy."""
    # its potential stays
    load_steps = list(press_load_steps(body, tilted_plate, forces, settings=replace(TIGHT, max_augmentations=0)))
    depth = [load_step.state.indentation for load_step in load_steps]
    return np.trapezoid(forces, depth), load_steps[-1].state.energy - load_steps[0].state.energy


@pytest.fixture(scope="module")
def off_centre():
    """Deformation map (mm) of 3 x 4 frusta under a ball off the centre."""
    return press_map(small_spec(3, 4), at=(0.5, 0.7))


def press_map(spec, *, at, turned=False):
    ball, pose = sphere(2.5, at=at, turned=turned)
    return Sensor(spec, LAWS, mesh=COARSE).press(ball, pose=pose, force_n=[1.0, 3.0], model="hyperelastic").deformation_map_mm[-1]


# Newton's tolerance leaves 1e-4 of a nodal force; the ball's facets lie mirrored but for their diagonals.
SYMMETRY_TOLERANCE = 1e-3


@pytest.mark.parametrize(("name", "at", "flip"), [("left-right", (-0.5, 0.7), np.fliplr), ("front-back", (0.5, -0.7), np.flipud)])
def test_a_mirrored_off_centre_object_gives_the_mirrored_map(name, at, flip, off_centre, record):
    expected, source = 0.0, "mirror symmetry of the sensor"
    got = np.abs(flip(press_map(small_spec(3, 4), at=at)) - off_centre).max() / off_centre.max()
    record(f"mirrored press, {name}: deviation of the map over its maximum", expected=expected, source=source, got=got)
    assert got < SYMMETRY_TOLERANCE
    assert np.abs(flip(off_centre) - off_centre).max() > 0.1 * off_centre.max()      # the press is not its own mirror image


def test_sensor_and_object_turned_by_a_right_angle_give_the_turned_map(off_centre, record):
    expected, source = 0.0, "a rigid motion of sensor and object together"
    turned = press_map(small_spec(4, 3), at=(-0.7, 0.5), turned=True)           # (x, y) -> (-y, x)
    got = np.abs(turned[:, ::-1].T - off_centre).max() / off_centre.max()
    record("sensor and object turned by 90 degrees: deviation of the map over its maximum", expected=expected, source=source,
           got=got)
    assert got < SYMMETRY_TOLERANCE


def test_board_and_shell_carry_the_force(record):
    """Sum of the vertical forces on the sensor: the board's contact and the reaction of the held sides."""
    expected, source = 2.0, "balance of forces"
    body = small_body(3, 3)
    ball, pose = sphere(3.0, at=(0.3, -0.2))
    load_step, = press_load_steps(body, HeightField(place(ball, pose=pose)), [expected], settings=TIGHT)
    naive = NaiveSensor(body, tilted_plate)
    got = naive.board_force(load_step.state.support) + naive.side_reaction(load_step.state)
    error = record("force of board and sides", expected=expected, source=source, got=got)
    assert error < 1e-6      # Newton's tolerance of 1e-8 of 10 N at each node


def test_the_frusta_feel_contact_on_their_whole_surface(record):
    support = small_body(1, 1).support
    tip, root, slant = 0.3, 0.6, np.hypot(0.5, 0.3)
    tips = np.arange(len(support.point_axis)) < 9 * len(support.mesh.layer(0))
    for name, expected, points in (("tip", np.pi * tip**2, tips), ("side", np.pi * (tip + root) * slant, ~tips)):
        chosen = points & (support.point_neighbour < 0)
        error = record(f"area of contact points, {name} of a frustum, mm2", expected=expected, source="truncated cone",
                       got=support.point_area[0, chosen].sum())
        assert error < 2e-3      # the side is four parabolic arcs, not quite as long as the circle


def test_the_unit_cell_meets_the_law_of_a_refined_cell(record):
    """Far beyond folding, where sides lie on the board and on their neighbours."""
    expected, source = 0.40, "another program: refined cell of 27-node hexahedra with self-contact, 0.40 mm at 0.52 MPa"
    got = cell_compression(MeshSettings.converging(frustum_heights=(0.0, 0.1, 0.3, 0.6, 1.0)))
    error = record("compression of cell and cover at 0.52 MPa, four layers a frustum", expected=expected, source=source, got=got)
    assert error < 0.02      # two digits are known, and this mesh is not refined in plan


def test_the_stable_mesh_presses_the_unit_cell_as_the_default_one_does(record):
    default, stable = cell_compression(MeshSettings()), cell_compression(MeshSettings.stable())
    error = record("compression of cell and cover at 0.52 MPa, stable mesh", expected=default, source="default mesh", got=stable)
    assert error < 0.025     # eight times the stiffness against volume changes that an element's pressure does not see


def cell_compression(mesh):
    """Compression (mm) of one frustum of an endless lattice, with its share of sheet and cover, at 0.52 MPa."""
    body = build_unit_cell(CORO, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=mesh)
    plate = HeightField(place(trimesh.creation.box((5.0, 5.0, 1.0)), pose=None))
    load_steps = press_load_steps(body, plate, np.array([0.1, 0.22, 0.37, 0.52]) * 1.2**2,
                                  settings=NewtonSettings(smallest_scale_n=0.1))
    return list(load_steps)[-1].state.indentation
