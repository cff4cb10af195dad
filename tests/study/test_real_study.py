"""The study on measured data: its jobs, its stages on data of its own, verdicts, and sentences for data that are not there."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from softtact.errors import InputError
from softtact.evaluation.decisions import NOT, REPRODUCED, UNDECIDED
from softtact.imaging.ball_presses import Gel
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.elastic.layer_shear import outward
from softtact.models.solid.ball_on_disc import DiscPress
from softtact.studies.jobs import paths_of
from softtact.studies.real.claims import claims_of_real
from softtact.studies.real.config import gel_data, load_study
from softtact.studies.real.jobs import jobs
from softtact.studies.real.labelled import SHADOWS, circles_found, fitted, per_press_mae, read_set, split, wheel_difference
from softtact.studies.real.paths import write_path
from softtact.studies.real.stages.force import elastic_path, fit_modulus
from softtact.studies.real.stages.gathering import gather_markers, gather_presses
from softtact.studies.real.stages.markers import fit_gel

MADE = {"source": "made", "name": "", "ball_px": 26.0, "thickness_px": 40.0, "mm_per_px": 0.1}


def small_press():
    """A path of the linear layer, thickness 1, ball 0.8: stands for the solid model's, which takes half a minute."""
    radii, layers = np.linspace(0, 4, 80), [BallOnLayer(one, 0.8, 1.0, 0.475) for one in np.linspace(0.1, 0.6, 5)]
    none = np.zeros((1, 80))
    depth, force = [0, *(one.depth for one in layers)], [0, *(one.force_over_shear_modulus for one in layers)]
    out = np.vstack([none, *(outward(one, radii) for one in layers)])
    low = np.vstack([none, *(one.lowering(radii) for one in layers)])
    return DiscPress(np.array(depth), np.array(force), radii, out, low)


@pytest.fixture(scope="module")
def presses(tmp_path_factory):
    folder = tmp_path_factory.mktemp("real")
    outputs = {"presses": folder / "made.npz", "facts": folder / "made.json"}
    gather_presses(inputs={}, outputs=outputs, settings={"set": MADE, "data": None, "taxim": None, "seed": 1})
    return outputs


def test_every_input_of_a_job_is_made_by_an_earlier_one_or_was_measured():
    made: set[str] = set()
    for job in jobs(load_study({}), "results/real"):
        measured = [path for path in paths_of(job.inputs) if path not in made]
        assert not measured or job.stage.startswith("gather_") and all(Path(path).is_file() for path in measured), job.label
        made |= set(paths_of(job.made()))
    assert "results/real/report.html" in made


def test_measured_files_are_inputs_so_that_a_change_of_them_gathers_them_anew(tmp_path):
    for name in ("gel/fots/presses.csv", "gel/fots/background.npy", "gel/fots/presses/1.png", "markers.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    values = yaml.safe_load(open("config/real.yaml", encoding="utf-8"))
    values |= {"data": str(tmp_path), "markers": values["markers"] | {"image": str(tmp_path / "markers.csv")}}
    made = jobs(load_study(values), tmp_path / "out")
    read = {one.label: one.inputs["files"] for one in made if one.stage in ("gather_presses", "gather_markers")}
    assert read["gather_markers image"] == [str(tmp_path / "markers.csv")]
    fots = next(files for name, files in read.items() if name.startswith("gather_presses") and files)
    assert {str(tmp_path / "gel/fots" / name) for name in ("presses.csv", "background.npy", "presses/1.png")} == set(fots)


def test_a_point_deeper_than_the_path_is_refused():
    values = yaml.safe_load(open("config/real.yaml", encoding="utf-8"))["gel_force"]
    with pytest.raises(InputError, match="depths_mm ends at 2 mm, before the point at 3 mm; add it"):
        load_study({"gel_force": values | {"points": [{"depth_mm": 1.0, "force_n": 1.0}, {"depth_mm": 3.0, "force_n": 9.0}]}})


def test_data_that_are_not_there_are_named_with_their_source(tmp_path, monkeypatch):
    monkeypatch.delenv("SOFTTACT_TEST_DATA", raising=False)
    with pytest.raises(InputError, match="no folder of measured data is stated; set `data` in the configuration"):
        gel_data(None, "fots/presses.csv")
    with pytest.raises(InputError, match="there is no such file; copy it from github.com/Rancho-zhao/FOTS, commit 5bcde04"):
        gel_data(str(tmp_path), "fots/presses.csv")


def test_a_judged_variant_that_is_none_is_refused():
    values = yaml.safe_load(open("config/real.yaml", encoding="utf-8"))["gel_force"]
    with pytest.raises(InputError, match="gel_force.judged is 'sliding', which is no variant; name one of slipping, "):
        load_study({"gel_force": values | {"judged": "sliding"}})


def test_a_wheel_without_the_set_is_refused(tmp_path):
    (tmp_path / "taxim-1.4.1-py3-none-any.whl").write_bytes(b"no wheel")
    with pytest.raises(InputError, match="it holds no calibration 'gelsight' of taxim==1.4.1"):
        gather_presses(inputs={}, outputs={}, settings={"set": MADE | {"source": "taxim", "name": "gelsight"}, "data": None,
                                                        "taxim": str(tmp_path), "seed": 1})


def test_drawn_presses_are_said_to_be_no_measurement(presses):
    assert json.loads(presses["facts"].read_text())["measured"] is False


def test_a_seed_holds_out_the_same_third_and_no_press_is_in_both_parts():
    fit, held = split(9, 0.333, 5)
    assert (fit, held) == split(9, 0.333, 5) != split(9, 0.333, 6)
    assert len(held) == 3 and sorted(fit + held) == list(range(9))


def test_the_table_predicts_presses_that_it_has_not_seen_to_the_noise(presses):
    gel = Gel(26.0, 40.0)
    own = read_set(presses["presses"], gel)
    fit, held = split(len(own.presses), 0.333, 0)
    model = fitted("table", own, [own.presses[k] for k in fit], gel, {"tilt_degree": 4, "place_degree": 1}, reach=[1.0] * len(fit))
    error = per_press_mae(model, [own.presses[k] for k in held], gel, reach=[1.0] * len(held))
    assert error.mean() < 2.5      # noise of one grey level has a mean of 0.8; quantisation and the polynomial's limits


@pytest.mark.slow     # the finding of one circle is tested in test_shading.py
def test_circles_moved_by_two_pixels_are_found_again(presses):
    gel = Gel(26.0, 40.0)
    own = read_set(presses["presses"], gel)
    rng = np.random.default_rng(2)
    moved = [replace(one, centre_px=tuple(np.array(one.centre_px) + rng.choice([-2, 2], 2))) for one in own.presses]
    found, _ = circles_found(replace(own, presses=moved), range(9), gel, {"tilt_degree": 2, "place_degree": 0}, 3)
    off = [np.hypot(*np.subtract(one.centre_px, true.centre_px)) for one, true in zip(found, own.presses, strict=True)]
    assert np.median(off) < 1.0      # 2.8 before


def test_the_wheels_table_is_read_by_tilt_direction_and_place():
    table = np.zeros((3, 125, 125, 6))
    table[0, :, :, 3] = np.arange(125)[:, None]      # times x, rising with the tilt
    found = wheel_difference(table, np.array([[1.0, 0.0]]), np.array([2.0]), np.array([5.0]))
    assert found[0] == pytest.approx([2 * 62, 0, 0])     # 45 degrees is the middle of 0 ... 90


def test_forces_of_a_known_modulus_give_it_back_and_check_points_stay_unfitted(tmp_path):
    path = elastic_path(7.5, 4.0, 0.475, [0.5, 1.0, 1.5])
    point = [{"depth_mm": depth, "force_n": 0.16 * float(path.at(depth))} for depth in (0.5, 1.5, 1.0)]
    ratio = 20
    settings = {"gel_force": {"ball_mm": 7.5, "height_mm": 4.0, "source": "made", "points": point[:2], "check_points": point[2:],
                              "depths_mm": [0.5, 1.0, 1.5], "judged": "only", "variants": {"only": {"bulk_over_shear": ratio}}}}
    write_path(tmp_path / "path.nc", path, {})
    fit_modulus(inputs={"path_only": tmp_path / "path.nc"}, outputs={"table": tmp_path / "t.csv", "facts": tmp_path / "f.json"},
                settings=settings)
    table = pd.read_csv(tmp_path / "t.csv").query("variant == 'only'")
    assert table.shear_modulus_mpa.to_numpy() == pytest.approx(0.16, rel=1e-5)
    assert table.depth_error.abs().max() < 1e-4
    assert not table[table.depth_mm == 1.0].fitted.any()


def test_a_modulus_that_takes_a_point_beyond_the_computed_depths_is_not_the_one_of_all_points(tmp_path):
    """Twice as stiff at the second point. The modulus of the first has it beyond the path, which counted as no error."""
    depths, none = np.array([0.0, 0.5, 1.0, 1.5]), np.zeros((4, 1))
    write_path(tmp_path / "path.nc", DiscPress(depths, depths**1.5, np.zeros(1), none, none), {})
    points = [{"depth_mm": 0.5, "force_n": 0.5**1.5}, {"depth_mm": 1.5, "force_n": 2 * 1.5**1.5}]
    settings = {"gel_force": {"ball_mm": 7.5, "height_mm": 4.0, "source": "made", "points": points, "check_points": [],
                              "depths_mm": [0.5, 1.0, 1.5], "judged": "only", "variants": {"only": {"bulk_over_shear": 20}}}}
    fit_modulus(inputs={"path_only": tmp_path / "path.nc"}, outputs={"table": tmp_path / "t.csv", "facts": tmp_path / "f.json"},
                settings=settings)
    table = pd.read_csv(tmp_path / "t.csv")
    own = table[(table.variant == "only") & (table.fitted_to == "all")]
    assert own.shear_modulus_mpa.to_numpy() == pytest.approx(2.0) and own.depth_error.notna().all()
    assert own.depth_error.iloc[0] == pytest.approx(0.5 ** (2 / 3) - 1, abs=0.1)     # of the path's interpolation
    judged = claims_of_real(tables(0.0, 0.2, 3.0) | {"gel_force": table}, limits={}, made={"s": False}, stated={"s": None},
                            markers_made=False, sheared=[], judged="only").iloc[:2]
    assert set(judged.verdict) == {NOT} and "beyond the computed depths (predicted)" in judged.ours.iloc[1]


@pytest.mark.slow     # its parts are tested in tests/imaging/test_marker_motion.py
def test_a_gel_is_fitted_to_a_drawn_image_and_compared(tmp_path):
    values = {"middle_px": [160, 120], "centre_px": [137, 123], "ball_px": 94.0, "distance_px": 450.0}
    gather_markers(inputs={}, outputs={"markers": tmp_path / "m.csv"},
                   settings={"file": "made", "data": None, "seed": 1, "markers": values})
    write_path(tmp_path / "p.nc", small_press(), {})
    files = {"table": "t.csv", "motion": "mo.csv", "gel": "g.json", "path": "g.nc"}
    outputs = {name: tmp_path / file for name, file in files.items()}
    paths = {"only": {"ball_over_thickness": 0.8, "friction": 0.5, "bulk_over_shear": 20}}
    fit_gel(inputs={"markers": tmp_path / "m.csv", "path_only": tmp_path / "p.nc"}, outputs=outputs,
            settings={"markers": values | {"paths": paths}})
    table = pd.read_csv(tmp_path / "t.csv").set_index(["model", "camera"]).components
    assert table["no motion", "none"] == 1
    assert table["finite strain, stick and slip", "shift"] < table["camera's motion alone", "shift"]
    assert json.loads((tmp_path / "g.json").read_text())["path"] == "only"


LABELS = "The labelled circles of s lie where the images show them"


def tables(depth_error, markers, mae, gain=1.0, odd_minus_found=0.5):
    """Tables of the claims, with one number of each part."""
    force = pd.DataFrame({"variant": ["a", "a", "b", "b", "elastic layer"], "fitted_to": ["all", "0.5 mm", "all", "0.5 mm", "all"],
                          "depth_mm": [0.5, 1.5, 0.5, 1.5, 0.5], "depth_error": [0.9, 0.9, *[depth_error] * 3],
                          "fitted": [True, False, True, False, True]})
    models = ["finite strain, stick and slip", "FOTS' formulas", "one linear layer"]
    motion = pd.DataFrame({"image": "first", "model": [*models, "thin-plate spline, left out"], "camera": ["shift"] * 3 + ["none"],
                           "components": markers})
    shading = pd.DataFrame([{"set": "s", "circles": circles, "model": model, "press": k, "seed": k % 2, "mae": mae + 0.01 * k,
                             "around_mae": mae - 0.2 * (model == SHADOWS) * gain + 0.01 * k}
                            for k in range(8) for circles in ("labelled", "found")
                            for model in ("table", SHADOWS, "phong", "quadratic in tilt")])
    size = pd.DataFrame({"set": "s", "model": "phong", "ball_px": [10, 20, 30], "mae": [5.0, 4.0, 5.0], "best_px": 20,
                         "best_low_px": 20, "best_high_px": 20})
    return {"gel_force": force, "markers": motion, "other_markers": motion.assign(image="shear"), "shading": shading,
            "ball_size": size,
            "circles": pd.DataFrame({"set": "s", "found_minus_label_px": [8.0, 9.0], "odd_minus_label_px": 8.0,
                                     "odd_minus_found_px": odd_minus_found})}


def verdicts(*numbers, made=False, stated=20.0, **options):
    found = claims_of_real(tables(*numbers, **options), limits={"s": 4.0}, made={"s": made}, stated={"s": stated},
                           markers_made=made, sheared=["shear"], judged="b")
    return found.set_index("claim").verdict


def of_force(**columns):
    """Verdict and words of both claims on the force, of rows with the columns fitted_to, depth_error and fitted."""
    given = pd.DataFrame({"variant": "b", "depth_mm": range(len(columns["fitted"])), **columns})
    layer = pd.DataFrame([{"variant": "elastic layer", "fitted_to": "all", "depth_mm": 0.5, "depth_error": 0.0, "fitted": True}])
    found = claims_of_real(tables(0.04, 0.2, 3.0) | {"gel_force": pd.concat([given, layer])}, limits={}, made={"s": False},
                           stated={"s": None}, markers_made=False, sheared=[], judged="b").iloc[:2]
    return list(zip(found.verdict, found.ours, strict=True))


def test_a_depth_beyond_those_computed_is_no_error_of_nothing():
    both = of_force(fitted_to=["all", "all", "0.5 mm", "0.5 mm"], depth_error=[0.01, np.nan, 0.0, np.nan],
                    fitted=[True, True, True, False])
    assert [verdict for verdict, _ in both] == [NOT, NOT]
    assert all("largest error beyond the computed depths" in words for _, words in both)


def test_a_point_that_is_checked_with_the_modulus_of_all_points_does_not_judge_that_of_one():
    (of_all, words), (of_one, _) = of_force(fitted_to=["all", "all", "0.5 mm"], depth_error=[0.01, 0.9, 0.01],
                                            fitted=[True, False, False])
    assert (of_all, of_one) == (NOT, REPRODUCED) and "90.0% (fitted, or predicted with it)" in words


def test_goals_that_are_met_are_reproduced_and_others_not():
    met, missed = (list(verdicts(*numbers).drop(LABELS)) for numbers in ((0.04, 0.2, 3.0), (0.06, 0.6, 5.0)))
    assert met == [REPRODUCED] * 8 and missed == [NOT] * 6 + [REPRODUCED] * 2      # shadows and size are found either way


def test_shadows_that_do_not_help_around_the_contacts_are_not_reproduced_and_none_at_all_undecided():
    name = "Cast shadows explain held-out presses of s"
    assert [verdicts(0.04, 0.2, 3.0, gain=gain)[name] for gain in (1.0, -1.0, 0.0)] == [REPRODUCED, NOT, UNDECIDED]


def test_labels_are_off_where_two_middles_agree_with_each_other_and_not_with_them():
    assert [verdicts(0.04, 0.2, 3.0, odd_minus_found=apart)[LABELS] for apart in (0.5, 7.0)] == [NOT, REPRODUCED]


def test_a_size_that_is_not_the_stated_one_is_not_found():
    assert verdicts(0.04, 0.2, 3.0, stated=25.0).iloc[-1] == NOT


def test_nothing_is_decided_on_data_that_the_study_drew_itself():
    assert set(verdicts(0.04, 0.2, 3.0, made=True).iloc[2:]) == {UNDECIDED}
