"""The jobs of a skin's and a palpation sensor's study: a value of the design is a setting of just the stages that use it."""

from pathlib import Path

import pytest
import yaml

from softtact.studies.jobs import paths_of
from softtact.studies.registry import KINDS

ROOT = Path(__file__).resolve().parents[2]


def jobs_of(name, **changes):
    """{first output: job} of a design in config/ with other values of some keys; a mapping changes a section's keys."""
    path = ROOT / f"config/{name}.yaml"
    values = yaml.safe_load(path.read_text())
    for key, value in changes.items():
        values[key] = values[key] | value if isinstance(value, dict) else value
    kind = KINDS[values["kind"]]
    return {paths_of(job.made())[0]: job for job in kind.call("jobs", kind.call("load", values, path), "out")}


def changed(name, **changes):
    """The stages whose own settings or files are others, the report left out, which shows the whole design."""
    before, after = jobs_of(name), jobs_of(name, **changes)
    return {job.stage for path, job in (before | after).items()
            if before.get(path) != after.get(path)} - {"report"}


@pytest.mark.parametrize(("changes", "stages"), [
    ({"probes": {"pressures_kpa": [10]}}, {"compute_probes"}),
    ({"choice": {"draws": 100}}, {"choose_layer"}),
    ({"choice": {"weight_budget_g": 2.0}}, {"choose_layer", "rank_designs"}),
    ({"maps": {"spacing_mm": 2}}, {"map_patch"}),
    ({"maps": {"pressure_kpa": 20}}, {"map_patch", "draw_maps"}),
    ({"link": {"rings": 1}}, {"lay_modules"}),
    ({"search": {"radii_mm": [2]}}, {"search_cell", "rank_designs"}),
    ({"skin": "another title"}, set()),
    ({"elastomer": "Ecoflex 00-30"}, {"press_object", "read_taxels", "draw_load", "compute_probes", "map_patch", "lay_modules"}),
    ({"claims": False}, {"judge_claims"}),
])
def test_a_value_of_a_skin_s_design_changes_just_the_stages_that_use_it(changes, stages):
    assert changed("skin", **changes) == stages


@pytest.mark.parametrize(("changes", "stages"), [
    ({"load_n": {"to": 4}}, {"sweep"}),
    ({"hardness": {"shares": [0.5, 1]}}, {"measure_hardness"}),
    ({"search": {"noise_n": 0.01}}, {"find_lumps"}),
    ({"search": {"x": [6, 12, 18, 24]}}, {"solve_lumps", "find_lumps"}),
    ({"variants": {"mine": {"jaw": "sliding"}}}, {"sweep", "tabulate"}),
])
def test_a_value_of_a_palpation_sensor_s_design_changes_just_the_stages_that_use_it(changes, stages):
    assert changed("probe", **changes) == stages


def test_the_papers_claims_on_skin_are_judged_with_the_papers_elastomers(tmp_path):
    file = tmp_path / "mine.yaml"
    foam = {"name": "SomaFoama", "strain_percent": [0.0, 500.0, 0.0, 0.0], "density_g_cm3": 1.0, "poisson": 0.3,
            "permittivity": 2.0, "permittivity_fe": 2.0}
    file.write_text(yaml.safe_dump({"elastomers": [foam]}))
    papers, mine = ({job.stage: job.settings for job in jobs_of("skin", **changes).values()} for changes in (
        {}, {"elastomers": str(file)}))
    assert mine["choose_layer"] != papers["choose_layer"] and mine["judge_claims"] == papers["judge_claims"]


def test_other_loads_leave_the_sweeps_of_the_displacement_as_they_are():
    before, after = jobs_of("probe"), jobs_of("probe", load_n={"to": 4})
    assert {path for path in before if before[path] != after[path]} - {"out/report.html"} == {
        f"out/{tissue}_load.nc" for tissue in yaml.safe_load((ROOT / "config/probe.yaml").read_text())["tissues"]}


@pytest.mark.parametrize("name", ["skin", "tiny_skin", "probe", "tiny_probe"])
def test_what_a_job_reads_another_has_made_before_or_lies_there(name):
    made = set()
    for job in jobs_of(name).values():
        assert all(path in made or Path(path).is_file() for path in paths_of(job.inputs)), job.label
        outputs = paths_of(job.made())
        assert not made & set(outputs)
        made |= set(outputs)
    assert {"out/report.html", "out/summary.json"} <= made and ("out/tables/claims.csv" in made or name == "tiny_skin")


def test_a_design_without_a_study_s_name_takes_that_of_its_file():
    values = {"skin": "mine", "loads": [{"name": "a", "diameter_mm": 6, "at_taxel": 7, "pressure_kpa": 20}]}
    assert KINDS["skin"].call("load", values, ROOT / "forearm.yaml").name == "forearm"
    assert KINDS["skin"].call("load", values | {"study": "other"}, ROOT / "forearm.yaml").name == "other"
