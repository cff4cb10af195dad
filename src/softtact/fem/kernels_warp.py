"""The loops over elements as Warp kernels in double precision, on the processor or a GPU: the same functions as `kernels` has.

Each thread has one point, or one pair of nodes, so that no result is written twice; only the matrix entries are summed by atomic
operations. Constants are written as float64, because a bare number in a kernel may be of single precision. Laws are evaluated on
the processor between the kernels; for a tangent only the matrix's values are copied back from the device.
"""

# mypy: ignore-errors
# (Warp interprets a kernel's annotations; mypy does not accept them as types.)

from typing import Any

import numpy as np
import warp as wp

from softtact.fem.kernels import Deformation, ElementArrays, VolumeResponse

wp.config.log_level = wp.LOG_WARNING     # keeps Warp's notices out of a command's output
_AT_ONCE = 4096     # elements whose tangents are on the device at once: 1 GB for the largest elements
_MOST_KEPT = 64     # constant arrays that are kept on the device
_NONE = np.zeros((0, 0))
_real = wp.float64
_R3, _R4 = wp.array3d(dtype=_real), wp.array4d(dtype=_real)


@wp.func
def _symmetric(t: wp.array2d(dtype=_real), n: int) -> wp.mat33d:
    """A tensor stored as xx, yy, zz, xy, yz, zx."""
    return wp.mat33d(t[n, 0], t[n, 3], t[n, 5], t[n, 3], t[n, 1], t[n, 4], t[n, 5], t[n, 4], t[n, 2])


@wp.func
def _voigt(p: int, k: int):
    """Index of entry p, k of a symmetric tensor in its stored form."""
    if p == k:
        return p
    return wp.where(p + k == 1, 3, wp.where(p + k == 3, 4, 5))


@wp.kernel
def _deform(u: _R3, gradients: _R4, shapes: wp.array(dtype=wp.int32), F: wp.array2d(dtype=wp.mat33d), C: _R3,
            J: wp.array2d(dtype=_real)):
    e, g = wp.tid()
    s = shapes[e]
    f = wp.identity(n=3, dtype=_real)
    for a in range(u.shape[1]):
        f += wp.outer(wp.vec3d(u[e, a, 0], u[e, a, 1], u[e, a, 2]),
                      wp.vec3d(gradients[s, g, 0, a], gradients[s, g, 1, a], gradients[s, g, 2, a]))
    c = wp.transpose(f) * f
    F[e, g] = f
    J[e, g] = wp.determinant(f)
    for i in range(3):
        C[e, g, i] = c[i, i]
        C[e, g, 3 + i] = c[i, (i + 1) % 3]


@wp.kernel
def _stress(F: wp.array2d(dtype=wp.mat33d), stress: wp.array2d(dtype=_real), pressure: wp.array2d(dtype=_real),
            volumes: wp.array2d(dtype=_real), shapes: wp.array(dtype=wp.int32), S: wp.array2d(dtype=wp.mat33d)):
    """Second Piola-Kirchhoff stress with its pressure, times the point's volume."""
    e, g = wp.tid()
    f = F[e, g]
    inverse = wp.inverse(wp.transpose(f) * f)
    whole = _symmetric(stress, e * F.shape[1] + g) + pressure[e, g] * wp.determinant(f) * inverse
    S[e, g] = volumes[shapes[e], g] * whole


@wp.kernel
def _force(F: wp.array2d(dtype=wp.mat33d), S: wp.array2d(dtype=wp.mat33d), gradients: _R4,
           shapes: wp.array(dtype=wp.int32), force: _R3):
    e, a = wp.tid()
    s = shapes[e]
    total = wp.vec3d()
    for g in range(F.shape[1]):
        total += F[e, g] * (S[e, g] * wp.vec3d(gradients[s, g, 0, a], gradients[s, g, 1, a], gradients[s, g, 2, a]))
    for i in range(3):
        force[e, a, i] = total[i]


@wp.kernel
def _elasticity(F: wp.array2d(dtype=wp.mat33d), S: wp.array2d(dtype=wp.mat33d), moduli: _R3, pressure: wp.array2d(dtype=_real),
                quartic: wp.array2d(dtype=_real), unprojected: _real, volumes: wp.array2d(dtype=_real),
               shapes: wp.array(dtype=wp.int32), A: _R4):
    """A_(3i+k),(3j+l) = F_ip F_jq D_pkql + delta_ij S_kl at a point, times its volume; D as `kernels_plain.material_tensor`.

    quartic: the penalty's second derivative at the points, or no points
    """
    e, g, row = wp.tid()
    f = F[e, g]
    J = wp.determinant(f)
    inverse = wp.inverse(wp.transpose(f) * f)
    pj = pressure[e, g] * J
    whole = pj + _real(0.5) * unprojected * (J * J + _real(1.0))
    if quartic.shape[0] > 0:
        whole += quartic[e, g] * J * J
    volume = volumes[shapes[e], g]
    n = e * F.shape[1] + g
    i = row / 3
    k = row % 3
    half = wp.mat33d()      # F_ip D_pkql
    for q in range(3):
        for l in range(3):
            total = _real(0.0)
            for p in range(3):
                D = moduli[n, _voigt(p, k), _voigt(q, l)] + whole * inverse[p, k] * inverse[q, l]
                total += f[i, p] * (D - pj * (inverse[p, q] * inverse[k, l] + inverse[p, l] * inverse[k, q]))
            half[q, l] = total
    for j in range(3):
        for l in range(3):
            total = _real(0.0)
            for q in range(3):
                total += f[j, q] * half[q, l]
            total *= volume
            if i == j:
                total += S[e, g][k, l]
            A[e, g, row, 3 * j + l] = total


@wp.kernel
def _changes(F: wp.array2d(dtype=wp.mat33d), weights: wp.array2d(dtype=_real), volumes: wp.array2d(dtype=_real), gradients: _R4,
             shapes: wp.array(dtype=wp.int32), basis: wp.array2d(dtype=_real), seen: _R4):
    """Derivatives of the volume of each mode by the nodal displacements; weights of the points, or no points: all are 1."""
    e, p, a = wp.tid()
    s = shapes[e]
    total = wp.vec3d()
    for g in range(F.shape[1]):
        f = F[e, g]
        cofactor = wp.determinant(f) * wp.transpose(wp.inverse(f))
        along = cofactor * wp.vec3d(gradients[s, g, 0, a], gradients[s, g, 1, a], gradients[s, g, 2, a])
        share = basis[g, p] * volumes[s, g]
        if weights.shape[0] > 0:
            share *= weights[e, g]
        total += share * along
    for i in range(3):
        seen[e, p, a, i] = total[i]


@wp.kernel
def _blocks(A: _R4, gradients: _R4, shapes: wp.array(dtype=wp.int32), seen: _R4, inner: _R3, crossed: _R4, gram_inverse: _R3,
            upper: int, K: _R3):
    """The block of two nodes of an element's tangent; upper: blocks below the diagonal are left out.

    crossed: the modes' volumes weighted by the quartic penalty, or no elements
    """
    e, a, b = wp.tid()
    if upper == 1 and b < a:
        return
    s = shapes[e]
    block = wp.mat33d()
    for g in range(A.shape[1]):
        for i in range(3):
            for j in range(3):
                total = _real(0.0)
                for k in range(3):
                    inward = _real(0.0)
                    for l in range(3):
                        inward += A[e, g, 3 * i + k, 3 * j + l] * gradients[s, g, l, b]
                    total += gradients[s, g, k, a] * inward
                block[i, j] += total
    for p in range(seen.shape[1]):
        for q in range(seen.shape[1]):
            for i in range(3):
                for j in range(3):
                    block[i, j] += seen[e, p, a, i] * inner[e, p, q] * seen[e, q, b, j]
                    if crossed.shape[0] > 0:
                        block[i, j] -= gram_inverse[s, p, q] * (seen[e, p, a, i] * crossed[e, q, b, j]
                                                                + crossed[e, p, a, i] * seen[e, q, b, j])
    for i in range(3):
        for j in range(3):
            K[e, 3 * a + i, 3 * b + j] = block[i, j]


@wp.kernel
def _scatter(K: _R3, positions: wp.array2d(dtype=wp.int32), first: int, values: wp.array(dtype=_real)):
    """Add the upper triangle of elements' tangents to the values of a matrix, where `positions` are not negative."""
    e, i = wp.tid()
    size = K.shape[1]
    start = i * size - (i * (i - 1)) / 2 - i
    for j in range(i, size):
        place = positions[first + e, start + j]
        if place >= 0:
            wp.atomic_add(values, place, K[e, i, j])


class WarpKernels:
    """The loops of `kernels` on a device of Warp: "cuda", or the processor under the name "warp"."""

    def __init__(self, device: str) -> None:
        self.device = wp.get_device("cpu" if device == "warp" else device)
        self._kept: dict[int, tuple[np.ndarray, Any]] = {}

    def _array(self, values: np.ndarray, dtype: Any = _real) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    def _constant(self, values: np.ndarray, dtype: Any = _real) -> Any:
        """A constant array, which is kept on the device."""
        if id(values) not in self._kept:
            if len(self._kept) >= _MOST_KEPT:
                self._kept.clear()
            self._kept[id(values)] = values, self._array(values.astype(np.int32) if dtype is wp.int32 else values, dtype)
        return self._kept[id(values)][1]

    def _room(self, shape: tuple[int, ...], dtype: Any = _real) -> Any:
        return wp.empty(shape, dtype=dtype, device=self.device)

    def _launch(self, kernel: Any, dim: tuple[int, ...], *arguments: Any) -> None:
        wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device)

    def _rest(self, at_rest: ElementArrays) -> tuple[Any, Any, Any]:
        """Gradients, volumes and shapes on the device."""
        shapes = self._array(at_rest.shapes.astype(np.int32), wp.int32)
        return self._constant(at_rest.gradients), self._constant(at_rest.volumes), shapes

    def deformation(self, displacement: np.ndarray, at_rest: ElementArrays) -> Deformation:
        """`Deformation` of elements from nodal displacement (e, m, 3) in mm."""
        gradients, _, shapes = self._rest(at_rest)
        size = len(displacement), at_rest.gradients.shape[1]
        F, C, J = self._room(size, wp.mat33d), self._room((*size, 6)), self._room(size)
        self._launch(_deform, size, self._array(displacement), gradients, shapes, F, C, J)
        return Deformation(F.numpy(), C.numpy().reshape(-1, 6), J.numpy())

    def _stressed(self, deformed, at_rest, stress, pressure):
        F, (_, volumes, shapes) = self._array(deformed.F, wp.mat33d), self._rest(at_rest)
        S = self._room(F.shape, wp.mat33d)
        self._launch(_stress, F.shape, F, self._array(stress), pressure, volumes, shapes, S)
        return F, S

    def internal_force(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Nodal forces (e, 3 m) in N: isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1, in MPa."""
        gradients, _, shapes = self._rest(at_rest)
        F, S = self._stressed(deformed, at_rest, stress, self._array(pressure))
        force = self._room((len(deformed.J), at_rest.gradients.shape[3], 3))
        self._launch(_force, force.shape[:2], F, S, gradients, shapes, force)
        return force.numpy().reshape(len(deformed.J), -1)

    def tangent(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, moduli: np.ndarray, volume: VolumeResponse,
                like: np.ndarray) -> np.ndarray:
        """Tangent (e, 3 m, 3 m) in N/mm, see `kernels.tangent`; `like` names the precision of the result."""
        return self._tangents(deformed, at_rest, stress, moduli, volume).numpy().astype(like.dtype, copy=False)

    def add_tangent(self, values: np.ndarray, positions: np.ndarray, deformed: Deformation, at_rest: ElementArrays,
                    stress: np.ndarray, moduli: np.ndarray, volume: VolumeResponse) -> None:
        """Add elements' tangents (N/mm), summed on the device, to a matrix's values at `positions`, see `assembly.add_upper`."""
        g, there = at_rest.gradients.shape[1], self._constant(positions, wp.int32)
        total = wp.zeros(len(values), dtype=_real, device=self.device)
        for start in range(0, len(deformed.J), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            points = slice(start * g, (start + _AT_ONCE) * g)
            deformed_part = Deformation(deformed.F[part], deformed.C[points], deformed.J[part])
            K = self._tangents(deformed_part, at_rest._replace(shapes=at_rest.shapes[part]), stress[points], moduli[points],
                               volume.of(part), upper=True)
            self._launch(_scatter, K.shape[:2], K, there, start, total)
        values += total.numpy()

    def _tangents(self, deformed, at_rest, stress, moduli, volume, *, upper=False):
        """Tangents (e, 3 m, 3 m) on the device."""
        from softtact.fem.kernels_plain import mode_moduli

        gradients, volumes, shapes = self._rest(at_rest)
        pressure, quartic = self._array(volume.pressure), self._array(volume.quartic)
        F, S = self._stressed(deformed, at_rest, stress, pressure)
        elements, points, nodes = *deformed.J.shape, at_rest.gradients.shape[3]
        A, whole = self._room((elements, points, 9, 9)), self._array(moduli)
        self._launch(_elasticity, (elements, points, 9), F, S, whole, pressure, quartic, volume.unprojected, volumes, shapes, A)
        rest = volumes, gradients, shapes, self._constant(at_rest.basis)
        seen = self._room((elements, at_rest.basis.shape[1], nodes, 3))
        self._launch(_changes, seen.shape[:3], F, self._array(_NONE), *rest, seen)
        crossed = self._room((elements if volume.quartic.size else 0, *seen.shape[1:]))
        self._launch(_changes, crossed.shape[:3], F, quartic, *rest, crossed)
        K, inner = self._room((elements, 3 * nodes, 3 * nodes)), self._array(mode_moduli(at_rest, volume))
        self._launch(_blocks, (elements, nodes, nodes), A, gradients, shapes, seen, inner, crossed,
                     self._constant(at_rest.gram_inverse), int(upper), K)
        return K
