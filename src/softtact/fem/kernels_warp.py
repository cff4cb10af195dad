"""The loops over elements as Warp kernels in double precision, on the processor or a GPU: the same functions as `kernels` has.

Each thread has one point, or one pair of nodes, so that nothing is written twice. Constants are written as float64, for a bare
number in a kernel may be of single precision. Laws are evaluated on the processor between the kernels.
"""

# mypy: ignore-errors
# (Warp reads a kernel's annotations by itself; for mypy they are no types.)

from typing import Any

import numpy as np
import warp as wp

from softtact.fem.kernel_records import Deformation, ElementArrays, VolumeResponse

wp.config.quiet = True
_ROW, _COLUMN = np.array([0, 1, 2, 0, 1, 2]), np.array([0, 1, 2, 1, 2, 0])
_real = wp.float64
_R3, _R4 = wp.array3d(dtype=_real), wp.array4d(dtype=_real)


@wp.func
def _symmetric(t: wp.array2d(dtype=_real), n: int) -> wp.mat33d:
    """A tensor stored as xx, yy, zz, xy, yz, zx."""
    return wp.mat33d(t[n, 0], t[n, 3], t[n, 5], t[n, 3], t[n, 1], t[n, 4], t[n, 5], t[n, 4], t[n, 2])


@wp.kernel
def _deform(u: _R3, gradients: _R4, shapes: wp.array(dtype=wp.int32), F: wp.array2d(dtype=wp.mat33d)):
    e, g = wp.tid()
    s = shapes[e]
    f = wp.identity(n=3, dtype=_real)
    for a in range(u.shape[1]):
        f += wp.outer(wp.vec3d(u[e, a, 0], u[e, a, 1], u[e, a, 2]),
                      wp.vec3d(gradients[s, g, 0, a], gradients[s, g, 1, a], gradients[s, g, 2, a]))
    F[e, g] = f


@wp.kernel
def _stress(F: wp.array2d(dtype=wp.mat33d), stress: wp.array2d(dtype=_real), pressure: wp.array2d(dtype=_real),
            weights: wp.array2d(dtype=_real), S: wp.array2d(dtype=wp.mat33d)):
    """Second Piola-Kirchhoff stress with its pressure, times the point's volume."""
    e, g = wp.tid()
    f = F[e, g]
    inverse = wp.inverse(wp.transpose(f) * f)
    S[e, g] = weights[e, g] * (_symmetric(stress, e * F.shape[1] + g) + pressure[e, g] * wp.determinant(f) * inverse)


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
def _elasticity(F: wp.array2d(dtype=wp.mat33d), S: wp.array2d(dtype=wp.mat33d), D: _R4, A: _R4):
    """A_(3i+k),(3j+l) = F_ip F_jq D_pkql + delta_ij S_kl at a point, from D_(3p+k),(3q+l) times the point's volume."""
    e, g, row = wp.tid()
    f = F[e, g]
    i, k = row / 3, row % 3
    for j in range(3):
        for l in range(3):
            total = _real(0.0)
            if i == j:
                total = S[e, g][k, l]
            for p in range(3):
                for q in range(3):
                    total += f[i, p] * f[j, q] * D[e, g, 3 * p + k, 3 * q + l]
            A[e, g, row, 3 * j + l] = total


@wp.kernel
def _changes(F: wp.array2d(dtype=wp.mat33d), weights: wp.array2d(dtype=_real), gradients: _R4,
             shapes: wp.array(dtype=wp.int32), basis: wp.array2d(dtype=_real), seen: _R4):
    """How the projected volume of each mode changes with the nodes' displacements."""
    e, p, a = wp.tid()
    s = shapes[e]
    total = wp.vec3d()
    for g in range(F.shape[1]):
        f = F[e, g]
        cofactor = wp.determinant(f) * wp.transpose(wp.inverse(f))
        along = cofactor * wp.vec3d(gradients[s, g, 0, a], gradients[s, g, 1, a], gradients[s, g, 2, a])
        total += basis[g, p] * weights[e, g] * along
    for i in range(3):
        seen[e, p, a, i] = total[i]


@wp.kernel
def _blocks(A: _R4, gradients: _R4, shapes: wp.array(dtype=wp.int32), seen: _R4, inner: _R3, K: _R3):
    """The block of two nodes of an element's tangent."""
    e, a, b = wp.tid()
    s = shapes[e]
    for i in range(3):
        for j in range(3):
            total = _real(0.0)
            for g in range(A.shape[1]):
                for k in range(3):
                    for l in range(3):
                        total += gradients[s, g, k, a] * A[e, g, 3 * i + k, 3 * j + l] * gradients[s, g, l, b]
            for p in range(seen.shape[1]):
                for q in range(seen.shape[1]):
                    total += seen[e, p, a, i] * inner[e, p, q] * seen[e, q, b, j]
            K[e, 3 * a + i, 3 * b + j] = total


class WarpKernels:
    """The loops of `kernels` on a device of Warp: "cpu", or "cuda" where there is one."""

    def __init__(self, device: str = "cpu") -> None:
        self.device = wp.get_device(device)

    def _array(self, values: np.ndarray, dtype: Any = _real) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    def _room(self, shape: tuple[int, ...], dtype: Any = _real) -> Any:
        return wp.empty(shape, dtype=dtype, device=self.device)

    def _launch(self, kernel: Any, dim: tuple[int, ...], *arguments: Any) -> None:
        wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device)

    def _rest(self, at_rest: ElementArrays) -> tuple[Any, Any, Any]:
        """Gradients, shapes and weights (e, g) on the device."""
        weights = at_rest.volumes[at_rest.shapes]
        return self._array(at_rest.gradients), self._array(at_rest.shapes.astype(np.int32), wp.int32), self._array(weights)

    def deformation(self, displacement: np.ndarray, at_rest: ElementArrays) -> Deformation:
        """`Deformation` of elements from nodal displacement (e, m, 3) in mm."""
        gradients, shapes, _ = self._rest(at_rest)
        room = self._room((len(displacement), at_rest.gradients.shape[1]), wp.mat33d)
        self._launch(_deform, room.shape, self._array(displacement), gradients, shapes, room)
        F = room.numpy()
        C = np.matmul(F.transpose(0, 1, 3, 2), F)
        return Deformation(F, np.ascontiguousarray(C[..., _ROW, _COLUMN].reshape(-1, 6)), np.linalg.det(F))

    def _stressed(self, deformed, weights, stress, pressure):
        F = self._array(deformed.F, wp.mat33d)
        S = self._room(F.shape, wp.mat33d)
        self._launch(_stress, F.shape, F, self._array(stress), self._array(pressure), weights, S)
        return F, S

    def internal_force(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Nodal forces (e, 3 m) in N: isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1, in MPa."""
        gradients, shapes, weights = self._rest(at_rest)
        F, S = self._stressed(deformed, weights, stress, pressure)
        force = self._room((len(deformed.J), at_rest.gradients.shape[3], 3))
        self._launch(_force, force.shape[:2], F, S, gradients, shapes, force)
        return force.numpy().reshape(len(deformed.J), -1)

    def tangent(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, moduli: np.ndarray, volume: VolumeResponse,
                like: np.ndarray) -> np.ndarray:
        """Tangent (e, 3 m, 3 m) in N/mm, see `kernels.tangent`; `like` names the precision of the result."""
        from softtact.fem.kernels_plain import material_tensor, mode_moduli

        gradients, shapes, weights = self._rest(at_rest)
        F, S = self._stressed(deformed, weights, stress, volume.pressure)
        elements, points, nodes = *deformed.J.shape, at_rest.gradients.shape[3]
        D = material_tensor(deformed, moduli, volume) * at_rest.volumes[at_rest.shapes][..., None, None, None, None]
        A = self._room((elements, points, 9, 9))
        self._launch(_elasticity, (elements, points, 9), F, S, self._array(D.reshape(elements, points, 9, 9)), A)
        seen = self._room((elements, at_rest.basis.shape[1], nodes, 3))
        self._launch(_changes, seen.shape[:3], F, weights, gradients, shapes, self._array(at_rest.basis), seen)
        K = self._room((elements, 3 * nodes, 3 * nodes))
        self._launch(_blocks, (elements, nodes, nodes), A, gradients, shapes, seen, self._array(mode_moduli(at_rest, volume)), K)
        return K.numpy().astype(like.dtype, copy=False)
