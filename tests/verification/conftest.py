"""The verification's ledger: each comparison is recorded, and `--write-docs` turns the rows into docs/reference/verification.md."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from softtact.files import atomic_path

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs" / "reference" / "verification.md"
INTRODUCTION = """\
# Verification: are the equations solved right?

More than half of the rows compare the code with a number that it did not produce itself: a closed form, a published value or
another program. The others compare it with a principle (conservation of energy, symmetry, frame indifference, the patch test)
or with itself: with a plain solver of this project that lacks the fast methods, a finer mesh, more steps, differences of its
own forces, or the same press without an effect (their source says so: "plain", "naive", "bonded tips", "the press without
friction", "limit of refinement", "central differences" and the like). Those show that two ways agree; a fault in what both
share, such as the law or the contact's definition, they do not show. CalculiX solved single elements, frusta, blocks and cells
for this page. Pads of up to 24 frusta are compared in the notebook ([decks](../notebook/2026-11-23-decks-against-calculix.md)),
a whole sensor was not. The tests in `tests/verification/` state the number and its source first, then compare, and give a
reason for each tolerance. Whether these are the right equations for a real sensor (validation) is another question, which this
page does not answer.

The tests write this page, if all of them pass:

    pytest tests/verification --write-docs

Units are mm, N, MPa and mJ unless a row names another. The error is relative to the expected number. Where that is 0, the error
is the value itself, and the row names its scale. A row that is called a known defect is tested too, and is expected to fail.
"""


@dataclass(frozen=True)
class Row:
    """One comparison; `error` is relative, or absolute where 0 is expected, and none where a least value is exceeded."""

    chapter: str
    quantity: str
    expected: float
    source: str
    got: float
    at_least: bool = False

    @property
    def error(self):
        if self.at_least and self.got >= self.expected:
            return 0.0
        return abs(self.got - self.expected) / (abs(self.expected) or 1.0)


def pytest_addoption(parser):
    parser.addoption("--write-docs", action="store_true", help="write docs/reference/verification.md from the numbers of this run")


def pytest_configure(config):
    config.verification_rows, config.verification_files = [], set()


def pytest_collection_finish(session):
    session.config.verification_files = {item.path.name for item in session.items}


@pytest.fixture
def record(request):
    """record(quantity, expected=..., source=..., got=...) keeps a row of the document and returns the row's error.

    With `at_least` the expected value is a lower bound.
    """

    def keep(quantity, *, expected, source, got, at_least=False):
        chapter = request.module.__doc__.splitlines()[0].rstrip(".")
        row = Row(chapter, quantity, float(expected), source, float(got), at_least)
        request.config.verification_rows.append(row)
        return row.error

    return keep


def pytest_terminal_summary(terminalreporter, exitstatus, config):
    if not config.getoption("--write-docs", default=False):
        return
    if exitstatus != 0:
        terminalreporter.write_line(f"{DOCUMENT.name} is not written: not every test passed.", red=True)
    elif config.getoption("numprocesses", default=None):
        terminalreporter.write_line(f"{DOCUMENT.name} is not written: its rows are of one process; leave -n out.", red=True)
    elif missing := _files_left_out(config):
        terminalreporter.write_line(f"{DOCUMENT.name} is not written: {', '.join(missing)} did not run in full.", red=True)
    else:
        with atomic_path(DOCUMENT) as temporary:
            temporary.write_text(document(config.verification_rows), encoding="utf-8")


def _files_left_out(config):
    """Names of this folder's test files that did not run in full."""
    everything = {path.name for path in HERE.glob("test_*.py")}
    chosen = any(config.getoption(name) for name in ("keyword", "deselect")) or "::" in " ".join(config.args)
    chosen = chosen or config.getoption("markexpr") not in ("", "not gold")     # the latter is pyproject.toml's own
    return sorted(everything if chosen else everything - config.verification_files)


def document(rows):
    """The document's text: a table for each chapter, in the order of the tests."""
    text = [INTRODUCTION]
    bound = {True: "at least ", False: ""}
    for chapter in dict.fromkeys(row.chapter for row in rows):
        text += [f"## {chapter}", "", "| quantity | expected | source | got | error |", "|---|---|---|---|---|"]
        text += [f"| {r.quantity} | {bound[r.at_least]}{r.expected:.6g} | {r.source} | {r.got:.6g} | {r.error:.1e} |"
                 for r in rows if r.chapter == chapter]
        text.append("")
    return "\n".join(text)
