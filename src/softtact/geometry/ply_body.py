"""The body of a PLY file: the rows of its elements, as many and as long as the header declares."""

import struct
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import line_at, shown


@dataclass(frozen=True)
class Property:
    """A property of an element: the code of its type in `struct`, and that of a list's length ('' of a single value)."""

    name: str
    code: str
    length_code: str = ""


@dataclass(frozen=True)
class Element:
    """An element of the header with the number of its rows."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def is_table(self) -> bool:
        """Whether all rows are equally long."""
        return not any(item.length_code for item in self.properties)


@dataclass(frozen=True)
class Rows:
    """What the rows of an element hold.

    values : by a property's name its values, of all rows behind each other
    counts : by a list's name the number of its values in each row
    places : the number of each row: its line in a text, its number from 0 in a binary file
    """

    values: Mapping[str, np.ndarray]
    counts: Mapping[str, np.ndarray]
    places: np.ndarray


def text_rows(path: Path, data: bytes, *, first_line: int, elements: list[Element],
              wanted: Mapping[str, tuple[str, ...]]) -> dict[str, Rows]:
    """Rows of the elements of a text body, which begins in `first_line`; `wanted` names the properties to keep of each."""
    if b"_" in data:     # Python would take 1_0 for a number
        line = first_line - 1 + line_at(data, data.index(b"_"))
        raise InputError(f"{path}: line {line}: '_' stands in a number; export the mesh again.")
    lines = ((number, words) for number, text in enumerate(data.split(b"\n"), first_line) if (words := text.split()))
    rows = {element.name: _text_element(path, lines, element, wanted.get(element.name, ())) for element in elements}
    more = next(lines, None)
    if more is not None:
        raise InputError(f"{path}: line {more[0]}: {shown(b' '.join(more[1]))} follows the last row that the header declares; "
                         "export the mesh again.")
    return rows


def _text_element(path: Path, lines: Iterator[tuple[int, list[bytes]]], element: Element, wanted: tuple[str, ...]) -> Rows:
    values, counts, places = _columns(element, wanted)
    for _ in range(element.count):
        line, words = next(lines, (0, []))
        if not words:
            raise _cut_off(path, element, len(places))
        try:
            at = _text_row(words, element, values, counts)
        except (ValueError, OverflowError, IndexError):
            at = -1
        if at != len(words):
            raise InputError(f"{path}: line {line}: {shown(b' '.join(words))} is no row of '{element.name}' as the header declares "
                             "it; export the mesh again.")
        places.append(line)
    return _rows(values, counts, places)


def _text_row(words, element, values, counts):
    """Append the wanted values of a row; the number of its words."""
    at = 0
    for item in element.properties:
        length = 1
        if item.length_code:
            length = int(words[at])
            at += 1
            if length < 0:
                raise ValueError
        if item.name in values:
            column = values[item.name]
            column.extend(map(float if column.typecode == "d" else int, words[at:at + length]))
            if item.length_code:
                counts[item.name].append(length)
        at += length
    return at


def binary_rows(path: Path, data: bytes, *, start: int, order: str, elements: list[Element],
                wanted: Mapping[str, tuple[str, ...]]) -> dict[str, Rows]:
    """Rows of the elements of a binary body, which begins at a byte; order: '<' or '>', of its bytes."""
    rows, at = {}, start
    for element in elements:
        read = _table if element.is_table else _lists
        rows[element.name], at = read(path, data, at, order, element, wanted.get(element.name, ()))
    if data[at:].strip(b" \t\r\n"):
        raise InputError(f"{path}: the rows that its header declares end at byte {at}, but the file has {len(data)}; export the "
                         "mesh again.")
    return rows


def _table(path, data, at, order, element, wanted):
    """Rows of equal length, and the byte behind them."""
    row = np.dtype([(item.name, f"{order}{item.code}") for item in element.properties])
    end = at + element.count * row.itemsize
    if end > len(data):
        raise _cut_off(path, element, (len(data) - at) // row.itemsize)
    table = np.frombuffer(data[at:end], row, count=element.count)
    return Rows({name: table[name] for name in wanted}, {}, np.arange(element.count)), end


def _lists(path, data, at, order, element, wanted):
    """Rows that hold lists, and the byte behind them."""
    values, counts, places = _columns(element, wanted)
    layout = [(values.get(item.name), counts.get(item.name), item.code, struct.calcsize(f"={item.code}"),
               struct.Struct(f"{order}{item.length_code}") if item.length_code else None) for item in element.properties]
    for number in range(element.count):
        for column, lengths, code, size, length_of in layout:
            length = 1
            if length_of is not None:
                length = length_of.unpack_from(data, at)[0] if at + length_of.size <= len(data) else 0
                at += length_of.size
            end = at + length * size
            if end > len(data) or length < 0:
                raise _cut_off(path, element, number)
            if column is not None:
                column.extend(struct.unpack_from(f"{order}{length}{code}", data, at))
            if lengths is not None:
                lengths.append(length)
            at = end
        places.append(number)
    return _rows(values, counts, places), at


def _columns(element, wanted):
    """Empty columns for the wanted values, for the lengths of lists among them, and for the rows' places."""
    kept = [item for item in element.properties if item.name in wanted]
    return ({item.name: array("d" if item.code in "fd" else "q") for item in kept},
            {item.name: array("q") for item in kept if item.length_code}, array("q"))


def _rows(values, counts, places):
    return Rows({name: np.array(column) for name, column in values.items()},
                {name: np.array(column) for name, column in counts.items()}, np.array(places))


def _cut_off(path, element, number):
    return InputError(f"{path}: its header declares {element.count} rows of '{element.name}', and the file ends or is damaged "
                      f"after {max(number, 0)} of them; export the mesh again.")
