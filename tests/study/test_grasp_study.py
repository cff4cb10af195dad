"""The study of grasps: it runs from its configuration to a report, goes on where it stopped, and judges claims by stated rules."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray
import yaml
from support.pages import numbers_without_a_file

from softtact.cli import main
from softtact.errors import InputError
from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose
from softtact.studies.cost import read_costs
from softtact.studies.grasps.claims import claims_of_grasps
from softtact.studies.grasps.config import GraspStudy
from softtact.studies.grasps.stages.summary import _facts, _result, papers_model
from softtact.studies.jobs import run_jobs
from softtact.studies.registry import OpenStudy, open_study

pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
ROOT = Path(__file__).resolve().parents[2]
ONE = {"study": "one", "kind": "grasps", "objects": ["object_3"], "positions": 1, "force_n": 10, "trials": 2, "model": "elastic",
       "one_event": {"objects": [], "models": ["elastic"], "force_n": 10, "cover_law": "mooney_rivlin"}}


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def load_grasp_study(path) -> GraspStudy:
    return open_study(path).study


def config(folder, **changes):
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(ONE | changes))
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grasps")
    assert main(["grasps", str(config(folder, **{"catalogue": str(ROOT / "config/objects/catalogue.yaml")})), "--out",
                 str(folder / "out"), "--workers", "1"]) == 0
    return folder


@pytest.mark.slow
def test_a_study_leaves_grasps_readings_claims_figures_and_a_report(results):
    out = results / "out"
    table = pd.read_csv(out / "grasps.csv")
    assert table.status.tolist() == ["done"] and table.force_left_n[0] == pytest.approx(10, rel=1e-3)
    assert (xarray.load_dataset(out / "grasps/object_3-0/readings.nc", engine="h5netcdf").tactile_map.shape) == (2, 2, 7, 4)
    page = (out / "report.html").read_text()
    assert "needs the archive" in page and page.count("data:image/png") == 1 and (out / "tables/claims.csv").exists()
    assert numbers_without_a_file(page) == []


def test_what_is_done_is_not_done_again_and_other_settings_are(results):
    kept = [results / f"out/grasps/object_3-0/{name}.nc" for name in ("events", "readings")]
    catalogue = str(ROOT / "config/objects/catalogue.yaml")

    def run(**changes):
        before = [path.stat().st_mtime_ns for path in kept]
        opened = open_study(config(results, catalogue=catalogue, **changes))
        jobs = [job for job in opened.jobs(results / "out") if job.stage in ("grasp", "read_grasp")]
        run_jobs("grasps", jobs, results / "out")
        return [path.stat().st_mtime_ns > old for path, old in zip(kept, before, strict=True)]

    assert run() == [False, False] and run(trials=3) == [False, True] and run(trials=3, force_n=12) == [True, True]


def test_the_paper_s_study_has_its_objects_and_at_least_its_trials():
    study = load_grasp_study("config/grasps.yaml")
    assert len({item.entry.name for item in study.items}) == 12 and len(study.items) * study.values.trials >= 2000
    assert [item.id for item in study.items[:2]] == ["object_1-0", "object_1-1"]
    assert (study.items[0].x_mm, study.items[0].angle_deg) == (0, 0) and abs(study.items[1].x_mm) <= 3


def test_a_position_depends_on_the_seed_and_not_on_the_other_objects(tmp_path):
    alone = load_grasp_study(config(tmp_path, objects=["coin"], positions=3)).items
    among = load_grasp_study(config(tmp_path, objects=["egg", "coin"], positions=3)).items
    other = load_grasp_study(config(tmp_path, objects=["coin"], positions=3, seed=2)).items
    assert alone == among[3:] and alone[1] != other[1]


def test_the_cost_is_told_before_the_work(tmp_path):
    opened = OpenStudy("grasps", load_grasp_study("config/grasps.yaml"))
    stages = {cost.stage: cost for cost in opened.costs(read_costs(), tmp_path)}
    assert stages["grasp"].jobs == stages["grasp"].left == 48
    # four of the twelve objects go to the hyperelastic model: 4 x 4 positions x 2 fingers x 2 events, and one of each two objects
    pressed = [job.work.get("hyperelastic", 0) for job in opened.jobs(tmp_path)]
    assert sum(pressed) == 66
    assert sum(cost.hours for cost in stages.values()) > 66 * 46 / 3600


@pytest.mark.parametrize(("changes", "said"), [({"objects": ["cion"]}, "'cion'"), ({"model": "best"}, "at 'model'"),
                                               ({"force": 3}, "'force'"), ({"positions": 0}, "at 'positions'"),
                                               ({"scene": {"frction": 1}}, "at 'scene': .*'frction': the key is unknown"),
                                               ({"scene": {"friction": -1}}, "at 'scene': .*friction"),
                                               ({"force_n": 1e6}, "at 'force_n': 1e.06 N is out of the range of "),
                                               ({"objects": ["object_1", "object_1"]}, "at 'objects': it names 'object_1' twice"),
                                               ({"one_event": {"objects": ["cion"], "models": ["elastic"], "force_n": 5,
                                                               "cover_law": "ogden2"}}, "at 'one_event.objects': .*'cion'")])
def test_a_fault_of_the_configuration_is_named(tmp_path, changes, said):
    with pytest.raises(InputError, match=said):
        load_grasp_study(config(tmp_path, **changes))


GRASP = {"grasp": "a-0", "object": "a", "status": "done", "trials": 50, "force_left_n": 50.0, "force_right_n": 50.0,
         **{f"{name}_{event}_{side}": "elastic" for name in ("model", "rule") for event in ("contact", "grip")
            for side in ("left", "right")}}


def verdicts(row, shares):
    compared = xarray.Dataset({"lower_share": ("model", shares)}, coords={"model": ["elastic", "hyperelastic"]},
                              attrs={"force_n": 50.0, "cover_law": "ogden2"})
    table = claims_of_grasps(pd.DataFrame([row]), {"object_5": compared}, force_n=50.0, policy="paper", model="auto")
    return table.set_index(table.claim.str.split(" ").str[0]).verdict.to_dict()


def test_the_page_says_where_taxels_are_at_the_end_of_the_converters_range():
    row = {"status": "done", "object": "a", "trials": 2, "valid_left": 1, "valid_right": 1, "at_range_end_left": 0}
    assert "converter" not in _result(pd.DataFrame([row | {"at_range_end_right": 0}]))
    full = _result(pd.DataFrame([row | {"at_range_end_right": 3}]))
    assert any("Taxels of 1 pad are at the end of the converter's range" in sentence for sentence in full)


def test_claims_hold_by_their_rules_alone():
    good = verdicts(GRASP, [0.02, 0.6])
    assert good["A"] == good["The"] == "reproduced" and good["Twelve"] == "not reproduced"
    assert verdicts(GRASP | {"model_grip_left": "hyperelastic"}, [0.02, 0.6])["A"] == "not reproduced"
    turned = GRASP | {f"{name}_contact_left": "hyperelastic" for name in ("model", "rule")}
    assert verdicts(turned, [0.02, 0.6])["A"] == "reproduced"      # each event by the rule at its own pose
    assert verdicts(GRASP | {"force_left_n": 48.0}, [0.02, 0.6])["The"] == "not reproduced"
    for shares in ([0.02, 0.6], [0.2, 0.6], [0.02, 0.2]):      # one event, and no truth beside the two models
        assert verdicts(GRASP, shares)["In"] == "undecided"
    assert good["SSIM"] == "needs the archive"


def test_a_study_whose_grasps_all_failed_decides_nothing_on_the_rule():
    failed = pd.DataFrame([{"grasp": "a-0", "object": "a", "status": "failed", "message": "x"}])
    table = claims_of_grasps(failed, {}, force_n=50.0, policy="paper", model="auto")
    assert table.verdict[0] == "undecided" and table.ours[0] == "no grasp was done"


def test_each_event_is_judged_by_the_rule_at_its_own_pose(tmp_path):
    """The key of the last test, whose teeth come over the pad between contact and grip."""
    study = load_grasp_study(config(tmp_path, objects=["key"]))
    poses = [Pose.from_values([0, 0, 0, 0, 0, 0]), Pose.from_values([2.46, -4.96, 0, 0, 0, 148.44])]
    row = [[[*pose.translation_mm, *pose.rotation.as_quat(scalar_first=True)]] * 2 for pose in poses]
    events = xarray.Dataset(
        {"event_row": ("event", [0, 1]), "time_s": ("time", [0.1, 0.2]), "object_pose_sensor": (("time", "finger", "pose"), row),
         "force_n": (("time", "finger", "axis"), np.full((2, 2, 3), -50.0)),
         "model": (("event", "finger"), np.full((2, 2), "elastic")), "within_validity": (("event", "finger"), np.ones((2, 2))),
         "deformation_map_mm": (("event", "finger", "y", "x"), np.zeros((2, 2, 3, 3)))}, coords={"finger": ["left", "right"]})
    read = xarray.Dataset({"tactile_map": (("finger", "trial", "row", "column"), np.zeros((2, 2, 7, 4)))})
    facts = _facts(events, read, read_mesh(study.items[0].entry.file, unit="mm"), study.spec)
    assert [facts[f"rule_{event}_left"] for event in ("contact", "grip")] == ["elastic", "hyperelastic"]


def test_the_rule_is_asked_for_the_place_of_an_object_not_for_its_middle(tmp_path):
    # Off the middle the key's teeth are over the pad, and much of its smooth head is not.
    study = load_grasp_study(config(tmp_path, objects=["key"]))
    mesh = read_mesh(study.items[0].entry.file, unit="mm")

    def ruled(pose):
        return papers_model(place(mesh, pose=pose), footprint_mm=study.spec.footprint_mm, reach_mm=study.spec.thickness_mm)

    assert ruled(None) == ruled(Pose.from_values([0, 0, 0, 0, 0, 0])) == "elastic"
    assert ruled(Pose.from_values([2.46, -4.96, 0, 0, 0, 148.44])) == "hyperelastic"
