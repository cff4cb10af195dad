"""The error of a tested model's mesh stands beside its scores."""

import json
from pathlib import Path

import pandas as pd
import pytest

from softtact.studies.hybrid.mesh_error import COLUMN, MESH_ERRORS, mesh_sentences, with_mesh_error

ROOT = Path(__file__).resolve().parents[2]
CONFIG = {"tested": ["elastic", "hyper"], "models": {
    "elastic": {"kind": "elastic"}, "hyper": {"mesh": {"preset": "draft"}}, "reference": {"mesh": {"preset": "fine"}}}}
NAMES = {"draft": "draft", "default": "production", "fine": "fine"}     # of the presets in the record


@pytest.mark.parametrize("preset", MESH_ERRORS)
def test_the_stated_errors_are_those_of_the_record(preset):
    record = json.loads((ROOT / "benchmarks/results/mesh_error.json").read_text())
    rows = [row for row in record["rows"] if row["mesh"] == NAMES[preset]]
    rms = [value for row in rows for value in row["rms_error_percent"]]
    largest = max(value for row in rows for value in row["largest_error_percent"])
    stated = MESH_ERRORS[preset]
    assert stated.largest == f"{largest:.0f} %"
    assert stated.rms == (f"{min(rms):.0f} to {max(rms):.0f} %" if preset == "draft" else f"up to {max(rms):.0f} %")


def test_a_table_of_scores_names_the_mesh_of_each_row():
    scores = pd.DataFrame({"model": ["elastic", "hyper"], "ssim_5_n": [0.7, 0.8]})
    assert with_mesh_error(scores, CONFIG)[COLUMN].tolist() == ["no such mesh", "draft: 2 to 5 %"]


@pytest.mark.parametrize("table", [pd.DataFrame({"model": ["hyper"], "maps": [3]}),
                                   pd.DataFrame({"policy": ["paper"], "ssim": [1.0]})])
def test_a_table_without_scores_of_models_stays_as_it_is(table):
    assert with_mesh_error(table, CONFIG) is table


def test_only_tested_models_on_measured_meshes_get_a_sentence():
    assert [sentence.partition(" puts")[0] for sentence in mesh_sentences(CONFIG)] == ["Mesh: the draft one of the hyper model"]
    changed = {**CONFIG, "models": {**CONFIG["models"], "hyper": {"mesh": {"preset": "stable"}}}}
    assert mesh_sentences(changed) == []


def test_every_score_of_the_tested_model_on_the_page_of_results_names_its_mesh():
    tables = [part for part in (ROOT / "docs/results.md").read_text().split("\n\n") if part.startswith("|")]
    scored = [table for table in tables if "| model |" in table.partition("\n")[0] and "SSIM" in table.partition("\n")[0]]
    rows = [row for table in scored for row in table.splitlines() if "| hyperelastic |" in row]
    assert len(rows) > 40 and all(row.endswith("| draft: 2 to 5 % |") for row in rows)
