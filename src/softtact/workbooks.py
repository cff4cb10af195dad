"""Read sheets of Excel with openpyxl (extra `excel`): what the user sees there, and nothing else.

Hidden rows and columns, as a filter leaves them, are left out with a remark. A number that is shown as percent is refused, since
Excel displays a hundred times the stored value.
"""

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from softtact.errors import InputError
from softtact.inputs import check_input, check_limit, in_one_sentence

WORKBOOKS = (".xlsx", ".xlsm")
Cell = str | float


def read_sheet(path: str | Path, *, sheet: str | None = None) -> tuple[list[tuple[int, list[Cell]]], tuple[str, ...]]:
    """[(row number from 1, cells)] of a sheet, and remarks on what was left out.

    Cells are numbers as float, all else as text: "" for an empty cell, and the formula itself if no program has stored its value.
    sheet: its name; by default the only visible sheet that is not empty
    Raises InputError with the file and the remedy.
    """
    book = _load(path, data_only=True)
    page = book[_chosen(path, book.worksheets, sheet)]
    formulas = _formulas(path, page) if any(_may_lack_a_value(cell) for cells in page.iter_rows() for cell in cells) else {}
    hidden_rows, hidden_columns = _hidden_rows(page), _hidden_columns(page)
    records = [(row, [_content(path, cell, formulas) for cell in cells if cell.column not in hidden_columns])
               for row, cells in enumerate(page.iter_rows(), 1) if row not in hidden_rows]
    return records, (*_remark(page.title, "row", hidden_rows), *_remark(page.title, "column", hidden_columns))


def _load(path: str | Path, *, data_only: bool) -> Any:
    """openpyxl's workbook; `data_only`: with stored values in place of formulas."""
    import openpyxl  # of an extra: where it is missing, the command says which

    check_input(path, "workbook", missing="there is no such file; give the path of a workbook.")
    with in_one_sentence(path, "not a readable workbook", "save it again as .xlsx, or as CSV"):
        with zipfile.ZipFile(path) as parts:
            check_limit(path, "workbook", sum(one.file_size for one in parts.infolist()))
        book = openpyxl.load_workbook(path, data_only=data_only)
        check_limit(path, "cells", max((page.max_row * page.max_column for page in book.worksheets), default=0))
    return book


def _chosen(path, pages, sheet):
    """The name of the sheet to read."""
    names = [page.title for page in pages]
    if sheet is not None:
        if sheet not in names:
            raise InputError(f"{path}: there is no sheet {sheet!r}; name one of {', '.join(names)}.")
        return sheet
    filled = [page for page in pages if any(value is not None for row in page.values for value in row)]
    seen = [page.title for page in filled if page.sheet_state == "visible"]
    if len(seen) != 1:
        found = "all sheets are empty" if not filled else "every sheet with data is hidden" if not seen else (
            f"several sheets hold data, {', '.join(seen)}")
        raise InputError(f"{path}: {found}; name the one to read (--sheet NAME).")
    return seen[0]


def _may_lack_a_value(cell):
    """Whether a cell read by its stored value may hold a formula without one; an empty text that is stored has another type."""
    return cell.value is None and cell.data_type == "n"


def _formulas(path, page):
    """{coordinate: text} of the formulas on a page that no program has evaluated: those written by programs other than Excel."""
    written = _load(path, data_only=False)[page.title]
    return {cell.coordinate: str(getattr(cell.value, "text", cell.value)) for cells in written.iter_rows() for cell in cells
            if cell.data_type == "f" and _may_lack_a_value(page[cell.coordinate])}


def _hidden_rows(page):
    """Numbers of the hidden rows that hold something."""
    return [row for row, place in sorted(page.row_dimensions.items()) if (place.hidden or place.height == 0)
            and row <= page.max_row and any(cell.value is not None for cell in page[row])]


def _hidden_columns(page):
    """Numbers of the hidden columns that hold something."""
    spans = [(place.min, place.max) for place in page.column_dimensions.values() if place.hidden or place.width == 0]
    columns = sorted({column for low, high in spans for column in range(low, min(high, page.max_column) + 1)})
    return [column for column in columns if any(page.cell(row, column).value is not None for row in range(1, page.max_row + 1))]


def _remark(title: str, what: str, hidden: Sequence[int]) -> Iterator[str]:
    """The remark on hidden rows or columns, if there are any: sentences without their full stop."""
    from openpyxl.utils import get_column_letter

    if not hidden:
        return
    name = str if what == "row" else get_column_letter
    starts = [k for k, number in enumerate(hidden) if k == 0 or number > hidden[k - 1] + 1]
    runs = [(hidden[start], hidden[end - 1]) for start, end in zip(starts, [*starts[1:], len(hidden)], strict=True)]
    listed = ", ".join(name(low) if low == high else f"{name(low)} to {name(high)}" for low, high in runs)
    several = len(hidden) > 1
    yield (f"{what}{'s' * several} {listed} of the sheet {title!r} {'are' if several else 'is'} hidden and left out; show "
           f"{'them' if several else 'it'} in Excel to have {'them' if several else 'it'} read")


def _content(path, cell, formulas):
    """A cell's content. Raises InputError for a number shown as percent: Excel displays a hundred times the stored value."""
    value = cell.value
    if value is None:
        return formulas.get(cell.coordinate, "")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if "%" in (cell.number_format or ""):
            raise InputError(f"{path}, cell {cell.coordinate}: it is shown as percent, so it holds {value:g} for what looks like "
                             f"{100 * value:g}; format the column as numbers, and let its header say whether they are percent.")
        return float(value)
    return str(value)
