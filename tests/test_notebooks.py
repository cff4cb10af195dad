"""The notebooks: kept without outputs, and each runs from top to bottom and draws.

Their cells are plain Python, so they run here in one process, without Jupyter and its 22 packages.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def cells(path, kind):
    """The texts of a notebook's cells of one kind."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def test_there_are_notebooks_for_all_that_one_begins_with():
    assert {path.stem for path in NOTEBOOKS} == {"first_press", "own_sensor", "own_rubber", "recording", "gel", "skin",
                                                 "learning_loop"}
    links = (ROOT / "docs/gallery.md").read_text(encoding="utf-8")
    assert all(f"`{path.name}`" in links for path in NOTEBOOKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs_and_has_words_between_its_code(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5) and cells(path, "markdown")[0].startswith("# ")
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert code and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    assert len(cells(path, "markdown")) >= 3 and not any(line.startswith(("%", "!")) for text in cells(path, "code")
                                                         for line in text.splitlines())     # plain Python, which runs here


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_prints_and_draws(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": path.stem}
    try:
        for number, text in enumerate(cells(path, "code")):
            exec(compile(text, f"{path.name}, block {number}", "exec"), names)
        assert plt.get_fignums() and capsys.readouterr().out
    finally:
        plt.close("all")
