"""Outliers of the archive: each by file and row, counted, and with what was done about it."""

from collections.abc import Collection
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import pandas as pd

from softtact.errors import InputError


@dataclass(frozen=True)
class Finding:
    """One outlier. row: the line of its first occurrence, 1 being the header;  path: the test, '' for a file;  count: occurrences
    done: "left out" (the test) or "kept"."""

    file: str
    row: int
    path: str
    what: str
    count: int
    done: str

    def __str__(self):
        return f"{self.file}, row {self.row}{f', {self.path}' if self.path else ''}: {self.what}"


class Outliers:
    """The findings, as they come up."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def leave_out(self, file: str | Path, row: int, path: str, what: str, *, count: int = 1) -> None:
        """A finding for which its test is not used."""
        self.findings.append(Finding(str(file), int(row), path, what, int(count), "left out"))

    def keep(self, file: str | Path, row: int, path: str, what: str, *, count: int = 1) -> None:
        """A finding that is only told."""
        self.findings.append(Finding(str(file), int(row), path, what, int(count), "kept"))

    def left_out(self) -> list[str]:
        """The tests that are not used, in the order of their first finding."""
        return list(dict.fromkeys(f.path for f in self.findings if f.done == "left out"))

    def leaves_out(self, path: str, *, files: Collection[str]) -> bool:
        """Whether a test is not used for a finding in one of the files."""
        return any(f.path == path and f.file in files and f.done == "left out" for f in self.findings)

    def table(self) -> pd.DataFrame:
        """A row per finding."""
        return pd.DataFrame([asdict(f) for f in self.findings], columns=[field.name for field in fields(Finding)])

    def refuse(self, tests: int, *, outliers: str, largest_share: float) -> None:
        """Refuse an archive that is odder than the user allows.

        tests: how many there are;  outliers: leave_out or refuse;  largest_share: of tests that may be left out
        """
        left = len(self.left_out())
        if left and (outliers == "refuse" or left > largest_share * tests):
            first = [str(f) for f in self.findings if f.done == "left out"][:3]
            allowed = "none may be" if outliers == "refuse" else f"at most {largest_share:.0%} may be"
            remedy = "set 'data.outliers' to leave_out" if outliers == "refuse" else "raise 'data.largest_outlier_share'"
            raise InputError(f"{left} of {tests} tests of the archive are outliers, and {allowed} ({'; '.join(first)}); "
                             f"correct the files or {remedy}.")
