"""A study whose readings come from recordings of a real sensor: what it presses, and which recordings it takes."""

import pytest
from support.recordings import write_recordings
from support.studies import ROOT, merged

from softtact.errors import InputError
from softtact.studies.cost import read_costs
from softtact.studies.hybrid.config import load_study
from softtact.studies.registry import OpenStudy

ITEMS = ["indenters/circle_m", "indenters/square", "indenters/donut_m", "unseen/ellipse", "grasps/object_5"]


@pytest.fixture(scope="module")
def entries(tmp_path_factory):
    """`data.recordings` of the tiny study."""
    return write_recordings(tmp_path_factory.mktemp("recordings"), ITEMS)


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def study_of(entries, **changes):
    return load_study(merged("tiny") | {"data": {"source": "recorded", "recordings": entries}} | changes)


def refusal(entries, **changes):
    with pytest.raises(InputError) as caught:
        study_of(entries, **changes)
    sentence = str(caught.value)
    assert sentence.startswith("the configuration, at 'data") and sentence.endswith((".", "?")) and "\n" not in sentence
    return sentence


def test_the_models_press_as_ever_and_the_virtual_sensors_reference_is_not_pressed(entries):
    study = study_of(entries)
    assert study.source == "recording of a TSF-85" and study.counts_per_relative_change is None
    assert study.learnt_from == ["elastic", "hyperelastic"] and study.pressed_with == ["elastic", "hyperelastic", "foundation"]
    jobs = {cost.stage: cost.jobs for cost in OpenStudy("hybrid", study).costs(read_costs(), "none")}
    assert jobs["read_recordings"] == len(ITEMS)


def test_several_recordings_of_an_item_are_its_trials(entries):
    study = study_of([*entries, entries[0] | {"finger": 1}])
    assert [study.readings_of(item) for item in study.items()] == [2, 1, 1, 1, 1]
    assert study.trials_of("indenters") == pytest.approx(4 / 3) and study.trials_of("grasps") == 1


def test_recordings_that_do_not_fit_the_study_are_refused_with_what_to_do(entries):
    assert "there is no recording of unseen/ellipse, grasps/object_5; add one of each" in refusal(entries[:3])
    assert "did you mean 'unseen/ellipse'" in refusal([*entries, entries[3] | {"item": "unseen/elipse"}])
    assert "there is no file no/such.csv, of indenters/circle_m" in refusal([entries[0] | {"file": "no/such.csv"}, *entries[1:]])
    assert "finger 0 of" in (said := refusal([*entries, entries[0] | {"item": ITEMS[1]}])) and "a recording is of one press" in said
    assert "it is 'indenters'" in refusal([entries[0] | {"item": "indenters"}, *entries[1:]])
    assert "'recordings' are listed, and the source is 'generated'" in refusal([], data={"recordings": entries})


def test_a_sensor_with_other_taxels_than_the_recordings_is_refused(entries):
    with pytest.raises(InputError, match="at 'data.recordings': the sensor pad has 3 x 5 taxels, and the TSF-85 7 x 4"):
        load_study(merged("second_sensor") | {"data": {"source": "recorded", "recordings": entries}})


def test_a_folder_of_recordings_outside_the_project_is_said_once(entries, capsys):
    study_of(entries)
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "at 'data.recordings'" in said and "lies outside this project" in said
