"""Sheets of an Excel workbook as rows of cells; openpyxl reads them, which the extra `excel` brings."""

from pathlib import Path

from softtact.errors import InputError

WORKBOOKS = (".xlsx", ".xlsm")
Cell = str | float


def read_sheet(path: str | Path, *, sheet: str | None = None) -> list[tuple[int, list[Cell]]]:
    """[(row number from 1, cells)] of a sheet: numbers as float, all else as text, "" where nothing stands.

    sheet: its name; without one the workbook's only sheet that holds anything
    Raises InputError that names the file and the remedy.
    """
    import openpyxl  # of an extra: where it is missing, the command says which

    if not Path(path).is_file():
        raise InputError(f"{path}: there is no such file; give the path of a workbook.")
    try:
        book = openpyxl.load_workbook(path, data_only=True)
        sheets = {page.title: page for page in book.worksheets}
    except Exception as error:     # the reader of the zip and its XML raises whatever its parts do
        said = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: not a readable workbook ({said}); save it again as .xlsx, or as CSV.") from None
    page = sheets[_chosen(path, sheets, sheet)]
    return [(row, [_cell(path, cell) for cell in cells]) for row, cells in enumerate(page.iter_rows(), 1)]


def _chosen(path, sheets, sheet):
    """The name of the sheet to read."""
    if sheet is not None:
        if sheet not in sheets:
            raise InputError(f"{path}: there is no sheet {sheet!r}; name one of {', '.join(sheets)}.")
        return sheet
    filled = [name for name, page in sheets.items() if any(value is not None for row in page.values for value in row)]
    if len(filled) != 1:
        found = f"several sheets hold something, {', '.join(filled)}" if filled else "no sheet holds anything"
        raise InputError(f"{path}: {found}; name the one to read (--sheet NAME).")
    return filled[0]


def _cell(path, cell):
    """A cell's content. A number that is shown as percent is refused: what is seen is a hundred times what is stored."""
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if "%" in (cell.number_format or ""):
            raise InputError(f"{path}, cell {cell.coordinate}: it is shown as percent, so it holds {value:g} for what looks like "
                             f"{100 * value:g}; format the column as numbers, and let its header say whether they are percent.")
        return float(value)
    return str(value)
