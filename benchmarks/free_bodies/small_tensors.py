"""Vectors of three and 3 x 3 matrices as tuples, row by row, which stay in a processor's registers: for compiled loops."""

from numba import njit


@njit(cache=True, nogil=True, inline="always")
def cofactor(f: tuple[float, ...]) -> tuple[float, tuple[float, ...]]:
    """Determinant and cofactor of a matrix; both tuples of nine."""
    h = (f[4] * f[8] - f[5] * f[7], f[5] * f[6] - f[3] * f[8], f[3] * f[7] - f[4] * f[6],
         f[7] * f[2] - f[8] * f[1], f[8] * f[0] - f[6] * f[2], f[6] * f[1] - f[7] * f[0],
         f[1] * f[5] - f[2] * f[4], f[2] * f[3] - f[0] * f[5], f[0] * f[4] - f[1] * f[3])
    return f[0] * h[0] + f[1] * h[1] + f[2] * h[2], h


@njit(cache=True, nogil=True, inline="always")
def left_cauchy_green(f: tuple[float, ...]) -> tuple[float, float, tuple[float, ...]]:
    """I1 and I2 of B = F F^T, and its entries xx, yy, zz, xy, yz, zx."""
    x, y, z = f[:3], f[3:6], f[6:]
    xx, yy, zz, xy, yz, zx = dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(y, z), dot(z, x)
    return xx + yy + zz, xx * yy + yy * zz + zz * xx - xy * xy - yz * yz - zx * zx, (xx, yy, zz, xy, yz, zx)


@njit(cache=True, nogil=True, inline="always")
def symmetric_times(b: tuple[float, ...], v: tuple[float, ...]) -> tuple[float, ...]:
    """A symmetric matrix of entries xx, yy, zz, xy, yz, zx times a vector of three."""
    return (b[0] * v[0] + b[3] * v[1] + b[5] * v[2], b[3] * v[0] + b[1] * v[1] + b[4] * v[2],
            b[5] * v[0] + b[4] * v[1] + b[2] * v[2])


@njit(cache=True, nogil=True, inline="always")
def times(m: tuple[float, ...], g: tuple[float, ...]) -> tuple[float, ...]:
    """A matrix (a tuple of nine) times a vector of three."""
    return (m[0] * g[0] + m[1] * g[1] + m[2] * g[2], m[3] * g[0] + m[4] * g[1] + m[5] * g[2],
            m[6] * g[0] + m[7] * g[1] + m[8] * g[2])


@njit(cache=True, nogil=True, inline="always")
def combined(x: float, a: tuple[float, ...], y: float, b: tuple[float, ...], z: float, c: tuple[float, ...]) -> tuple[float, ...]:
    """x a + y b + z c of numbers and vectors of three."""
    return (x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2])


@njit(cache=True, nogil=True, inline="always")
def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True, inline="always")
def dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
