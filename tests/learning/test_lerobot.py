"""Data sets in LeRobot's format: files as its format v3.0 states them, and what its own package loads."""

import json

import numpy as np
import pandas
import pytest
import trimesh

import softtact
from softtact.errors import InputError
from softtact.learning import press_data
from softtact.learning.press_data import PressPlan, write_press_data

parquet = pytest.importorskip("pyarrow.parquet")
av = pytest.importorskip("av")
VIDEO = "observation.images.deformation.left"


@pytest.fixture(scope="module")
def ours():
    meshes = {"box": trimesh.creation.box((8, 12, 5)), "disc": trimesh.creation.cylinder(radius=4, height=6)}
    return PressPlan(softtact.load_sensor("coro"), meshes, 4, [5.0, 20.0], "elastic", 3, fingers=2)


@pytest.fixture(scope="module")
def made(ours, tmp_path_factory):
    """A data set of four presses of which the second failed, in blocks of two; and {press: result of its left finger}."""
    folder, pressed, kept = tmp_path_factory.mktemp("data") / "presses", press_data._pressed, {}

    def one_fails(plan, numbers, workers):
        results = pressed(plan, numbers, workers)
        kept.update(zip(numbers.tolist(), results, strict=True))
        return [[InputError("no")] if number == 1 else of_press for number, of_press in zip(numbers, results, strict=True)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(press_data, "_pressed", one_fails)
        patch.setattr("softtact.learning.press_blocks.BLOCK", 2)
        assert write_press_data(folder, ours, form="lerobot", workers=1, label="") == 1
    return folder, kept


def rows(folder):
    return parquet.read_table(folder / "data/chunk-000/file-000.parquet")


def test_the_files_and_the_counts_are_those_that_info_states(made):
    folder, _ = made
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["fps"] == 10 and info["splits"] == {"train": "0:3"}
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 6, 2) and len(rows(folder)) == 6
    files = [info["data_path"].format(chunk_index=0, file_index=0), *(
        info["video_path"].format(video_key=key, chunk_index=0, file_index=0)
        for key, feature in info["features"].items() if feature["dtype"] == "video")]
    assert len(files) == 3 and all((folder / file).is_file() for file in files)
    assert set(rows(folder).column_names) == {key for key, feature in info["features"].items() if feature["dtype"] != "video"}
    assert {"timestamp", "frame_index", "episode_index", "index", "task_index"} <= set(info["features"])
    assert info["features"]["observation.tactile.right"] == {"dtype": "float32", "shape": [7, 4], "names": ["row", "column"]}


def test_a_row_is_a_force_of_a_press_that_did_not_fail(made, ours):
    folder, results = made
    table = rows(folder).to_pydict()
    assert table["episode_index"] == [0, 0, 1, 1, 2, 2] and table["index"] == list(range(6)) and table["frame_index"] == [0, 1] * 3
    assert table["timestamp"] == pytest.approx([0, 0.1] * 3) and table["observation.force"] == [5, 20] * 3
    assert table["task_index"] == [0, 0, 0, 0, 1, 1]      # objects of the presses 0, 2 and 3
    assert np.allclose(table["observation.state"][::2], ours.poses[[0, 2, 3]])
    for finger, name in enumerate(("left", "right")):
        counts = np.concatenate([np.round(results[press][finger].tactile_map) for press in (0, 2, 3)])
        assert np.array_equal(np.array(table[f"observation.tactile.{name}"]), counts)


def test_tasks_and_episodes_say_where_each_episode_lies(made):
    folder, _ = made
    tasks = pandas.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.index.tolist() == ["press box", "press disc"] and tasks.task_index.tolist() == [0, 1]
    episodes = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["episode_index"] == [0, 1, 2] and episodes["length"] == [2, 2, 2]
    assert episodes["tasks"] == [["press box"], ["press box"], ["press disc"]]
    assert episodes["dataset_from_index"] == [0, 2, 4] and episodes["dataset_to_index"] == [2, 4, 6]
    assert episodes[f"videos/{VIDEO}/from_timestamp"] == pytest.approx([0, 0.2, 0.4])
    assert episodes["data/file_index"] == episodes[f"videos/{VIDEO}/chunk_index"] == [0, 0, 0]


def test_a_picture_of_the_video_shows_the_deformation_map_at_its_time(made):
    from matplotlib import colormaps

    folder, results = made
    with av.open(str(folder / f"videos/{VIDEO}/chunk-000/file-000.mp4")) as container:
        frames = list(container.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx([0.1 * k for k in range(6)])
    largest = json.loads((folder / "meta/softtact.json").read_text())["deformation_largest_mm"]
    shown = frames[3].to_ndarray(format="rgb24").astype(float)      # press 2 at 20 N
    expected = 255 * colormaps["viridis"](results[2][0].deformation_map_mm[1] / largest)[..., :3]
    assert shown.shape == (4 * 57, 4 * 33, 3)
    assert np.abs(shown.reshape(57, 4, 33, 4, 3).mean(axis=(1, 3)) - expected).mean() < 6      # of 255: colours are subsampled


def test_statistics_are_those_of_all_frames(made):
    folder, _ = made
    table, stats = rows(folder).to_pydict(), json.loads((folder / "meta/stats.json").read_text())
    for key in ("observation.tactile.left", "observation.state", "observation.force"):
        values = np.array(table[key]).reshape(6, *np.shape(stats[key]["mean"]))
        for name, number in (("min", values.min(0)), ("max", values.max(0)), ("mean", values.mean(0)), ("std", values.std(0))):
            assert np.allclose(stats[key][name], number, atol=1e-4), (key, name)
        assert stats[key]["count"] == [6]
    assert np.shape(stats[VIDEO]["mean"]) == (3, 1, 1) and 0 < np.min(stats[VIDEO]["std"]) and np.max(stats[VIDEO]["max"]) <= 1


def test_a_data_set_without_an_episode_is_refused(ours, tmp_path, monkeypatch):
    monkeypatch.setattr(press_data, "_pressed", lambda plan, numbers, workers: [[InputError("no")] for _ in numbers])
    with pytest.raises(InputError, match="all presses failed"):
        write_press_data(tmp_path / "none", ours, form="lerobot", workers=1, label="")
    assert not (tmp_path / "none").exists()


def test_a_name_with_an_ending_is_refused(ours, tmp_path):
    with pytest.raises(InputError, match="written as a folder; give a name without an ending"):
        write_press_data(tmp_path / "d.h5", ours, form="lerobot")


def test_the_package_of_lerobot_loads_it(made):
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    folder, results = made
    loaded = lerobot.LeRobotDataset("local/presses", root=folder, video_backend="pyav")
    frame = loaded[3]
    assert len(loaded) == 6 and loaded.num_episodes == 3
    assert frame["task"] == "press box" and frame["timestamp"] == pytest.approx(0.1)
    assert np.array_equal(frame["observation.tactile.right"], np.round(results[2][1].tactile_map[1]))
    assert frame[VIDEO].shape == (3, 228, 132) and frame["observation.state"].shape == (6,)
    assert loaded.meta.stats["observation.force"]["mean"] == pytest.approx(12.5)
