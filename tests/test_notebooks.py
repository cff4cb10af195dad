"""The notebooks: kept without outputs, and each runs from top to bottom in a kernel of Jupyter and draws."""

import json
from pathlib import Path

import nbclient
import nbformat
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
    assert len(cells(path, "markdown")) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_prints_and_draws(path, tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)     # else the kernel would not draw below the cells
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("image/png" in output.get("data", ()) for output in outputs)
    assert any(output.get("name") == "stdout" for output in outputs)
    assert not [output.text for output in outputs if "Warning" in output.get("text", "")]
