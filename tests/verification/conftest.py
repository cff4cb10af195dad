"""The verification's ledger: each comparison is recorded, and `--write-docs` turns the rows into docs/verification.md."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from softtact.files import atomic_path

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs" / "verification.md"
INTRODUCTION = """\
# Verification: are the equations solved right?

Each row is one comparison of the code with a number that it did not produce itself: a closed form, a published value, another
program, or a naive solver without the fast one's devices. The tests in `tests/verification/` state the number and its source
before they compare, and each gives the reason of its tolerance beside it. Whether these are the right equations for a real
sensor is another question (validation), which this page does not answer.

This file is written by the tests themselves, if all of them pass:

    pytest tests/verification --write-docs

Units are mm, N, MPa, mJ unless said. The error is relative to the expected number; where that is 0 it is the value itself,
whose scale the quantity names. A row that expects an order of convergence or a bound says so.
"""


@dataclass(frozen=True)
class Row:
    """One comparison; `error` is relative, or absolute where 0 is expected."""

    chapter: str
    quantity: str
    expected: float
    source: str
    got: float

    @property
    def error(self):
        return abs(self.got - self.expected) / (abs(self.expected) or 1.0)


def pytest_addoption(parser):
    parser.addoption("--write-docs", action="store_true", help="write docs/verification.md from the numbers of this run")


def pytest_configure(config):
    config.verification_rows = []


@pytest.fixture
def record(request):
    """record(quantity, expected=..., source=..., got=...) keeps a row of the document and returns the row's error."""

    def keep(quantity, *, expected, source, got):
        chapter = request.module.__doc__.splitlines()[0].rstrip(".")
        row = Row(chapter, quantity, float(expected), source, float(got))
        request.config.verification_rows.append(row)
        return row.error

    return keep


def pytest_sessionfinish(session, exitstatus):
    if not session.config.getoption("--write-docs", default=False):
        return
    if exitstatus != 0:
        raise pytest.UsageError("docs/verification.md is not written: not every test passed.")
    if missing := _files_left_out(session):
        raise pytest.UsageError(f"docs/verification.md is not written: {', '.join(missing)} did not run in full.")
    with atomic_path(DOCUMENT) as temporary:
        temporary.write_text(document(session.config.verification_rows), encoding="utf-8")


def _files_left_out(session):
    """Names of this folder's test files that have no test in the session; all of them if tests were deselected."""
    everything = {path.name for path in HERE.glob("test_*.py")}
    chosen = any(session.config.getoption(name) for name in ("keyword", "markexpr", "deselect"))
    ran = set() if chosen else {item.path.name for item in session.items if "::" not in " ".join(session.config.args)}
    return sorted(everything - ran)


def document(rows):
    """The document's text: a table for each chapter, in the order of the tests."""
    text = [INTRODUCTION]
    for chapter in dict.fromkeys(row.chapter for row in rows):
        text += [f"## {chapter}", "", "| quantity | expected | source | got | error |", "|---|---|---|---|---|"]
        text += [f"| {r.quantity} | {r.expected:.6g} | {r.source} | {r.got:.6g} | {r.error:.1e} |"
                 for r in rows if r.chapter == chapter]
        text.append("")
    return "\n".join(text)
