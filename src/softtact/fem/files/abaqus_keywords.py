"""The language of input files of Abaqus and CalculiX: keyword lines with parameters, and rows of data below them.

Keywords and parameters are read in any case. A keyword line that ends with a comma is continued. `*INCLUDE, INPUT=FILE` and data in
the file that a parameter INPUT names are read in place; such files are looked for in the folder of the file that names them.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from softtact.errors import InputError
from softtact.inputs import check_input, check_limit

MOST_FILES_DEEP = 8
_FIELD = re.compile(r'(?:[^,"]|"[^"]*"?)+')


@dataclass
class Block:
    """A keyword with its rows of data, each with its line number."""

    path: Path
    line: int
    keyword: str
    """In capitals, with single spaces."""
    parameters: dict[str, str]
    """Names in capitals; values as written; empty where there is none."""
    rows: list[tuple[int, str]] = field(default_factory=list)
    source: Path | None = None
    """File of the rows, which a parameter INPUT may name."""

    def refusal(self, problem: str, line: int | None = None) -> InputError:
        """The error of a row, by default of the keyword."""
        return InputError(f"{self.path if line is None else self.source}, line {line or self.line}: {problem}.")

    def required(self, name: str) -> str:
        """A parameter's value. Raises InputError where it is missing."""
        if not self.parameters.get(name):
            raise self.refusal(f"*{self.keyword} has no {name}=; write it")
        return self.parameters[name]

    def numbers(self, text: str, line: int) -> list[float]:
        """The numbers of a row; an empty field is 0."""
        try:
            return [float(one.replace("D", "E").replace("d", "e")) if one else 0.0 for one in fields(text)]
        except ValueError:
            raise self.refusal(f"{text[:60]!r} below *{self.keyword} are not all numbers; correct them", line) from None

    def whole_numbers(self, text: str, line: int) -> list[int]:
        """The whole numbers of a row; empty fields are left out."""
        try:
            values = [int(one) for one in fields(text) if one]
        except ValueError:
            raise self.refusal(f"{text[:60]!r} below *{self.keyword} are not all whole numbers; correct them", line) from None
        if any(not 0 <= value < 2**31 for value in values):
            raise self.refusal(f"{text[:60]!r} below *{self.keyword} has a number below 0 or above 2^31; correct it", line)
        return values


def fields(text: str) -> list[str]:
    """The fields of a row, without an empty one at its end."""
    found = [one.strip().strip('"') for one in text.split(",")]
    return found[:-1] if found[-1] == "" else found


def read_blocks(path: Path) -> list[Block]:
    """All blocks of a deck and of the files that it includes.

    Raises InputError for a file that does not exist, includes itself, or is included too deep; for too much text altogether.
    """
    blocks: list[Block] = []
    size = 0
    for where, number, text in _lines(path, ()):
        size += len(text)
        if number == 1:
            check_limit(path, "mesh", size)
        if text.startswith("*"):
            keyword, *rest = _FIELD.findall(text[1:]) or [""]
            parameters = {name.strip().upper(): value.strip().strip('"') for name, _, value in (one.partition("=") for one in rest)}
            blocks.append(Block(where, number, " ".join(keyword.upper().split()), parameters))
        elif blocks and text:
            blocks[-1].source = where
            blocks[-1].rows.append((number, text))
    check_limit(path, "mesh", size)
    return blocks


def _lines(path: Path, above: tuple[Path, ...]) -> Iterator[tuple[Path, int, str]]:
    """(file, line number, text) of all lines without comments; keyword lines whole; files in place of the lines that name them."""
    place = path.resolve()
    if place in above:
        raise InputError(f"{path}: it includes itself, by way of {above[-1].name}; leave one of the two *INCLUDE out.")
    if len(above) > MOST_FILES_DEEP:
        raise InputError(f"{path}: files are included more than {MOST_FILES_DEEP} deep; put them into fewer files.")
    lines = enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1)
    for number, line in lines:
        text = line.strip()
        if text.startswith("**"):
            continue
        while text.startswith("*") and text.endswith(","):
            following = next(lines, (0, ""))[1].strip()
            text = text + following if following and not following.startswith("**") else text[:-1]
        if not text.startswith("*"):
            yield path, number, text
            continue
        name = text[1:].partition(",")[0].strip().upper()
        named = re.search(r',\s*INPUT\s*=\s*("[^"]*"|[^,]*)', text, re.IGNORECASE)
        if name == "INCLUDE" and named is None:
            raise InputError(f"{path}, line {number}: *INCLUDE names no file; write INPUT= and the file.")
        if name != "INCLUDE":
            yield path, number, text
        if named:
            yield from _included(path, number, named[1].strip().strip('"'), (*above, place))


def _included(path, number, name, above):
    file = path.parent / name.replace("\\", "/")     # as Windows writes folders
    check_input(file, "mesh", missing=f"there is no such file, which {path.name} includes in line {number}; put it there.")
    yield from _lines(file, above)
