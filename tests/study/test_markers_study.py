"""The study of marker images: its presses and split, stand-in objects, tables, claims, and all stages on a made-up gel."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from made_up_gel import CAMERA_PX, MARKERS, MM_PER_PX, RADIUS_PX, made_up_frames, rest_px
from scipy.spatial import cKDTree
from support.pages import numbers_without_a_file

from softtact.errors import InputError
from softtact.evaluation.decisions import CONTRADICTION, NOT, REPRODUCED, UNDECIDED
from softtact.files import read_dataset
from softtact.geometry.meshes import place
from softtact.learning.image_settings import NETWORKS
from softtact.studies.markers import paths
from softtact.studies.markers.claims import claims_of_markers
from softtact.studies.markers.config import load_study, read_values
from softtact.studies.markers.drag import DragSequence, drag_fragment
from softtact.studies.markers.jobs import jobs
from softtact.studies.markers.judging import sliding_verdicts, wrong_objects
from softtact.studies.markers.pressing import _labels, reduced, sequence_file
from softtact.studies.markers.scoring import (
    COLUMNS,
    Camera,
    Made,
    Truth,
    marker_places,
    scored_frames,
    scores,
    table_one,
    table_two,
)
from softtact.studies.markers.shapes import OBJECTS, generated_object
from softtact.studies.markers.stages.comparing import read_markers
from softtact.studies.markers.stages.data import pairs_of

PRINTED = paths.Path((-4, 0, 4), tuple(range(-90, 91, 30)), 0.1, 1.5, 1.0)
SMALL = paths.Path((0.0,), (0.0, 30.0), 0.25, 0.5, 0.5)
WHOLE = paths.Share(48, 15, 63, (1.5,), tuple(np.arange(1, 16) / 10), 15)


def test_the_printed_path_has_the_printed_numbers_of_pairs():
    assert len(PRINTED.poses) == 63
    assert PRINTED.frames == 26
    assert PRINTED.pairs() == paths.PAIRS_OF_OBJECT == 19_845
    assert 16 * PRINTED.pairs() == paths.PAIRS_PRINTED


def test_the_printed_split_holds_fifteen_poses_of_each_trained_object_out():
    plans = paths.plans(PRINTED, WHOLE, train=["cross"], test=["cone"], seed=3)
    poses = {split: {(p.x_mm, p.y_mm, p.angle_deg) for p in plans if p.split == split} for split in paths.SPLITS}
    assert {split: len(found) for split, found in poses.items()} == {"train": 48, "held_out": 15, "unseen": 63}
    assert not poses["train"] & poses["held_out"]
    assert {p.object for p in plans if p.split == "unseen"} == {"cone"}


def test_the_whole_plan_has_exactly_the_pairs_that_the_paper_counts():
    """574,560 frames of 30,240 sequences, which share their ways down."""
    every = tuple(np.arange(1, 16) / 10)
    share = paths.Share(48, 15, 63, every, every, 15)
    found = paths.plans(PRINTED, share, train=OBJECTS[:8], test=OBJECTS[8:], seed=3)
    frames = [_labels(plan, number, PRINTED) for number, plan in enumerate(found)]
    labels = pd.DataFrame({name: np.concatenate([one[name] for one in frames]) for name in frames[0]})
    assert len(labels) == 574_560 and len(pairs_of(labels)) == paths.PAIRS_PRINTED


def test_a_share_is_a_part_of_the_whole_split():
    few = paths.plans(PRINTED, paths.Share(3, 2, 4, (1.5,), (1.5,), 15), train=["cross"], test=["cone"], seed=3)
    assert set(few) <= set(paths.plans(PRINTED, WHOLE, train=["cross"], test=["cone"], seed=3))


def test_the_object_moves_against_the_sensor():
    plan = paths.SequencePlan("cone", "unseen", 0, 0, 0, 1.5, "y")
    motion = plan.motion(PRINTED)
    assert len(motion.steps) == 25
    assert motion.depth_mm == pytest.approx(1.5)
    assert motion.aside_mm[-1] == pytest.approx([0, -1.0])
    moved = plan.moved_mm(PRINTED)
    assert moved[[0, 15, 25]] == pytest.approx(np.array([[0, 0], [1.5, 0], [1.5, 1.0]]))


def test_a_pose_puts_the_objects_top_on_the_sensor_at_the_sensors_place():
    """A sensor 4 mm along the mesh's x, turned by 90 degrees, sees the object's middle at 4 mm along its own y, by hand."""
    mesh = generated_object("cylinder")
    placed = place(mesh, pose=paths.pose_on_sensor(4.0, 0.0, 90.0))
    assert placed.bounds[0, 2] == pytest.approx(0, abs=1e-6)
    top = placed.vertices[placed.vertices[:, 2] < 1e-6]
    assert top.mean(axis=0)[:2] == pytest.approx([0.0, 4.0], abs=1e-6)


@pytest.mark.parametrize("name", OBJECTS)
def test_a_generated_object_is_closed_and_has_the_printed_size(name):
    mesh = generated_object(name)
    assert mesh.is_watertight and mesh.volume > 0
    assert mesh.bounds == pytest.approx(np.array([[-7.5, 0, -7.5], [7.5, 10, 7.5]]), abs=1e-3)


def test_a_generated_object_has_the_volume_of_its_shape():
    plate = 15 * 15 * 5
    assert generated_object("circleshell").volume == pytest.approx(plate + np.pi * (25 - 16) * 5, rel=1e-3)
    assert generated_object("hemisphere").volume == pytest.approx(plate + 2 / 3 * np.pi * 125, rel=1e-3)


def test_images_are_reduced_to_means_over_blocks():
    image = np.arange(16.0).reshape(1, 4, 4)
    assert reduced(image, 2).tolist() == [[[2.5, 4.5], [10.5, 12.5]]]
    with pytest.raises(InputError, match="4 x 4 px is not divided into 3 x 3 blocks"):
        reduced(image, 3)


@pytest.fixture(scope="module")
def pressed():
    """A file of two sequences of the made-up gel."""
    plans = [paths.SequencePlan("cone", "unseen", 0.0, 0.0, 0.0, 0.5, aside) for aside in ("x", "y")]
    return sequence_file(plans, [7, 8], lambda plan: made_up_frames(None, None, plan, SMALL), path=SMALL, pixels=64,
                         max_mm=3.0, surface_maps=True)


def test_a_file_of_sequences_labels_every_frame(pressed):
    assert pressed.sequence.values.tolist() == [7] * 5 + [8] * 5
    assert pressed.depth_mm.values[:5] == pytest.approx([0, 0.25, 0.5, 0.5, 0.5])
    assert pressed.aside_mm.values[:5] == pytest.approx([0, 0, 0, 0.25, 0.5])
    assert pressed.image.shape == (10, 64, 64, 3) and pressed.image.dtype == np.uint8
    assert pressed.marker_px.attrs["units"] == "px" and pressed.force_n.attrs["units"] == "N"
    assert set(pressed.displacement_mm.dims) == {"frame", "y", "x", "direction"}


def test_markers_of_reduced_images_are_found_within_a_tenth_of_a_pixel(pressed):
    """The truth is what was drawn; markers are 2 pixels of the reduced image wide, places in px of the camera's."""
    camera = Camera(CAMERA_PX, RADIUS_PX, rest_px())
    found = marker_places(pressed.image.values[:5], camera)
    error = np.linalg.norm(found - pressed.marker_px.values[:5], axis=-1)
    assert np.isfinite(found).all()
    assert np.median(error) < 0.1 and error.max() < 0.5


def test_an_image_without_markers_is_degenerate_and_does_not_end_the_tracking(pressed):
    images = pressed.image.values[:5].copy()
    images[2] = 120
    found = marker_places(images, Camera(CAMERA_PX, RADIUS_PX, rest_px()))
    assert np.isnan(found[2]).all()
    assert np.isfinite(found[3]).all()


def test_every_fifth_frame_is_scored_from_the_last_one_back():
    assert scored_frames(26, 5).tolist() == [5, 10, 15, 20, 25]
    assert scored_frames(3, 5).tolist() == [2]


def test_scores_of_the_truth_itself_are_perfect_and_of_no_motion_its_motion(pressed):
    rows, camera = np.arange(2, 5), Camera(CAMERA_PX, RADIUS_PX, rest_px())
    labels = pd.DataFrame({name: pressed[name].values[rows] for name in
                           ("object", "split", "sequence", "end_depth_mm", "depth_mm", "aside_mm", "aside")})
    truth = Truth(pressed.marker_px.values[rows], pressed.marker_px.values[0], pressed.image.values[rows], labels)
    own = scores(Made(truth.places_px, truth.rest_px, truth.images), truth, camera, source="physics", seed=0)
    assert list(own.columns) == COLUMNS
    assert own.d_px.max() == own.mse.max() == 0
    still = scores(Made(np.repeat(truth.rest_px[None], 3, axis=0), truth.rest_px, None), truth, camera, source="no_motion", seed=0)
    assert still.d_px.iloc[-1] == pytest.approx(np.linalg.norm(truth.places_px[-1] - truth.rest_px, axis=-1).sum())
    assert still.d_px.to_numpy() == pytest.approx(still.e_px.to_numpy())


def made_up_scores(means, *, objects=OBJECTS, seeds=2):
    """Rows of scores whose d, mse and share of degenerate images are those of {source: mean}, with a spread over objects."""
    rng, rows = np.random.default_rng(0), []
    hard = rng.normal(0, 0.05, len(objects))
    for source, mean in means.items():
        for seed in range(seeds):
            for number, name in enumerate(objects):
                for depth, aside in ((0.5, 0.0), (1.5, 0.0), (1.5, 1.0)):
                    value = mean * (1 + hard[number] + 0.01 * rng.normal()) * (0.5 + depth + aside)
                    rows.append({"source": source, "seed": seed, "object": name, "split": "unseen" if number % 2 else "held_out",
                                 "sequence": number, "end_depth_mm": 1.5, "depth_mm": depth, "aside_mm": aside, "aside": "x",
                                 "d_px": value, "e_px": value, "degenerate": int(rng.random() < mean / 500), "mae": value,
                                 "mse": value, "ssim": 0.9, "psnr": 30.0})
    return pd.DataFrame(rows)[COLUMNS]


def made_up_sliding(wrong=("cone",)):
    return pd.DataFrame([{"source": source, "seed": 0, "object": name, "state": state, "markers_lost": 0,
                          "change_px": 0.5 if state == "free" else 2.0 if name in wrong else 200.0}
                         for source in ("physics", "proposed") for name in OBJECTS for state in ("fixed", "free")])


FACTS = {"pairs_of_object": 19_845, "poses": 63}
WEIGHTS = {name: 2_000_000 for name in NETWORKS} | {"proposed_printed": 58_616_451, "temporal_printed": 163_222_147}
IN_ORDER = {"no_motion": 200, "pix2pix": 190, "no_lstm": 150, "proposed": 100, "temporal": 120, "physics": 5}


def verdicts_of(rows, sliding=None):
    judged = sliding_verdicts(made_up_sliding() if sliding is None else sliding, ["cross", "cylinder"])
    claims = claims_of_markers(rows, judged, FACTS, WEIGHTS)
    return dict(zip(claims.claim, claims.verdict, strict=True))


def test_scores_in_the_papers_order_reproduce_its_order():
    found = verdicts_of(made_up_scores(IN_ORDER))
    assert found["The d of the proposed network is smaller than that of the 3D-UNet without LSTM"] == REPRODUCED
    assert found["The proposed network has the smallest d at every deformation"] == REPRODUCED


def test_scores_in_another_order_do_not():
    found = verdicts_of(made_up_scores(IN_ORDER | {"proposed": 170}))
    assert found["The d of the proposed network is smaller than that of the 3D-UNet without LSTM"] == NOT
    assert found["The proposed network has the smallest d at every deformation"] == NOT


def test_scores_of_few_objects_decide_nothing():
    found = verdicts_of(made_up_scores(IN_ORDER, objects=("cone", "cross", "line")))
    assert found["The d of the proposed network is smaller than that of the 3D-UNet without LSTM"] == UNDECIDED


def test_networks_whose_images_all_lack_a_marker_decide_nothing():
    rows = made_up_scores(IN_ORDER).assign(d_px=np.nan, e_px=np.nan, degenerate=1)
    assert verdicts_of(rows)["The proposed network has the smallest d at every deformation"] == UNDECIDED


def test_the_papers_contradictions_are_stated_with_its_own_numbers():
    judged = sliding_verdicts(made_up_sliding(), ["cross"])
    claims = claims_of_markers(made_up_scores(IN_ORDER), judged, FACTS, WEIGHTS)
    odd = claims[claims.verdict == CONTRADICTION]
    assert len(odd) == 3
    assert odd.ours.iloc[0].startswith("tables I and II: 28.3% below Taxim, the FEM-based method; 93.5% below Phong")


def test_a_threshold_between_both_states_tells_all_but_the_small_object():
    judged = sliding_verdicts(made_up_sliding(), ["cross", "cylinder"])
    assert judged.threshold_px.unique() == pytest.approx([10.0])     # between 0.5 and 200 on a logarithmic scale
    assert wrong_objects(judged, "physics") == ["cone"]
    name = "The change of the summed motion tells fixed from free objects, all but cone and tetrahedron: the solved images"
    assert verdicts_of(made_up_scores(IN_ORDER))[name] == REPRODUCED
    assert verdicts_of(made_up_scores(IN_ORDER), made_up_sliding(("S",)))[name] == NOT


def test_images_without_any_marker_tell_no_object():
    lost = made_up_sliding().assign(change_px=np.nan)
    judged = sliding_verdicts(lost, ["cross", "cylinder"])
    assert set(judged.threshold_px) == {1.0}
    assert set(wrong_objects(judged, "physics")) == set(OBJECTS)


def test_tables_have_means_over_seeds_with_their_spread():
    rows = made_up_scores({"proposed": 100, "no_motion": 200})
    rows.loc[rows.source == "proposed", "d_px"] = rows.seed * 10.0
    rows.loc[rows.source == "no_motion", ["mae", "mse", "ssim", "psnr"]] = np.nan
    one = table_one(rows, ["no_motion", "proposed", "absent"]).set_index("source")
    assert one.loc["proposed", ["d_px", "d_px_sd"]].tolist() == pytest.approx([5.0, np.sqrt(50)])
    assert one.loc["proposed", "d_px_each"] == "0, 10"
    assert list(one.index) == ["no_motion", "proposed"]
    assert table_two(rows, ["no_motion", "proposed"]).source.tolist() == ["proposed"]


def test_the_page_to_drag_holds_all_frames_and_loads_nothing():
    images = np.zeros((3, 8, 8, 3), dtype=np.uint8)
    places = np.array([[[1.0, 2.0], [np.nan, 2.0]]] * 3)
    text = drag_fragment([DragSequence("cone", {"depth": images, "solved": images}, {"solved": places}, ["a", "b", "c"])])
    data = json.loads(re.search(r'id="drag-data">(.*?)</script>', text).group(1))
    assert len(data[0]["frames"]) == 3
    assert data[0]["places"]["solved"][0] == [[1.0, 2.0], None]
    assert not re.search(r"https?:|src=\"(?!data:)|url\(|import", text)


def test_markers_of_a_real_image_may_have_their_own_places_at_rest(tmp_path):
    rest = rest_px()
    table = pd.DataFrame(rest + 3, columns=["x_px", "y_px"])
    table.to_csv(tmp_path / "now.csv", index=False)
    table.assign(rest_x_px=rest[:, 0] + 1, rest_y_px=rest[:, 1]).to_csv(tmp_path / "both.csv", index=False)
    assert read_markers(tmp_path / "now.csv", rest)[1] is rest
    now, own_rest = read_markers(tmp_path / "both.csv", rest)
    assert now == pytest.approx(rest + 3)
    assert own_rest == pytest.approx(rest + [1, 0])


@pytest.mark.parametrize(("table", "said"), [
    (pd.DataFrame({"x": [1.0]}), "the column 'x_px' is missing; give x_px and y_px"),
    (pd.DataFrame({"x_px": [1.0], "y_px": [1.0]}), "it has 1 rows and the sensor 16 markers"),
    (pd.DataFrame({"x_px": 16 * [1.0], "y_px": 15 * [1.0] + [np.nan]}), "a place is not a number")])
def test_a_table_of_markers_that_does_not_fit_is_refused(tmp_path, table, said):
    table.to_csv(tmp_path / "markers.csv", index=False)
    with pytest.raises(InputError, match=said):
        read_markers(tmp_path / "markers.csv", rest_px())
    with pytest.raises(InputError, match="there is no such file"):
        read_markers(tmp_path / "other.csv", rest_px())


SETTINGS = {
    "kind": "markers", "study": "small", "meshes": None, "objects": {"train": ["cylinder"], "test": ["cone"]},
    "path": {"places_mm": [0], "angles_deg": [0, 30], "step_mm": 0.25, "depth_mm": 0.5, "aside_mm": 0.5},
    "share": {"train_poses": 1, "held_out_poses": 1, "unseen_poses": 1, "held_out": 1, "train_depths_mm": [0.5],
              "test_depths_mm": [0.5]},
    "networks": {"size": "reduced", "names": ["proposed", "pix2pix"], "seeds": [3], "training": {"epochs": 1, "constant_epochs": 1},
                 "device": "cpu"},
    "baselines": ["full_stick"], "scored_every": 2, "sliding": {"depth_mm": 0.5, "aside_mm": 0.5}, "shown": 1}


@pytest.fixture
def study_file(tmp_path):
    """A small configuration, and the paper's sensor with the made-up gel's camera."""
    from softtact.sensors.library import sensor_file

    sensor = yaml.safe_load(sensor_file("gelsight_wonkdim").read_text(encoding="utf-8"))
    sensor["readouts"]["camera"] |= {
        "pixels": [CAMERA_PX, CAMERA_PX], "mm_per_px": MM_PER_PX,
        "markers": {"rows": MARKERS, "columns": MARKERS, "pitch_px": CAMERA_PX / MARKERS, "radius_mm": RADIUS_PX * MM_PER_PX}}
    (tmp_path / "gel.yaml").write_text(yaml.safe_dump(sensor), encoding="utf-8")
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(SETTINGS | {"sensor": str(tmp_path / "gel.yaml")}), encoding="utf-8")
    return path


def test_a_depth_between_two_steps_is_refused(study_file):
    values = read_values(study_file)
    values["share"] = values["share"] | {"test_depths_mm": [0.3]}
    with pytest.raises(InputError, match=r"a depth of 0.3 mm is not among steps of 0.25 mm to 0.5 mm; give a multiple"):
        load_study(values, study_file)


@pytest.mark.parametrize(("seeds", "trained"), [(2, [0, 1]), ([7, 3], [7, 3])])
def test_networks_are_trained_from_each_seed(study_file, seeds, trained):
    values = read_values(study_file)
    values["networks"] = values["networks"] | {"seeds": seeds}
    made = jobs(load_study(values, study_file), "results")
    for stage in ("train_network", "score_network"):
        assert [job.settings["seed"] for job in made if job.stage == stage and job.settings["network"] == "proposed"] == trained
    trainings = {file for job in made if job.stage == "train_network" for file in job.made().values()}
    read = [str(file) for job in made for files in job.inputs.values() for file in ([files] if isinstance(files, str) else files)]
    assert all(file in trainings for file in read if "/learning/" in file)


def test_a_seed_named_twice_is_refused(study_file):
    values = read_values(study_file)
    values["networks"] = values["networks"] | {"seeds": [1, 1]}
    with pytest.raises(InputError, match="networks.*names a seed twice"):
        load_study(values, study_file)


def test_an_object_in_both_halves_is_refused(study_file):
    values = read_values(study_file) | {"objects": {"train": ["cone"], "test": ["cone"]}}
    with pytest.raises(InputError, match="'cone' is in both train and test; leave it in one of them"):
        load_study(values, study_file)


def test_an_object_named_twice_is_refused(study_file):
    values = read_values(study_file) | {"objects": {"train": ["cone", "cone"], "test": ["torus"]}}
    with pytest.raises(InputError, match="names 'cone' twice"):
        load_study(values, study_file)


def test_a_sensor_without_a_camera_is_refused(study_file):
    values = read_values(study_file) | {"sensor": "coro"}
    with pytest.raises(InputError, match="coro has no readout 'camera'; name a sensor with the readouts camera, markers and depth"):
        load_study(values, study_file)


def test_meshes_of_a_folder_come_before_generated_ones(study_file, tmp_path, monkeypatch):
    monkeypatch.setenv("MESHES", str(tmp_path))
    generated_object("cone").export(tmp_path / "cone.STL")
    study = load_study(read_values(study_file) | {"meshes": "${MESHES}"}, study_file)
    assert study.mesh_file("cone") == tmp_path / "cone.STL"
    assert study.mesh_file("cylinder") is None


@pytest.mark.slow
def test_all_stages_run_on_a_made_up_gel(study_file, tmp_path, monkeypatch):
    """From objects to the page, with drawn frames in place of presses; the markers of other physics are the truth's here."""
    from softtact.studies.jobs import find_stage
    from softtact.studies.markers.stages import data
    from softtact.studies.registry import open_study

    monkeypatch.setattr(data, "press_frames", made_up_frames)
    monkeypatch.setattr(data, "sensor_with", lambda *_: None)
    opened, folder = open_study(study_file), tmp_path / "results"
    for job in opened.jobs(folder):
        inputs, outputs = ({name: Path(files) if isinstance(files, str) else list(map(Path, files))
                            for name, files in named.items()} for named in (job.inputs, job.made()))
        find_stage(f"markers.{job.stage}")(inputs=inputs, outputs=outputs, settings=json.loads(json.dumps(job.settings)))
    table = pd.read_csv(folder / "tables/table1.csv").set_index("source")
    assert table.loc["full_stick", "d_px"] < 1e-3
    assert table.loc["physics", "d_px"] < 0.3 * table.loc["no_motion", "d_px"]
    manifest = pd.read_csv(folder / "dataset/manifest.csv")
    assert manifest.split.value_counts().to_dict() == {"train": 2, "held_out": 2, "unseen": 2}
    stored = read_dataset(folder / "dataset/cone_0.nc")
    assert cKDTree(rest_px()).query(stored.marker_px.values[0])[0].max() < 1e-6
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "No real image of this sensor is here" in page and 'id="drag-data"' in page
    assert numbers_without_a_file(page) == []
