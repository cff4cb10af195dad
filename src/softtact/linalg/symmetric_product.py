"""Products with a symmetric matrix of which only the upper triangle is stored."""

import numpy as np

from softtact.compiled import compiled
from softtact.linalg.workers import SERIAL, Workers


class SymmetricProduct:
    """A x for symmetric matrices of one pattern, given by their upper triangles (csr, sorted, with their diagonals).

    Values are read once, not once for each triangle. Rows with the same columns (the three of a node) read these once.
    """

    _parts: list[tuple[int, np.ndarray]]

    def __init__(self, indptr: np.ndarray, indices: np.ndarray) -> None:
        self._indptr, self._indices = indptr, indices
        alike = _rows_alike(indptr, indices)
        first = np.cumsum([0, *alike])
        half = np.searchsorted(indptr[first], indptr[-1] // 2)
        self._parts = [(0, alike[:half]), (first[half], alike[half:])]     # halves by their values; sums do not depend on threads

    def __call__(self, data: np.ndarray, x: np.ndarray, *, workers: Workers = SERIAL) -> np.ndarray:
        """A x (n,) in double precision, whatever the precision of the values."""
        one, other = workers.map(lambda part: _symmetric_product(self._indptr, self._indices, data, *part, x), self._parts)
        return one + other


@compiled
def _rows_alike(indptr, indices):
    """Sizes of groups of consecutive rows: 3 where three rows have the same columns from their diagonals on, in threes; else 1."""
    alike, count, row = np.empty(len(indptr) - 1, np.int8), 0, 0
    while row < len(indptr) - 1:
        together = row + 2 < len(indptr) - 1
        for later in range(1, 3):
            if together:
                first, second, end = indptr[row] + later, indptr[row + later], indptr[row + later + 1]
                together = indptr[row + 1] - first == end - second and (indices[first:indptr[row + 1]] == indices[second:end]).all()
        together = together and _in_threes(indices[indptr[row]:indptr[row + 1]])
        alike[count] = 3 if together else 1
        row += alike[count]
        count += 1
    return alike[:count].copy()


@compiled(inline="always")
def _in_threes(columns):
    """Whether columns come in groups of three consecutive numbers."""
    if len(columns) % 3:
        return False
    for k in range(0, len(columns), 3):
        if columns[k + 1] != columns[k] + 1 or columns[k + 2] != columns[k] + 2:
            return False
    return True


@compiled
def _symmetric_product(indptr, indices, data, row, alike, x):
    """Contribution (n,) of the rows from `row` on and of their mirror images."""
    out = np.zeros(len(x))
    for rows in alike:
        if rows == 3:
            _add_three_rows(row, indptr, indices, data, x, out)
        else:
            x_row, total = x[row], 0.0
            for k in range(indptr[row], indptr[row + 1]):
                column, value = indices[k], data[k]
                total += value * x[column]
                if column != row:
                    out[column] += value * x_row
            out[row] += total
        row += rows
    return out


@compiled(fastmath=True)
def _add_three_rows(row, indptr, indices, data, x, out):
    # Unsigned indices: for signed ones numba checks whether they count from the end.
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    columns = indices[indptr[row]:indptr[row + 1]]
    first, second, third = (data[indptr[row]:indptr[row + 1]], data[indptr[row + 1]:indptr[row + 2]],
                            data[indptr[row + 2]:indptr[row + 3]])
    x0, x1, x2 = x[row], x[row + 1], x[row + 2]
    total0 = first[0] * x0 + first[1] * x1 + first[2] * x2
    total1 = first[1] * x0 + second[0] * x1 + second[1] * x2
    total2 = first[2] * x0 + second[1] * x1 + third[0] * x2
    k, end = three, np.uintp(len(columns))
    while k < end:
        c = np.uintp(columns[k])
        a0, a1, a2 = first[k], first[k + one], first[k + two]
        b0, b1, b2 = second[k - one], second[k], second[k + one]
        c0, c1, c2 = third[k - two], third[k - one], third[k]
        y0, y1, y2 = x[c], x[c + one], x[c + two]
        total0 += a0 * y0 + a1 * y1 + a2 * y2
        total1 += b0 * y0 + b1 * y1 + b2 * y2
        total2 += c0 * y0 + c1 * y1 + c2 * y2
        out[c] += a0 * x0 + b0 * x1 + c0 * x2
        out[c + one] += a1 * x0 + b1 * x1 + c1 * x2
        out[c + two] += a2 * x0 + b2 * x1 + c2 * x2
        k += three
    out[row] += total0
    out[row + 1] += total1
    out[row + 2] += total2
