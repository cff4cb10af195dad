"""A sensor of kind solid: pressed from any side it gives the closed form, its readings add up, and faults of its file are told."""

import json

import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.cli import main
from softtact.contact.motion import Motion
from softtact.errors import InputError, TimeLimitError
from softtact.fem.files.solids import write_mesh
from softtact.fem.structured_meshes import box
from softtact.materials.cards import write_card
from softtact.materials.laws.registry import make_law
from softtact.press.kinds import solid_at_rest
from softtact.press.objects import distance_to_touch, first_direction
from softtact.press.result import read_press

RUBBER = make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=20)
BLOCK = {"name": "block", "kind": "solid", "mesh": {"file": "block.vtu"},
         "regions": {"rubber": {"law": "neo_hooke", "parameters": {"c10": 0.1}}},
         "held": {"z0": "z", "x0": "x", "y0": "y"}, "contact": {"face": "z1"},
         "readings": {"points_mm": [[1, 1, 1], [0.5, 0.5, 1]], "radius_mm": 0.4}, "force_range_n": [0, 2]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A block of 2 x 2 x 1 mm whose three sides at 0 slide on walls: a press on any other side strains it evenly."""
    folder = tmp_path_factory.mktemp("solid")
    write_mesh(box((0, 0, 0), (2, 2, 1), (2, 2, 1), region="rubber"), folder / "block.vtu")
    (folder / "block.yaml").write_text(yaml.safe_dump(BLOCK))
    trimesh.creation.box((4, 4, 1)).export(folder / "plate.stl")
    return folder


def sensor_of(folder, name="own", **changes):
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(BLOCK | changes))
    return softtact.load_solid_sensor(folder / f"{name}.yaml")


def test_a_plate_finds_the_stress_of_the_uniaxial_test_and_readings_that_fill_the_face_add_up_to_its_force(folder):
    # stretch 0.9; a point whose circle holds the whole face reads the force over its area of 4 mm2
    sensor = sensor_of(folder, readings={"points_mm": [[1, 1, 1]], "radius_mm": 2.0})
    result = sensor.press(folder / "plate.stl", unit="mm", motion=Motion().press(depth_mm=0.1), label="")
    nominal = float(RUBBER.uniaxial_compressible(0.9))
    assert result.load("object")[0, 2] == pytest.approx(4 * nominal, rel=1e-2)      # an overlap of up to 1 um in 100
    assert 4 * result.reading_pressure_mpa[0, 0] == pytest.approx(-result.load("object")[0, 2], rel=1e-9)
    assert result.reading_displacement_mm[0, 0, 2] == pytest.approx(-0.1, abs=2e-3)
    assert solid_at_rest(sensor).displacement(None)[0].area_mm2.sum() == pytest.approx(4.0)


@pytest.mark.parametrize(("face", "way", "held"), [
    ("x1", {"x": -0.1}, "x0"), ("x0", {"x": 0.1}, "x1"), ("z0", {"z": 0.05}, "z1")], ids=["from +x", "from -x", "from below"])
def test_a_press_from_the_side_or_from_below_is_the_press_from_above_of_a_turned_block(folder, face, way, held):
    axis = held[0]
    walls = {f"{other}0": other for other in "xyz" if other != axis} | {held: axis}
    sensor = sensor_of(folder, "turned", contact={"face": face}, held=walls, readings=None)
    # The plate of 4 x 4 x 1 mm stands some way off, upright for a side.
    pose = [1, 1, -5, 0, 0, 0] if axis == "z" else [5 if face == "x1" else -5, 1, 0.5, 0, 90, 0]
    result = sensor.press(folder / "plate.stl", unit="mm", pose=pose, motion=Motion().step(ways=way), label="")
    nominal, area = float(RUBBER.uniaxial_compressible(0.95)), 4 if axis == "z" else 2
    expected = np.sign(way[axis]) * -nominal * area      # nominal is negative: the plate pushes along its way
    assert result.load("object")[0, "xyz".index(axis)] == pytest.approx(expected, rel=3e-2)     # 1 um in 50 or 100


def test_where_an_object_stands_along_its_way_does_not_count(folder):
    sensor = sensor_of(folder)
    loads = [sensor.press(folder / "plate.stl", unit="mm", pose=[1, 1, height, 0, 0, 0], force_n=0.1, label="").frame_way_mm[0, 0]
             for height in (-3.0, 1.5, 70.0)]
    np.testing.assert_allclose(loads, np.tile(loads[0], (3, 1)), atol=1e-9)


def test_a_ball_touches_a_plane_and_an_edge_where_geometry_says():
    plane = trimesh.creation.box((10, 10, 1)).triangles
    ball = trimesh.creation.icosphere(4, 2.0).triangles
    down = np.array([0, 0, -1.0])
    assert distance_to_touch(ball + [0, 0, 9], plane, down) == pytest.approx(9 - 2 - 0.5, abs=5e-3)     # facets lie in the ball
    assert distance_to_touch(ball, plane, down) == pytest.approx(-2.5, abs=5e-3)
    assert distance_to_touch(ball + [0, 0, -9], plane, -down) == pytest.approx(6.5, abs=5e-3)
    assert distance_to_touch(ball + [9, 0, 0], plane, np.array([-1.0, 0, 0])) == pytest.approx(9 - 5 - np.sqrt(4 - 0.25), abs=0.1)
    assert distance_to_touch(ball + [9, 0, 9], plane, down) == np.inf


@pytest.mark.parametrize(("steps", "direction"), [
    ("fz -2; x 1", (0, 0, -1)), ("z -3 x 4", (0.8, 0, -0.6)), ("fz -2 x 5", (0, 0, -1)), ("rz 5", (0, 0, -1)),
    ("fx 3 fz -4", (0.6, 0, -0.8))])
def test_an_object_comes_along_its_first_force_or_else_its_first_way(steps, direction):
    assert first_direction(Motion.parse(steps)) == pytest.approx(direction)


def test_a_plate_that_slides_pulls_with_the_friction_of_the_file(folder):
    sensor = sensor_of(folder, "rough", contact={"face": "z1", "friction": 0.3}, held={"z0": "xyz"})
    motion = Motion().press(depth_mm=0.05).slide(x_mm=0.3, steps=3)
    force = sensor.press(folder / "plate.stl", unit="mm", motion=motion, label="").load("object")[-1]
    assert force[0] == pytest.approx(-0.3 * force[2], rel=0.01) and abs(force[1]) < 0.01 * force[0]


@pytest.mark.parametrize("direction", [(0, 0, -1), (1, 0, 0)])
def test_a_holder_takes_the_rear_of_a_soft_object_as_seen_along_its_way(direction):
    soft = softtact.SoftObject(box((0, 0, 0), (2, 2, 2), (5, 5, 5)), RUBBER, held_share=0.2)
    placed = soft.with_faces(soft.mesh.points, np.array(direction, dtype=float))
    along = placed.points @ direction
    assert along[placed.face_nodes("held")].max() == pytest.approx(along.min() + 0.4)      # a fifth of 2 mm
    assert along[placed.face_nodes("pressed")].min() == pytest.approx(along.min() + 0.4)


def test_a_law_without_a_bulk_modulus_has_the_one_of_all_laws(folder):
    law = sensor_of(folder).laws["rubber"]
    assert law.bulk_modulus == make_law("neo_hooke", {"c10": 0.1}).bulk_modulus
    stiffer = {"rubber": {"law": "neo_hooke", "parameters": {"c10": 0.1}, "bulk_over_shear": 40}}
    assert sensor_of(folder, regions=stiffer).laws["rubber"].bulk_modulus == pytest.approx(2 * law.bulk_modulus)


def test_two_equal_soft_blocks_share_the_way(folder):
    # Each block is 1 mm high; the object's upper share of 0.3 is held, so that 0.7 mm of it and 1 mm of the sensor bear one stress.
    block = box((0, 0, 0), (2, 2, 1), (2, 2, 2), region="rubber")
    soft = softtact.SoftObject(block, RUBBER, held_share=0.3)
    result = sensor_of(folder).press(soft, pose=[0, 0, 4, 0, 0, 0], motion=Motion().step(ways={"z": -0.1}), label="")
    mean = result.reading_displacement_mm[0, 0, 2]
    assert -0.075 < mean < -0.045                    # 0.059 were the held half free to spread
    assert result.load("object")[0, 2] < 0 and result.pairs == ("contact",)


def test_a_press_whose_time_is_over_gives_the_steps_before(folder, monkeypatch):
    from softtact import progress

    sensor, clock = sensor_of(folder), [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    with pytest.raises(TimeLimitError, match="time limit of 5 s was reached: step 2 of 2") as stopped:
        sensor.press(folder / "plate.stl", unit="mm", force_n=[0.1, 0.2], label="", time_limit_s=5,
                     on_step=lambda result: clock.__setitem__(0, 6.0))
    assert stopped.value.result.steps == 1


def test_the_command_writes_shows_and_exports_it(folder, tmp_path, capsys):
    asked = [str(folder / "plate.stl"), "--unit", "mm", "--sensor", str(folder / "block.yaml"), "--force", "0.2"]
    assert main(["press", *asked, "--out", str(tmp_path / "press.nc"), "--vtu", str(tmp_path / "press.vtu"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["load"][0][2] == pytest.approx(-0.2, rel=1e-4)
    assert told["reading_pressure_mpa"][0][0] == pytest.approx(0.05, rel=1e-3)      # 0.2 N over 4 mm2
    kept = read_press(tmp_path / "press.nc")
    assert kept.attributes["mesh"] == "plate.stl" and len(kept.attributes["mesh_sha256"]) == 64
    assert kept.reading_pressure_mpa.shape == (1, 2)
    assert main(["press", *asked]) == 0
    assert "readings at the last step" in capsys.readouterr().out
    assert main(["view", str(tmp_path / "press.nc"), "--page", str(tmp_path / "press.html")]) == 0
    deck = tmp_path / "press.inp"
    assert main(["export-deck", *asked, "--format", "abaqus", "--control", "indentation", "--out", str(deck)]) == 0
    assert "C3D20RH" in deck.read_text() and "OBJECT_REFERENCE" in deck.read_text()


def test_several_objects_are_pressed_one_by_one_and_stand_in_one_table(folder, tmp_path, capsys):
    objects = tmp_path / "objects"
    objects.mkdir()
    for name in ("low", "high"):
        trimesh.creation.box((4, 4, 1)).export(objects / f"{name}.stl")
    assert main(["press", str(objects), "--unit", "mm", "--sensor", str(folder / "block.yaml"), "--force", "0.2", "--json",
                 "--out", str(tmp_path), "--vtu", "press.vtu"]) == 0
    rows = json.loads(capsys.readouterr().out)["objects"]
    assert [(row["object"], row["status"], row["model"]) for row in rows] == [("high", "done", "solid"), ("low", "done", "solid")]
    assert rows[0]["force_z_n"] == pytest.approx(-0.2, rel=1e-4)
    assert (tmp_path / "low/press.vtu").stat().st_size and read_press(tmp_path / "high/press.nc").steps == 1


def test_a_card_on_the_command_line_takes_the_place_of_a_regions_law(folder, capsys):
    from softtact.materials.config import law_from_printed
    from softtact.sensors.library import material_file

    (folder / "named.yaml").write_text(yaml.safe_dump(BLOCK | {"regions": {"rubber": {"material": "neoprene"}}}))
    sensor = softtact.load_solid_sensor(folder / "named.yaml")
    assert sensor.laws["rubber"].parameters == law_from_printed(material_file("neoprene"), "mooney_rivlin").parameters
    other = softtact.load_solid_sensor(folder / "named.yaml", laws={"rubber": RUBBER})
    assert other.laws["rubber"] is RUBBER
    assert main(["press", str(folder / "plate.stl"), "--unit", "mm", "--sensor", str(folder / "named.yaml"), "--force", "0.1",
                 "--card", "foam=card.json"]) == 1
    assert "card.json" in capsys.readouterr().err


def test_a_region_with_another_law_of_a_card_than_the_one_that_softens_is_refused(folder):
    laws = {name: {"parameters": {"c10": 0.1} | more, "bulk_modulus_mpa": 4.0} for name, more in
            (("neo_hooke", {}), ("mooney_rivlin", {"c01": 0.02}))}
    effect = {"r": 2.0, "m_mpa": 0.05, "beta": 0.1, "law": "neo_hooke"}
    card = {"material": "gel", "kind": "measured", "chosen": "neo_hooke", "laws": laws, "mullins": effect}
    write_card(folder / "soft.json", card)
    assert sensor_of(folder, "carded", regions={"rubber": {"card": "soft.json"}}).laws["rubber"].inelastic.mullins.r == 2.0
    with pytest.raises(InputError, match="carded.yaml.* effect of its law 'neo_hooke', which is not that of 'mooney_rivlin'"):
        sensor_of(folder, "carded", regions={"rubber": {"card": "soft.json", "law": "mooney_rivlin"}})


@pytest.mark.parametrize(("changes", "message"), [
    ({"mesh": {"file": "dome.stl"}}, "'mesh.file': dome.stl is a surface, .* run `softtact mesh dome.stl .* --out dome.vtu`"),
    ({"mesh": {"file": "none.vtu"}}, "none.vtu: there is no such mesh file"),
    ({"regions": {"gel": {"material": "neoprene"}}}, "no region 'gel' in block.vtu; its regions are rubber"),
    ({"regions": {"rubber": {}}}, "'regions.rubber': it has no law"),
    ({"regions": {"rubber": {"law": "neo_hooke"}}}, "'regions.rubber': the law 'neo_hooke' has no parameters"),
    ({"regions": {"rubber": {"material": "neoprene", "card": "a.json"}}}, "a material and a card"),
    ({"regions": {"rubber": {"material": "neoprene", "bulk_over_shear": 5}}}, "'bulk_over_shear' belong to 'law'"),
    ({"held": {"bottom": "xyz"}}, "no face 'bottom'; its faces are"),
    ({"held": {}}, "field 'held' is not usable"),
    ({"contact": {"face": "skin"}}, "no face 'skin'"),
    ({"faces": {"skin": "z>9"}}, "face 'skin' would be empty"),
    ({"readings": {"points_mm": [[9, 9, 9]], "radius_mm": 1}}, "nothing within 1 mm of the point 9, 9, 9 mm"),
    ({"force_range_n": [3, 2]}, "'force_range_n'"),
    ({"friction": 0.2}, "no key 'friction'"),
])
def test_what_is_wrong_in_a_file_is_told_with_file_and_field(folder, changes, message):
    with pytest.raises(InputError, match=message) as refused:
        sensor_of(folder, "wrong", **changes)
    assert ".yaml" in str(refused.value) or ".vtu" in str(refused.value)


def test_what_cannot_be_pressed_is_refused_before_the_solver_starts(folder):
    sensor = sensor_of(folder)
    with pytest.raises(InputError, match="misses the face 'z1' of block"):
        sensor.press(folder / "plate.stl", unit="mm", pose=[9, 0, 3, 0, 0, 0], force_n=1.0)
    with pytest.raises(InputError, match="out of the range of block"):
        sensor.press(folder / "plate.stl", unit="mm", force_n=9.0)
    with pytest.raises(InputError, match="either force_n or motion"):
        sensor.press(folder / "plate.stl", unit="mm")


@pytest.mark.parametrize(("options", "message"), [
    (["--model", "elastic"], "--model elastic: a sensor of kind solid, such as"), (["--full-scale"], "without taxels"),
    (["--tolerance", "0.02"], "--tolerance 0.02: it has no effect"), (["--mesh-quality", "fine"], "--mesh-quality fine: it")])
def test_options_of_the_layered_models_are_refused(folder, options, message, capsys):
    assert main(["press", str(folder / "plate.stl"), "--unit", "mm", "--sensor", str(folder / "block.yaml"), "--force", "1",
                 *options]) == 1
    assert message in capsys.readouterr().err


def test_commands_that_need_layers_say_so(folder, capsys):
    assert main(["dataset", str(folder / "plate.stl"), "--unit", "mm", "--presses", "2", "--sensor", str(folder / "block.yaml"),
                 "--out", str(folder / "data.h5"), "--format", "hdf5"]) == 1
    assert "a solid has no layers and no taxels" in capsys.readouterr().err
