"""Sensors on bodies of anyone's MuJoCo scene: a known weight is read, from the engine's forces and from its poses."""

import copy
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.gels import SMALL_GEL

import softtact
from softtact.errors import InputError
from softtact.geometry.pose import Pose

mujoco = pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
from softtact.robot import attach, hand_back  # noqa: E402
from softtact.robot.geoms import body_mesh  # noqa: E402

G = 9.81
# The sensing surface is at z = 0: the plate ends 2.5 mm below, where the board of the sensor lies.
SCENE = """<mujoco><option timestep="{dt}"/><worldbody>
  <body name="plate" euler="{tilt} 0 0">
    <geom name="plate" type="box" size=".03 .04 .01" pos="0 0 -.0125" {collides}/><site name="top" pos="0 0 0"/></body>
  {objects}</worldbody></mujoco>"""
BOX = '<body name="box" pos="{x} {y} {z}"><freejoint/><geom type="box" size=".005 .006 .01" mass="{mass}"/></body>'
NO_CONTACT = 'contype="0" conaffinity="0"'
BALL = '<body name="ball" pos="-.005 -.012 .0061"><freejoint/><geom type="sphere" size=".006" mass=".2"/></body>'

WITH_FOOT = """<body name="tool" pos="0 0 .0101"><freejoint/><geom type="box" size=".002 .002 .01" pos="-.005 0 0" mass=".2"/><body
  pos=".005 0 .01" euler="0 90 0"><body><geom type="box" size=".01 .002 .002" pos=".01 0 0" mass=".2"/></body></body></body>"""

HAND = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body name="palm" pos="0 0 .2">
  <geom type="box" size=".06 .02 .01" pos="0 0 .06" contype="0" conaffinity="0"/>
  <body name="left" pos="-.0152 0 0"><joint name="left" type="slide" axis="1 0 0" damping="20"/>
    <geom type="box" size=".005 .012 .02" pos="-.0075 0 0" mass=".1"/></body>
  <body name="right" pos=".0152 0 0"><joint name="right" type="slide" axis="-1 0 0" damping="20"/>
    <geom type="box" size=".005 .012 .02" pos=".0075 0 0" mass=".1"/></body></body>
  <body name="part" pos="0 0 .2" gravcomp="1"><freejoint/><geom type="{type}" size="{size}" {turn} mass=".05"/></body></worldbody>
  <actuator><motor joint="left" ctrlrange="0 20"/><motor joint="right" ctrlrange="0 20"/></actuator></mujoco>"""
LEFT, RIGHT = [0, 0, 0, 0, 90, 0], [0, 0, 0, 0, -90, 0]     # z towards the other finger


def scene(objects, *, dt=0.002, tilt=0.0, collides=""):
    return SCENE.format(dt=dt, tilt=tilt, objects=objects, collides=collides)


def box(mass=0.5, x=0.0, y=0.0, z=0.0101):
    return BOX.format(mass=mass, x=x, y=y, z=z)


def settled(model, seconds=0.4, sensors=(), each=lambda data: None):
    """The state after a time; sensors: those that hand their force back."""
    data = mujoco.MjData(model)
    while data.time < seconds:
        if sensors:
            each(hand_back(data, sensors))
        mujoco.mj_step(model, data)
    return data


@pytest.fixture(scope="module")
def coro():
    return softtact.load_sensor("coro")


@pytest.fixture(scope="module")
def weighed(coro):
    """(reading, mass) of a box that rests on the sensor."""
    spec = mujoco.MjSpec.from_string(scene(box(0.5)))
    sensor = attach(spec, "plate", coro)
    return sensor.read(settled(spec.compile())), 0.5


def test_a_box_of_known_weight_is_read_within_two_percent(weighed):
    reading, mass = weighed
    assert reading.force_n == pytest.approx([0, 0, -mass * G], rel=0.02, abs=0.02 * mass * G)
    assert list(reading.objects) == ["box"] and not reading.validity_reason


def test_under_a_flat_contact_all_taxels_below_it_fire_and_alike(weighed, coro):
    counts = weighed[0].tactile_map
    taxels = coro.spec.taxels
    x, y = (side * (np.arange(count) + 0.5 - 0.5 * count) / count for side, count in
            zip(coro.spec.footprint_mm, (taxels.columns, taxels.rows), strict=True))
    below = (np.abs(y)[:, None] < 6.0) & (np.abs(x) < 5.0)
    assert below.sum() == 6 and (counts[below] > 0.5 * counts.max()).all()
    assert counts[2, 1] == pytest.approx(counts[4, 2], rel=0.01)     # the box is in the middle: its halves read the same


def test_the_reading_is_that_of_a_press_with_the_weight(weighed, coro):
    exact = coro.press(body_mesh(mujoco.MjModel.from_xml_string(scene(box())), 2), force_n=weighed[1] * G, model="elastic")
    assert weighed[0].tactile_map == pytest.approx(exact.tactile_map[0], abs=1e-3 * exact.tactile_map.max())
    assert weighed[0].deformation_map_mm == pytest.approx(exact.deformation_map_mm[0], abs=1e-3 * exact.deformation_map_mm.max())
    assert weighed[0].expected_error_mm == pytest.approx(exact.expected_error_mm[0], rel=1e-3)


def test_several_objects_are_read_beside_each_other(coro):
    spec = mujoco.MjSpec.from_string(scene(box(0.5, x=0.004, y=0.01) + BALL))
    sensor = attach(spec, "plate", coro)
    reading = sensor.read(settled(spec.compile()))
    pressing = {name: -force[2] for name, force in reading.objects.items()}
    assert pressing == pytest.approx({"box": 0.5 * G, "ball": 0.2 * G}, rel=0.02)
    assert reading.tactile_map[0:2, 0].sum() > 50 and reading.tactile_map[4:, 2:].sum() > 50


def test_a_box_that_the_engine_holds_off_by_a_margin_presses_with_its_weight(coro):
    spec = mujoco.MjSpec.from_string(scene(box(0.5, z=0.014).replace("mass", 'margin=".004" mass')))
    sensor = attach(spec, "plate", coro)
    assert -sensor.read(settled(spec.compile())).force_n[2] == pytest.approx(0.5 * G, rel=0.02)


def test_bodies_fixed_to_an_object_press_with_it(coro):
    read = {}
    for source, collides in (("contacts", ""), ("poses", NO_CONTACT)):
        spec = mujoco.MjSpec.from_string(scene(WITH_FOOT, collides=collides))
        sensor = attach(spec, "plate", coro, source=source)
        data = settled(spec.compile(), sensors=[sensor] if source == "poses" else ())
        read[source] = sensor.read(data)
        assert {name: -force[2] for name, force in read[source].objects.items()} == pytest.approx({"tool": 0.4 * G}, rel=0.02)
    maps = [one.deformation_map_mm for one in read.values()]
    assert np.abs(maps[0] - maps[1]).max() < 0.03 * maps[0].max()


MOVED = """<mujoco><option timestep="0.002" gravity="0 0 -9.81"/><worldbody>
  <body name="hand" pos="0 0 .0126"><joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass=".5" diaginertia="1 1 1"/></body>
  {tool}</worldbody></mujoco>"""
TOOLS = {"tool": '<body name="tool" mocap="true"><body name="tip"><geom type="box" size=".005 .005 .01"/></body></body>',
         "middle": '<body name="base"><body name="middle"><body><geom type="box" size=".005 .005 .01"/></body></body></body>'}


@pytest.mark.parametrize("name", TOOLS)
def test_the_bodies_that_hang_on_a_named_object_count_as_it(coro, name):
    """A sensor of 500 g that faces down rests on a geom of the object's child."""
    spec = mujoco.MjSpec.from_string(MOVED.format(tool=TOOLS[name]))
    sensor = attach(spec, "hand", coro, pose=[0, 0, 0, 180, 0, 0], objects=[name])
    reading = sensor.read(settled(spec.compile()))
    assert {one: -force[2] for one, force in reading.objects.items()} == pytest.approx({name: 0.5 * G}, rel=0.02)


CLOTH = """<flexcomp name="cloth" type="grid" dim="2" count="5 5 1" spacing=".004 .004 .004" pos="0 0 .002" radius=".0005"
  mass=".1"/>"""


@pytest.mark.filterwarnings("ignore:flex 'cloth' is not rigid")
def test_a_cloth_that_touches_is_refused_and_left_out_where_objects_are_named(coro):
    read = []
    for objects in (None, ["box"]):
        spec = mujoco.MjSpec.from_string(scene(box(x=0.1) + CLOTH))
        sensor = attach(spec, "plate", coro, objects=objects)
        read.append((sensor, settled(spec.compile(), 0.1)))
    with pytest.raises(InputError, match="A flex touches the sensor on 'plate', which a sensor cannot press; name in 'objects'"):
        read[0][0].read(read[0][1])
    assert not read[1][0].read(read[1][1]).objects


def test_what_only_shows_on_an_object_is_not_pressed():
    label = f'<body pos="0 0 -.012"><geom type="sphere" size=".002" {NO_CONTACT} mass="0"/></body></body>'
    bare, labelled = (mujoco.MjModel.from_xml_string(scene(one)) for one in (box(), box().replace("</body>", label)))
    assert body_mesh(labelled, 2).bounds == pytest.approx(body_mesh(bare, 2).bounds)
    shown = mujoco.MjModel.from_xml_string(scene(box().replace("</body>", label).replace('mass="0.5"', f'mass="0.5" {NO_CONTACT}')))
    assert body_mesh(shown, 2).bounds[0, 2] == pytest.approx(-14.0, abs=1e-3)


@pytest.mark.parametrize("joint", ["", "<joint type='slide'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"])
def test_a_free_base_that_carries_the_sensor_is_no_object(coro, joint):
    hand = f'<body name="hand">{joint}</body>'
    base = f'<body name="base"><freejoint/><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>{hand}</body>'
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{base}{box(z=0.0099)}</worldbody></mujoco>")
    sensor = attach(spec, "hand", coro, source="poses")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert list(sensor.read(data).objects) == ["box"]


def test_a_model_that_lacks_a_named_object_is_refused_at_each_reading_and_then_another_is_read(coro):
    models = {name: mujoco.MjModel.from_xml_string(scene(box().replace('"box"', f'"{name}"', 1))) for name in ("box", "cube")}
    states = {name: settled(model, 0.05) for name, model in models.items()}
    sensor = attach(models["box"], "plate", coro, objects=["box"])
    first = sensor.read(states["box"]).force_n
    for _ in range(2):
        with pytest.raises(InputError, match="'box'"):
            sensor.read(states["cube"])
    assert (sensor.read(states["box"]).force_n == first).all()


@pytest.mark.parametrize(("own", "given", "expected"), [(0.25, None, 0.25), (0.25, 0.6, 0.6), (0.0, None, 1.0), (0.25, 0.0, 0.0)])
def test_an_added_pad_has_the_friction_that_is_given_or_the_sensor_s_own(coro, own, given, expected):
    spec = mujoco.MjSpec.from_string(scene(box()))
    attach(spec, "plate", coro.with_friction(own), friction=given)
    assert spec.geom("plate_pad").friction[0] == pytest.approx(expected)


def test_only_named_objects_count(coro):
    spec = mujoco.MjSpec.from_string(scene(box(0.5, x=0.004, y=0.01) + BALL))
    sensor = attach(spec, "plate", coro, objects=["ball"])
    assert list(sensor.read(settled(spec.compile())).objects) == ["ball"]


@pytest.mark.parametrize(("dt", "mass"), [(0.002, 0.02), (0.005, 0.5)])     # unstable as an explicit force above 0.5 ms
def test_the_force_of_a_sensor_carries_a_box_in_place_of_the_engine_s_contact(coro, dt, mass):
    spec = mujoco.MjSpec.from_string(scene(box(mass, x=0.002, y=0.003), dt=dt, collides=NO_CONTACT))
    sensor = attach(spec, "plate", coro, source="poses", friction=0.5)
    pushed = []
    data = settled(spec.compile(), 50 * dt, [sensor], pushed.append)
    assert pushed[-1]["box"] == pytest.approx([0, 0, mass * G], abs=1e-3 * mass * G)
    assert sensor.read(data).force_n == pytest.approx([0, 0, -mass * G], rel=0.02)
    assert np.abs(data.qvel).max() < 1e-2


@pytest.mark.filterwarnings("ignore::softtact.errors.ShellWarning")
def test_a_plate_that_met_the_shell_alone_is_pressed_when_it_lies_on_the_pad(coro):
    """A plate tilted by 40 degrees touches the shell beside the pad; then it lies flat, 0.3 mm deep."""
    plate = '<body name="lid" pos="0 0 .05"><freejoint/><geom type="box" size=".02 .004 .002" mass=".5"/></body>'
    model = mujoco.MjModel.from_xml_string(scene(plate, collides=NO_CONTACT))

    def placed(data, degrees, height_mm):
        data.qpos[3:] = Rotation.from_euler("y", degrees, degrees=True).as_quat(scalar_first=True)
        data.qpos[:3], data.qvel[:] = [0.0, 0.0, 1e-3 * height_mm], 0.0
        mujoco.mj_forward(model, data)
        return data

    sensor, data = attach(model, "plate", coro, source="poses", friction=0.5), mujoco.MjData(model)
    height_mm = next(float(height) for height in np.arange(11.6, 9.0, -0.1) if sensor.touching(placed(data, 40.0, height)))
    assert not hand_back(placed(data, 40.0, height_mm), [sensor]) and sensor.held(data)
    lying = hand_back(placed(data, 0.0, 1.7), [sensor])
    fresh = attach(model, "plate", coro, source="poses", friction=0.5)
    assert lying["lid"] == pytest.approx(hand_back(placed(data, 0.0, 1.7), [fresh])["lid"], rel=0.02, abs=1e-6)
    assert lying["lid"][2] > 5.0


@pytest.mark.parametrize(("friction", "slides"), [(0.5, False), (0.2, True)])
def test_a_box_on_a_tilted_sensor_slides_where_friction_is_less_than_the_slope(coro, friction, slides):
    slope, along, seconds = np.radians(17.0), Rotation.from_euler("x", 17.0, degrees=True), 0.05     # tan = 0.306
    _, y, z = along.apply([0.0, 0.006, 0.00997])     # about as deep as its weight takes it
    tilted = scene(box(0.3, y=y, z=z).replace('"box"', '"box" euler="17 0 0"', 1), tilt=17.0, collides=NO_CONTACT)
    model = mujoco.MjModel.from_xml_string(tilted)
    data = settled(model, seconds, [attach(model, "plate", coro, source="poses", friction=friction)])
    foot = data.body("box").xpos + data.body("box").xmat.reshape(3, 3) @ [0.0, 0.0, -0.01]
    free_mm = 0.5e3 * G * (np.sin(slope) - friction * np.cos(slope)) * seconds**2
    assert 6.0 - 1e3 * along.inv().apply(foot)[1] == pytest.approx(free_mm if slides else 0.0, abs=0.15)     # in shear: 0.03


def test_a_depth_is_read_as_the_press_that_is_as_deep(coro):
    model = mujoco.MjModel.from_xml_string(scene(BALL, collides=NO_CONTACT))
    data = mujoco.MjData(model)
    data.qpos[:3] = [0.0, 0.0, 0.0059]
    mujoco.mj_forward(model, data)
    reading = attach(model, "plate", coro, source="poses").read(data)
    exact = coro.press(body_mesh(model, 2), force_n=-reading.force_n[2], model="elastic")
    assert exact.indentation_mm[0] == pytest.approx(0.1, rel=0.01) and -reading.force_n[2] > 0.1


def read_at(coro, objects, height_mm):
    """The reading from the pose of the only object, at a height of its middle over the sensing surface."""
    model = mujoco.MjModel.from_xml_string(scene(objects, collides=NO_CONTACT))
    data = mujoco.MjData(model)
    data.qpos[:3] = [0.0, 0.0, 1e-3 * height_mm]
    mujoco.mj_forward(model, data)
    return attach(model, "plate", coro, source="poses").read(data)


@pytest.mark.parametrize(("objects", "name", "height_mm"), [(box(), "box", 7.4), (box(), "box", 0.0), (BALL, "ball", 2.0),
                                                            (BALL, "ball", -2.4)])
def test_an_object_driven_deeper_than_the_sensor_is_thick_reads_the_largest_force_and_says_so(coro, objects, name, height_mm):
    reading = read_at(coro, objects, height_mm)
    assert -reading.force_n[2] == pytest.approx(50.0, rel=1e-3) and reading.deformation_map_mm.max() > 0.5
    assert f"{name}: the force is above 50 N, the sensor's limit" in reading.validity_reason


def test_a_depth_that_the_largest_force_does_not_reach_says_so(coro):
    assert read_at(coro, box(), 8.8).validity_reason == "box: the force is above 50 N, the sensor's limit"
    assert not read_at(coro, box(), 9.5).validity_reason     # 0.5 mm: 38 N


def test_a_depth_at_which_feet_rest_on_the_shell_says_so_and_not_the_largest_force(coro):
    """Feet beside the pad, 1.8 mm below the ball's lowest point less 0.6 mm, meet the shell 1.5 mm below at a depth of 0.3 mm."""
    feet = "".join(f'<geom type="box" size=".0005 .002 .003" pos="{x} 0 .0018"/>' for x in (-0.012, 0.012))
    ball = f'<body name="tool" pos="0 0 0"><freejoint/><geom type="sphere" size=".003" pos="0 0 .003"/>{feet}</body>'
    reading = read_at(coro, ball, -0.6)
    assert "tool: the object rests on the shell beside the pad" in reading.validity_reason and -reading.force_n[2] < 2.0


def test_an_object_wholly_below_the_surface_says_so_as_in_a_press_alone(coro):
    plate = '<body name="coin" pos="0 0 0"><freejoint/><geom type="box" size=".003 .003 .0001" mass=".1"/></body>'
    assert "coin: the object is 0.2 mm high, and its top is below the surface" in read_at(coro, plate, -0.15).validity_reason
    assert not read_at(coro, plate, -0.05).validity_reason


def test_a_small_ball_that_is_wholly_in_the_sensor_is_still_pressed_and_says_so(coro):
    """Its middle is further below the surface than it is wide, and above the board."""
    bead = '<body name="bead"><freejoint/><geom type="sphere" size=".001" mass=".1"/></body>'
    within, beneath = (read_at(coro, bead, height) for height in (-1.1, -2.6))
    assert list(within.objects) == ["bead"] and "its top is below the surface" in within.validity_reason
    assert not beneath.objects


def test_an_object_beneath_the_board_does_not_touch(coro):
    reading = read_at(coro, box(), -2.6)     # the board is at -2.5 mm
    assert not reading.objects and not reading.force_n.any() and not reading.validity_reason


def test_a_box_that_one_step_drives_through_the_sensor_comes_back_up(coro):
    model = mujoco.MjModel.from_xml_string(scene(box(0.5), collides=NO_CONTACT))
    sensor = attach(model, "plate", coro, source="poses")
    data = mujoco.MjData(model)
    data.qvel[2], lowest = -2.0, []     # m/s: 4 mm in a step
    for _ in range(100):
        hand_back(data, [sensor])
        mujoco.mj_step(model, data)
        lowest.append(1e3 * data.qpos[2] - 10.0)
    assert min(lowest) < -2.5 and lowest[-1] == pytest.approx(-0.065, abs=0.01)     # its weight sinks in by 0.065 mm


def grip(coro, shape, size, turn="", *, seconds=0.3, **options):
    spec = mujoco.MjSpec.from_string(HAND.format(type=shape, size=size, turn=turn))
    sensors = [attach(spec, finger, coro, pose=pose, **options) for finger, pose in (("left", LEFT), ("right", RIGHT))]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = 5.0
    while data.time < seconds:
        if options:
            hand_back(data, sensors)
        mujoco.mj_step(model, data)
    return [sensor.read(data) for sensor in sensors]


@pytest.mark.parametrize(("shape", "size", "turn"), [
    ("box", ".015 .006 .008", ""), ("sphere", ".015", ""), ("ellipsoid", ".015 .02 .01", ""),
    ("capsule", ".015 .01", ""), ("cylinder", ".008 .015", 'euler="0 90 0"')])
def test_both_fingers_of_a_hand_read_the_force_of_their_motors_on_every_shape(coro, shape, size, turn):
    left, right = grip(coro, shape, size, turn)
    assert -left.force_n[2] == pytest.approx(5.0, rel=0.02) and -right.force_n[2] == pytest.approx(5.0, rel=0.02)
    assert not left.validity_reason and left.tactile_map.sum() == pytest.approx(right.tactile_map.sum(), rel=0.02)


def test_a_hand_holds_a_part_by_the_forces_of_its_sensors(coro):
    left, right = grip(coro, "box", ".015 .006 .008", source="poses", seconds=0.02)
    assert -left.force_n[2] == pytest.approx(5.0, rel=0.02) and -right.force_n[2] == pytest.approx(5.0, rel=0.02)


def test_a_mesh_is_pressed_in_its_true_shape(coro):
    spec = mujoco.MjSpec.from_string(scene(""))
    part = spec.worldbody.add_body(name="part", pos=[0, 0, 0.02])
    import trimesh

    stand = trimesh.creation.box((16, 16, 4), transform=trimesh.transformations.translation_matrix([0, 0, 6]))
    feet = [trimesh.creation.box((3, 16, 4), transform=trimesh.transformations.translation_matrix([x, 0, 2])) for x in (-6.5, 6.5)]
    mesh = trimesh.util.concatenate([stand, *feet])
    spec.add_mesh(name="part", uservert=(1e-3 * mesh.vertices).ravel(), userface=mesh.faces.ravel())
    part.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="part", mass=0.1)
    model = spec.compile()
    found = body_mesh(model, 2)
    assert found.bounds == pytest.approx(mesh.bounds, abs=1e-5) and found.volume == pytest.approx(mesh.volume, rel=1e-5)


def test_a_gel_with_a_camera_sees_what_touches_it(tmp_path):
    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    gel = softtact.load_sensor(tmp_path / "gel.yaml")
    spec = mujoco.MjSpec.from_string(scene(box(0.2), tilt=5.0))
    sensor = attach(spec, "plate", gel, friction=0.8)
    model = spec.compile()
    free = sensor.read(settled(model, 0.001))
    reading = sensor.read(settled(model, 0.05))
    assert reading.force_n[2] < -1.0 and reading.deformation_map_mm.max() > 0.01
    assert np.abs(reading.readings["camera"].astype(int) - free.readings["camera"]).max() > 20


def test_the_sensor_s_frame_may_be_that_of_a_site_and_the_body_s_own_geoms_touch(coro):
    text = scene(box(0.5, z=0.0076)).replace('name="top" pos="0 0 0"', 'name="top" pos="0 0 -.0025"')
    model = mujoco.MjModel.from_xml_string(text)
    reading = attach(model, "plate", coro, pose="top").read(settled(model))
    assert -reading.force_n[2] == pytest.approx(0.5 * G, rel=0.02)


def test_a_scene_that_begins_again_forgets_its_contacts(coro):
    spec = mujoco.MjSpec.from_string(scene(box(0.5), collides=NO_CONTACT))
    sensor = attach(spec, "plate", coro, source="poses")
    model = spec.compile()
    runs = [settled(model, 0.03, [sensor]).qpos.copy() for _ in range(2)]
    assert (runs[0] == runs[1]).all()


def aside(model, height_mm, x_mm):
    """A state with the only object at a height of its middle and a place along x."""
    data = mujoco.MjData(model)
    data.qpos[:3] = [1e-3 * x_mm, 0.0, 1e-3 * height_mm]
    mujoco.mj_forward(model, data)
    return data


def test_two_states_of_a_scene_that_run_beside_each_other_have_contacts_of_their_own(coro):
    model = mujoco.MjModel.from_xml_string(scene(box(0.5), collides=NO_CONTACT))
    both, alone = (attach(model, "plate", coro, source="poses", friction=0.5) for _ in range(2))
    one, other, same = (aside(model, 9.9, x) for x in (0.0, 1.0, 1.0))
    pushed = []
    for _ in range(3):
        for data, sensor in ((one, both), (other, both), (same, alone)):
            pushed.append(hand_back(data, [sensor])["box"])
            mujoco.mj_step(model, data)
    assert np.abs(pushed[1][:2]).max() < 0.01 * pushed[1][2]     # not sheared by the 1 mm between both
    assert (np.array(pushed[1::3]) == pushed[2::3]).all() and (other.qpos == same.qpos).all()


@pytest.mark.parametrize(("aside_mm", "within_mm"), [(0.4, 1e-3), (0.8, 0.12)])
def test_the_pressure_under_an_object_that_slides_goes_with_it(coro, aside_mm, within_mm):
    """A box that was pressed and moved aside, flat and as deep as before, is held up under its middle.

    By 0.8 mm it is pressed anew, on points of the surface that are 0.65 mm apart.
    """
    model = mujoco.MjModel.from_xml_string(scene(box(), collides=NO_CONTACT))
    sensor, data = attach(model, "plate", coro, source="poses"), mujoco.MjData(model)
    for x_mm in (0.0, aside_mm):
        data.qpos[:3] = [1e-3 * x_mm, 0.0, 0.00995]
        hand_back(data, [sensor])
    force, moment = np.split(data.xfrc_applied[model.body("box").id], 2)
    assert force[2] > 1.0 and np.abs(moment).max() < 1e-3 * within_mm * force[2]


def test_a_gel_forgets_what_touched_in_an_episode_before(tmp_path):
    """Two episodes of the same length in one state, read at their ends, and one alone; then as many steps more, told to begin."""
    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    spec = mujoco.MjSpec.from_string(scene(box(0.2)))
    both, alone = (attach(spec, "plate", tmp_path / "gel.yaml", friction=0.8) for _ in range(2))
    model = spec.compile()
    data, seen = mujoco.MjData(model), []
    for x, steps in ((0.0, 20), (0.002, 20), (0.0, 30)):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = x
        mujoco.mj_step(model, data, nstep=steps)
        if steps == 30:
            both.begin(data)
        alone.begin(data)
        seen.append([sensor.read(data).readings["markers"] for sensor in (both, alone)])
    assert all((one == other).all() for one, other in seen) and np.abs(seen[1][0] - seen[0][0]).max() > 0


def test_a_gel_says_that_it_carries_more_than_the_sensor_s_largest_force(tmp_path):
    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    gel = softtact.load_sensor(tmp_path / "gel.yaml")
    most = gel.spec.force_range_n[1]
    for share, said in ((0.9, False), (1.2, True)):
        spec = mujoco.MjSpec.from_string(scene(box(share * most / G)))
        sensor = attach(spec, "plate", gel, friction=0.8)
        assert (f"the force is above {most:g} N" in sensor.read(settled(spec.compile(), 0.1)).validity_reason) == said


RING = """<asset><mesh name="ring" vertex="{vertices}" face="{faces}"/></asset><worldbody>
  <body name="ring" pos="0 0 .0001"><freejoint/><geom type="mesh" mesh="ring" mass=".5"/></body>"""


def test_a_gel_inside_a_ring_that_the_engine_takes_for_its_hull_is_at_rest_and_says_so(tmp_path):
    import trimesh

    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    gel = softtact.load_sensor(tmp_path / "gel.yaml")
    inner = 0.5 * max(gel.spec.footprint_mm) * 1.5
    ring = trimesh.creation.annulus(r_min=inner, r_max=inner + 3.0, height=6.0)
    vertices, faces = (" ".join(map(str, values.ravel())) for values in (1e-3 * (ring.vertices + [0, 0, 3.0]), ring.faces))
    spec = mujoco.MjSpec.from_string(scene("").replace("<worldbody>", RING.format(vertices=vertices, faces=faces)))
    sensor = attach(spec, "plate", gel, friction=0.8)
    reading = sensor.read(settled(spec.compile(), 0.05))
    assert "free, for The object misses the sensor" in reading.validity_reason and not reading.deformation_map_mm.any()


def test_a_gel_follows_the_object_of_each_state_alone(tmp_path):
    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    spec = mujoco.MjSpec.from_string(scene(box(0.2)))
    both, alone = (attach(spec, "plate", softtact.load_sensor(tmp_path / "gel.yaml"), friction=0.8) for _ in range(2))
    model = spec.compile()
    one, other = (aside(model, 9.99, x) for x in (0.0, 1.0))
    read = [sensor.read(data).readings["markers"] for data, sensor in ((one, both), (other, both), (other, alone))]
    assert np.abs(read[1] - read[0]).max() > 0 and (read[1] == read[2]).all()


def test_a_copy_of_a_sensor_begins_without_contacts(coro):
    model = mujoco.MjModel.from_xml_string(scene(box(0.5), collides=NO_CONTACT))
    sensor, data = attach(model, "plate", coro, source="poses"), aside(model, 9.9, 0.0)
    hand_back(data, [sensor])
    for made in (copy.copy(sensor), copy.deepcopy(sensor), pickle.loads(pickle.dumps(sensor))):
        assert sensor.held(data) and not made.held(data) and made.read(data).force_n[2] == sensor.read(data).force_n[2]


@pytest.mark.parametrize(("given", "sentence"), [
    ({"body": "finger"}, "The scene has no body 'finger'; use one of world, plate, box"),
    ({"pose": [0, 0, 0, 180, 0, 0]}, "The sensor's frame on the body 'plate' points into the body: its z axis must point out"),
    ({"pose": "tip"}, "pose='tip': the body 'plate' has no such site"),
    ({"source": "depth"}, "source='depth': use one of contacts, poses"),
    ({"press": "hyperelastic"}, "press='hyperelastic': a sensor in a scene is pressed with 'elastic', or 'foundation'"),
    ({"press": "foundation", "source": "poses"}, "press='foundation': a sensor in a scene"),
    ({"objects": ["world"]}, "The body 'world' has a geom of type 'plane', which a sensor cannot press; use a box"),
    ({"objects": ["bare"]}, "The body 'bare' has no geom that a sensor can press"),
    ({"objects": "box"}, r"objects='box': give a list of names, such as \['box'\]"),
    ({"objects": ["plate"]}, "objects: 'plate' carries the sensor"),
    ({"friction": -1.0}, "friction=-1.0: give a finite number of at least 0"),
    ({"sensor": "gelsight_mini", "source": "poses"}, "source='poses': gelsight_mini is a gel, which follows contact forces alone")])
def test_what_cannot_be_attached_is_refused_in_one_sentence(coro, given, sentence):
    text = scene(box() + '<body name="bare"/>' + '<geom type="plane" size="1 1 1" pos="0 0 -.1"/>')
    with pytest.raises(InputError, match=sentence):
        attach(mujoco.MjModel.from_xml_string(text), **{"body": "plate", "sensor": coro, "pose": [0, 0, -2.5, 0, 0, 0]} | given)


def test_what_is_no_scene_and_no_state_is_refused_in_one_sentence(coro):
    with pytest.raises(InputError, match="attach: the scene is a mujoco.MjSpec or MjModel, not str; read a file with"):
        attach("scene.xml", "plate", coro)
    model = mujoco.MjModel.from_xml_string(scene(box()))
    with pytest.raises(InputError, match="A sensor is read from a mujoco.MjData, not from MjModel"):
        attach(model, "plate", coro, pose=[0, 0, -2.5, 0, 0, 0]).read(model)


def test_a_force_that_the_engine_gives_already_is_not_given_again(coro):
    model = mujoco.MjModel.from_xml_string(scene(box(0.5, z=0.0076)))
    sensor = attach(model, "plate", coro, pose=Pose(np.array([0, 0, -2.5])), source="poses")
    data = settled(model)
    with pytest.raises(InputError, match="hand_back: the engine, too, pushes 'box' off 'plate'; set contype"):
        hand_back(data, [sensor])


def test_a_sensor_that_reads_forces_hands_none_back(coro):
    model = mujoco.MjModel.from_xml_string(scene(box()))
    with pytest.raises(InputError, match="reads the engine's own contact forces; attach it with source='poses'"):
        hand_back(mujoco.MjData(model), [attach(model, "plate", coro)])
