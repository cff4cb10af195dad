"""The page of results: what run it is of, what it shows of it, and when it is older than the code."""

import importlib.util
import json
import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

from softtact.errors import InputError

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def script(tmp_path):
    """The script, which writes below a folder of the test."""
    spec = importlib.util.spec_from_file_location("write_results", ROOT / "scripts" / "write_results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.PAGE, module.FOLDER = tmp_path / "docs" / "results.md", tmp_path / "docs" / "results"
    return module


@pytest.fixture
def run(tmp_path):
    """A finished run with one figure, two claims and one sentence on what it lacks."""
    folder = tmp_path / "results" / "small"
    for name in ("figures", "tables"):
        (folder / name).mkdir(parents=True)
    (folder / "config.yaml").write_text(yaml.safe_dump({"study": "small", "seed": 17}))
    Image.fromarray(np.zeros((600, 1800, 3), dtype=np.uint8)).save(folder / "figures" / "fig7_maps.png")
    claims = [{"claim": f"claim {k}", "where": "sec. 4", "paper": "1", "ours": "2", "verdict": verdict, "rule": "", "evidence": "",
               "uncertainty": f"{5 + k} objects"}
              for k, verdict in enumerate(["reproduced", "undecided"])]
    pd.DataFrame(claims).to_csv(folder / "tables" / "claims.csv", index=False)
    pd.DataFrame({"sentence": ["No robot."]}).to_csv(folder / "tables" / "gaps.csv", index=False)
    (folder / "report.html").write_text("a page")
    return folder


def test_the_page_names_its_run_and_shows_its_claims_figures_and_gaps(script, run):
    script.write(run)
    text, made = script.PAGE.read_text(), json.loads((script.FOLDER / "run.json").read_text())
    assert made["seed"] == 17 and made["settings_sha256"] == script.digest(run / "config.yaml")
    for said in ("seed 17", made["commit"][:12], made["settings_sha256"][:16], "1 reproduced, 1 undecided", "claim 1",
                 "* No robot.", "results/fig7_maps.png"):
        assert said in text, said
    assert Image.open(script.FOLDER / "fig7_maps.png").size == (900, 300)


def numbers_of(text):
    """The numbers of a text: {written: value}."""
    written = re.findall(r"(?<![\w.])\d+(?:,\d{3})*(?:\.\d+)?", text)
    return {word: float(word.replace(",", "")) for word in written}


def test_the_page_opens_with_ten_sentences_whose_numbers_stand_in_the_tables():
    page = (ROOT / "docs/results.md").read_text()
    sentences = page.partition("## What was found\n\n")[2].partition("\n\n")[0].splitlines()
    assert len(sentences) == 10 and page.index("## What was found") < page.index("![")
    tables = [path.read_text() for path in (ROOT / "docs/results").glob("*.csv")]
    known = [value for text in [*tables, (ROOT / "docs/results/run.json").read_text()] for value in numbers_of(text).values()]
    claims = str(len(pd.read_csv(ROOT / "docs/results/claims.csv")))
    verdicts = page.partition("In it: ")[2].partition("\n")[0] + page.partition(" claims: ")[2].partition("\n")[0]
    for sentence in sentences:
        for written, value in numbers_of(re.sub("95 % interval", "", sentence)).items():
            assert written in verdicts or written == claims or any(float(f"{one:.3g}") == value or one == value for one in known), (
                f"{written} of {sentence!r} stands in no table")


def test_the_sentences_follow_the_tables(script, run, tmp_path):
    script.write(run)
    assert "errs by" not in script.PAGE.read_text()
    policies = pd.read_csv(ROOT / "docs/results/policies.csv")
    policies.loc[policies.policy == "paper", "mean_error_mm"] = 0.456
    policies.to_csv(script.FOLDER / "policies.csv", index=False)
    script.write_page()
    seconds = float(policies[policies.policy == "paper"].time_per_press_s.iloc[0])
    assert f"by an object's complexity errs by 0.456 mm in {seconds:.3g} s a press" in script.PAGE.read_text()


def test_a_run_that_is_not_finished_or_older_than_the_code_gives_no_page(script, run):
    os.utime(run / "report.html", (0, 0))
    with pytest.raises(InputError, match="is older than the code; run `make` first"):
        script.write(run)
    (run / "tables" / "claims.csv").unlink()
    with pytest.raises(InputError, match="claims.csv: is missing"):
        script.write(run)
    assert not script.PAGE.exists() and not script.FOLDER.exists()


def test_a_source_file_that_has_changed_since_is_named_by_a_warning(script, run, capsys):
    script.write(run)
    script.check()
    assert capsys.readouterr().err == ""
    made = json.loads((script.FOLDER / "run.json").read_text())
    made["sources"]["src/softtact/press/sensor.py"] = "other"
    (script.FOLDER / "run.json").write_text(json.dumps(made))
    script.check()
    assert "1 source files have changed since (src/softtact/press/sensor.py)" in capsys.readouterr().err


def test_a_page_whose_rules_have_changed_says_so_and_judges_again_what_its_table_tells(script, run):
    script.write(run)
    assert "by the rules of today" not in script.PAGE.read_text()
    made = json.loads((script.FOLDER / "run.json").read_text())
    made["sources"]["src/softtact/evaluation/decisions.py"] = "other"
    (script.FOLDER / "run.json").write_text(json.dumps(made))
    script.write_page()
    text = script.PAGE.read_text()
    assert "**These verdicts are older than the rules.**" in text and made["commit"][:12] in text
    assert "| claim 0 | sec. 4 | 1 | 2 | reproduced | undecided |" in text       # five objects
    assert "| Objects 1, 2 and 3 are smooth |" in text       # print needs no run


def test_a_kept_verdict_is_undecided_by_few_objects_and_not_judged_again_by_many(script):
    def today(claim, verdict, uncertainty):
        (row,) = pd.DataFrame([{"claim": claim, "verdict": verdict, "uncertainty": uncertainty}]).itertuples()
        return script.judged_today(row, {"in print": {"verdict": "consistent in print"}})

    assert today("a", "reproduced", "standard error nan, 1 objects") == today("a", "not reproduced", "2 objects") == "undecided"
    for known in ("standard error 0.1, 10 objects", "none: counts"):
        assert today("a", "reproduced", known) == "not judged again"
    assert today("a", "needs the archive", "3 objects") == "needs the archive"
    assert today("A hyperelastic map takes minutes", "not reproduced", "195 maps") == "undecided"
    assert today("object 4: reliefs", "reproduced", "counts") == "undecided"
    assert today("in print", "contradicts itself", "") == "consistent in print"


def test_a_page_that_was_never_made_is_said_to_be_missing(script, capsys):
    script.check()
    assert "docs/results.md was not made yet" in capsys.readouterr().err
