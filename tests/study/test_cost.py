"""What a study costs, told before it starts."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from softtact.cli import main
from softtact.errors import InputError
from softtact.learning.settings import Search
from softtact.studies.cost import cost_lines, origin_of, read_costs
from softtact.studies.hybrid.cost import costs_of_study, epochs_of_a_trial
from softtact.studies.registry import open_study

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def costs_of(name, results="no_such_folder"):
    opened = open_study(f"config/{name}.yaml")
    return opened, {cost.stage: cost for cost in opened.costs(read_costs(), Path(results, opened.name))}


def test_the_paper_study_costs_710_presses_of_each_model_and_less_than_two_days():
    opened, costs = costs_of("paper")
    presses = {stage: cost for stage, cost in costs.items() if stage.startswith("simulate_press")}
    assert set(presses) == {f"simulate_press, {model}" for model in ("elastic", "foundation", "hyperelastic", "reference")}
    assert {(cost.jobs, cost.left) for cost in presses.values()} == {(710, 710)}
    # 20 load steps of 57 x 33 numbers of 8 bytes each
    assert presses["simulate_press, elastic"].disk_mb == pytest.approx(710 * 20 * 57 * 33 * 8 / 1e6)
    # 13,000 maps of which 10,400 train once, 2,600 validate twice; 400 cases twice; 40 presses x 20 load steps x 50 readings
    samples = 10_400 + 5_200 + 800 + 40_000
    assert costs["build_dataset"].disk_mb == pytest.approx(3 * samples * (57 * 33 + 28) * 4 / 1e6)
    hours = {name: sum(cost.hours for stage, cost in costs.items() if name in stage)
             for name in ("", "search", "train_cnn", "learning_rate")}
    network = hours["search"] + hours["train_cnn"] + hours["learning_rate"]
    assert f"needs {hours['']:.0f} core hours, {network:.0f} of them" in Path("docs/performance.md").read_text(encoding="utf-8")
    lines = list(cost_lines(opened.name, costs.values(), origin=origin_of(opened, read_costs()), cores=2))
    assert "at most 38 hours on 2 cores" in lines[-1] and len(lines) == len(costs) + 3


def test_the_presses_of_the_deciding_study_cost_what_they_took():
    """54,900 s of load steps in the records of its presses, the five slowest as pressed again, and 4 s for the start of each.

    Those five took 8,026 s with the solver of their time, and 882 s later (docs/notebook/2026-11-29-the-deciding-run.md).
    """
    _, costs = costs_of("decide")
    assert costs["press"].jobs == 315
    assert costs["press"].hours == pytest.approx((54900 + 4 * 315) / 3600, rel=0.1)


def test_the_tiny_study_costs_minutes_and_more_load_steps_cost_more():
    _, costs = costs_of("tiny")
    assert sum(cost.hours for cost in costs.values()) < 0.5
    each = costs_of("paper")[1]["simulate_press, hyperelastic"].each_s
    assert each > 2 * costs["simulate_press, hyperelastic"].each_s


def test_finished_jobs_are_not_counted_and_the_studys_own_times_come_first(tmp_path):
    folder = tmp_path / "tiny"
    for item, seconds in (("square", 30.0), ("donut_m", 50.0)):
        for path in (folder / f"presses/indenters/{item}/hyperelastic.nc",
                     folder / f"benchmarks/simulate_press/indenters/{item}/hyperelastic.tsv"):
            path.parent.mkdir(parents=True)
            path.write_text(f"s\th:m:s\n{seconds}\t0:00:30\n")
    cost = costs_of("tiny", tmp_path)[1]["simulate_press, hyperelastic"]
    assert (cost.jobs, cost.left, cost.each_s) == (5, 3, 40.0)
    assert cost.hours == pytest.approx(3 * 40 / 3600)


def test_presses_that_share_a_job_share_its_time(tmp_path):
    """The default study presses some objects in two places; a fast model does so in one job."""
    opened, told = costs_of("config")
    study = opened.study
    jobs = study.press_jobs("elastic")
    assert sorted({len(items) for items in jobs}) == [1, 2] and sum(map(len, jobs)) == len(study.items())
    assert [len(items) for items in study.press_jobs("hyperelastic")] == [1] * len(study.items())
    times = read_costs()["presses"]["elastic"]
    start_s = times["fixed_s"] * len(jobs) / len(study.items())
    assert told["simulate_press, elastic"].each_s == pytest.approx(start_s + 5 * times["load_step_s"])     # five load steps
    two = next(items[0] for items in jobs if len(items) == 2)
    path = tmp_path / study.name / f"benchmarks/simulate_presses/{two.set}/{two.id}/elastic.tsv"
    path.parent.mkdir(parents=True)
    path.write_text("s\th:m:s\n5.0\t0:00:05\n")
    assert costs_of("config", tmp_path)[1]["simulate_press, elastic"].each_s == 2.5


def test_a_trial_of_hyperband_costs_a_part_of_its_epochs():
    # max 9, factor 3: brackets from 1, 3 and 9 epochs take 9, 5 and 3 of 17 trials; a third goes on at each rung
    mean = (9 * (1 + 2 / 3 + 6 / 9) + 5 * (3 + 6 / 3) + 3 * 9) / 17
    assert epochs_of_a_trial(Search(max_epochs=9)) == pytest.approx(mean)
    assert epochs_of_a_trial(Search(max_epochs=1)) == 1


def test_the_command_tells_the_same_as_json(capsys):
    assert main(["cost", "--configfile", "config/tiny.yaml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["study"] == "tiny" and {stage["jobs"] for stage in told["stages"]} == {1, 2, 3, 5}
    assert main(["cost", "--configfile", "config/tiny.yaml", "--cores", "3"]) == 0
    assert "on 3 cores" in capsys.readouterr().out


def test_a_configuration_that_is_not_there_and_an_archives_study_are_refused(capsys, tmp_path):
    assert main(["cost", "--configfile", "config/papr.yaml"]) == 1
    assert "config/papr.yaml: there is no such configuration" in capsys.readouterr().err
    opened, _ = costs_of("tiny")
    with pytest.raises(InputError, match="it reads the published archive"):
        costs_of_study(replace(opened, study=replace(opened.study, archive=tmp_path)), read_costs(), tmp_path)


def test_every_measured_time_is_positive_and_says_where_it_comes_from():
    measured = yaml.safe_load((ROOT / "config/costs.yaml").read_text())
    assert "AMD" in measured["origin"]
    numbers = [value for part in (measured["presses"], measured["networks"]) for times in part.values() for value in times.values()]
    assert all(value > 0 for value in [*numbers, measured["start_s"], measured["reading_s"], measured["all_else_s"]])


@pytest.mark.parametrize("written", ["", "s\th:m:s\tmax_rss\n", "s\th:m:s\tmax_rss\n40"])
def test_a_benchmark_that_a_killed_job_left_half_written_tells_nothing(tmp_path, written):
    """A run that goes on reads those of the run that was killed."""
    opened, without = costs_of("tiny", results=tmp_path)
    for first, *more in opened.study.press_jobs("hyperelastic"):
        stage = "simulate_presses" if more else "simulate_press"
        path = tmp_path / opened.name / f"benchmarks/{stage}/{first.set}/{first.id}/hyperelastic.tsv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(written)
    _, costs = costs_of("tiny", results=tmp_path)
    assert costs == without
