"""`softtact grasp` writes what a grasp gave, replays it to the byte, and refuses what it cannot use in one sentence."""

import json
import os
import subprocess
import sys
from contextlib import chdir

import pytest
import trimesh
import yaml

from softtact.cli import main
from softtact.robot.events import read_events
from softtact.robot.scene import to_mjcf
from softtact.robot.settings import load_scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grasps")
    trimesh.creation.box((12, 20, 10)).export(folder / "part.stl")
    return folder


@pytest.fixture(autouse=True)
def there(folder, monkeypatch):
    monkeypatch.chdir(folder)


GRASP = "grasp part.stl --unit mm --force 10 --model elastic --workers 1"


@pytest.fixture(scope="module")
def first(folder):
    with chdir(folder):
        assert main(f"{GRASP} --x 1 --no-picture --out first".split()) == 0
    return folder / "first/events.nc"


def test_the_file_holds_events_of_both_fingers_and_where_they_came_from(first):
    data = read_events(first)
    assert data.event.values.tolist() == ["contact", "grip", "lift"] and data.finger.values.tolist() == ["left", "right"]
    assert data.deformation_map_mm.shape == (3, 2, 57, 33) and data.tactile_map.shape == (3, 2, 7, 4)
    assert data.attrs["mesh"] == "part.stl" and data.attrs["x_mm"] == 1.0 and json.loads(data.attrs["scene"])["friction"] == 0.8


def test_a_replay_gives_the_same_bytes(first, folder):
    assert main(f"grasp --replay {first} --no-picture --workers 1 --out again".split()) == 0
    assert (folder / "again/events.nc").read_bytes() == first.read_bytes()


def test_json_tells_events_and_whether_the_object_is_held(folder, capsys):
    assert main(f"{GRASP} --no-lift --json --picture --out drawn".split()) == 0
    told = json.loads(capsys.readouterr().out)
    assert [event["event"] for event in told["events"]] == ["contact", "grip"] and told["held"]
    assert (folder / "drawn/grasp.png").stat().st_size > 10_000     # with the robot where MuJoCo draws, without it elsewhere


def test_a_robot_of_ones_own_takes_the_place_of_the_built_one(folder, coro):
    (folder / "mine.xml").write_text(to_mjcf(coro, load_scene()))
    (folder / "scene.yaml").write_text(yaml.safe_dump({"mjcf": "mine.xml"}))
    assert main(f"{GRASP} --x 1 --scene scene.yaml --no-picture --out own".split()) == 0
    own, built = read_events(folder / "own/events.nc"), read_events(folder / "first/events.nc")
    assert abs(own.force_n - built.force_n).max() < 0.05 and (own.event_row == built.event_row).all()


@pytest.mark.slow
def test_where_mujoco_does_not_draw_a_sentence_says_so_and_the_maps_are_drawn(folder):
    line = [sys.executable, "-m", "softtact", *f"{GRASP} --no-lift --video --out blind".split()]
    done = subprocess.run(line, capture_output=True, text=True, env=os.environ | {"MUJOCO_GL": "wrong"}, check=False)
    assert done.returncode == 0 and "no picture of the robot: MuJoCo does not draw off screen here" in done.stderr
    assert sorted(path.name for path in (folder / "blind").iterdir()) == ["events.nc", "grasp.png"]


@pytest.mark.parametrize(("line", "said"), [
    ("grasp part.stl --force 10 --out o", "part.stl: no unit is stated, and the file holds none; state one of mm"),
    ("grasp part.stl --unit mm --force 80 --out o", "--force 80: 80 N is out of the range of sensor coro"),
    ("grasp part.stl --unit mm --force 10 --sensor gelsight_mini --out o", "has no taxels, which a record of grasps needs"),
    ("grasp none.stl --unit mm --force 10 --out o", "none.stl: there is no such mesh file"),
    ("grasp part.stl --unit mm --force 10 --mass 0 --out o", "--mass 0: a mass is above 0"),
    ("grasp --replay part.stl --out o", "part.stl: not a readable NetCDF file"),
    ("grasp --replay first/events.nc --x 2 --out o", "--x 2.0: it has no effect on --replay"),
    ("grasp other.stl --replay first/events.nc --out o", "other.stl: it is not the mesh that first/events.nc was made with"),
    ("grasp part.stl --unit mm --force 10 --scene bad.yaml --out o", "bad.yaml, at 'frction': the key is unknown; use one of"),
    ("grasp part.stl --unit mm --force 10 --scene low.yaml --out o", "low.yaml, at 'friction': -1 is not usable"),
    ("grasp part.stl --unit mm --force 10 --scene far.yaml --out o", "grip_at_m: the hand does not reach"),
    ("grasp part.stl --unit mm --force 10 --scene poor.yaml --out o", "poor.xml: it has no joint named 'arm_1'"),
    ("grasp part.stl --unit mm --force 10 --x 60 --out o", "The fingers closed without touching the object"),
])
def test_what_cannot_be_used_is_refused_in_one_sentence_and_leaves_nothing(first, folder, line, said, capsys):
    trimesh.creation.box((13, 20, 10)).export(folder / "other.stl")
    texts = {"bad.yaml": "frction: 1", "low.yaml": "friction: -1", "far.yaml": "grip_at_m: [2.0, 0, 0]",
             "poor.yaml": "mjcf: poor.xml",
             "poor.xml": "<mujoco><worldbody><site name='grip'/></worldbody></mujoco>"}
    for name, text in texts.items():
        (folder / name).write_text(text)
    assert main(line.split()) != 0
    told = [row for row in capsys.readouterr().err.splitlines() if row.startswith("softtact grasp:")]
    assert len(told) == 1 and said in told[0]
    assert not (folder / "o").exists()
