"""Reference implementation of the loops over elements with a full strain operator, for plane strain, axisymmetric and spatial ones.

F = 1 + sum_a u_a (x) G_a + (sum_a u_a,x H_a) e3 (x) e3, with the gradients G_a of the shape functions and, of an axisymmetric
element, H_a = N_a / X: x is the radius, y the axis. `kernels` is faster for spatial elements and is tested against this module.
"""

from dataclasses import dataclass

import numpy as np

from softtact.fem.kernels import Deformation, ElementArrays, VolumeResponse

_ROW, _COLUMN = np.array([0, 1, 2, 0, 1, 2]), np.array([0, 1, 2, 1, 2, 0])
_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


@dataclass(frozen=True)
class PlainLoops:
    """The functions of `kernels`; hoop (u, g, m): H_a in 1/mm of the u different shapes, zero unless axisymmetric."""

    hoop: np.ndarray

    def _operator(self, at_rest: ElementArrays) -> np.ndarray:
        """Derivatives (e, g, 3, 3, m, 3) of F by the nodal displacements."""
        gradients = at_rest.gradients[at_rest.shapes]  # (e, g, 3, m)
        out = np.zeros((*gradients.shape[:2], 3, 3, gradients.shape[3], 3))
        for i in range(3):
            out[:, :, i, :, :, i] = gradients
        out[:, :, 2, 2, :, 0] += self.hoop[at_rest.shapes]
        return out

    def deformation(self, displacement: np.ndarray, at_rest: ElementArrays) -> Deformation:
        """`Deformation` of elements from nodal displacement (e, m, 3) in mm."""
        F = np.eye(3) + np.einsum("egijma,ema->egij", self._operator(at_rest), displacement, optimize=True)
        C = np.einsum("egki,egkj->egij", F, F)
        return Deformation(F, np.ascontiguousarray(C[..., _ROW, _COLUMN].reshape(-1, 6)), np.linalg.det(F))

    def internal_force(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Nodal forces (e, 3 m) in N: isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1, in MPa."""
        S = self._whole_stress(deformed, stress, pressure)
        P = np.einsum("egik,egkj->egij", deformed.F, S) * at_rest.volumes[at_rest.shapes][..., None, None]
        return np.einsum("egijma,egij->ema", self._operator(at_rest), P, optimize=True).reshape(len(P), -1)

    def _whole_stress(self, deformed, stress, pressure):
        S = stress + (pressure * deformed.J).reshape(-1, 1) * _inverses(deformed.C)
        return S[:, _VOIGT].reshape(*deformed.J.shape, 3, 3)

    def tangent(
        self,
        deformed: Deformation,
        at_rest: ElementArrays,
        stress: np.ndarray,
        moduli: np.ndarray,
        volume: VolumeResponse,
        like: np.ndarray,
    ) -> np.ndarray:
        """Tangent (e, 3 m, 3 m) in N/mm, see `kernels.tangent`; `like` names the precision of the result."""
        F, J, w, B = deformed.F, deformed.J, at_rest.volumes[at_rest.shapes], self._operator(at_rest)
        inverse, D = _inverses(deformed.C)[:, _VOIGT].reshape(F.shape), material_tensor(deformed, moduli, volume)
        A = np.einsum("egip,egpjql,egkq->egijkl", F, D, F, optimize=True)
        A += np.einsum("ik,eglj->egijkl", np.eye(3), self._whole_stress(deformed, stress, volume.pressure))
        k = B.shape[4] * 3
        B = B.reshape(*B.shape[:2], 9, k)
        out = np.einsum("egpk,egpq,egql->ekl", B, A.reshape(*J.shape, 9, 9) * w[..., None, None], B, optimize=True)
        cofactor = np.einsum("eg,egip,egpj->egij", J, F, inverse).reshape(*J.shape, 9)
        change = np.einsum("eg,egp,egpk->egk", w, cofactor, B, optimize=True)
        seen = np.einsum("gp,egk->epk", at_rest.basis, change)
        inner = mode_moduli(at_rest, volume)
        out += np.einsum("epk,epq,eql->ekl", seen, inner, seen, optimize=True)
        if volume.quartic.size:
            crossed = np.einsum("gp,eg,egk->epk", at_rest.basis, volume.quartic, change)
            half = np.einsum("epk,epq,eql->ekl", seen, at_rest.gram_inverse[at_rest.shapes], crossed, optimize=True)
            out -= half + half.transpose(0, 2, 1)
        return out.astype(like.dtype, copy=False)


def material_tensor(deformed: Deformation, moduli: np.ndarray, volume: VolumeResponse) -> np.ndarray:
    """dS_ij / dE_kl (e, g, 3, 3, 3, 3) in MPa at the points at constant pressure, from the law's moduli (e*g, 6, 6)."""
    J, inverse = deformed.J, _inverses(deformed.C)[:, _VOIGT].reshape(*deformed.J.shape, 3, 3)
    pj, local = volume.pressure * J, 0.5 * volume.unprojected * (J**2 + 1)
    if volume.quartic.size:
        local = local + volume.quartic * J**2
    crossed = np.einsum("egik,egjl->egijkl", inverse, inverse) + np.einsum("egil,egjk->egijkl", inverse, inverse)
    D = moduli[:, _VOIGT][:, :, :, _VOIGT].reshape(*J.shape, 3, 3, 3, 3)
    D = D + np.einsum("eg,egij,egkl->egijkl", pj + local, inverse, inverse)
    return D - np.einsum("eg,egijkl->egijkl", pj, crossed)


def mode_moduli(at_rest: ElementArrays, volume: VolumeResponse) -> np.ndarray:
    """Moduli (e, p, p) in MPa/mm3 of the elements' projected volume change."""
    gram, basis, w = at_rest.gram_inverse[at_rest.shapes], at_rest.basis, at_rest.volumes[at_rest.shapes]
    out = np.zeros_like(gram) if volume.stiffness.size else volume.modulus * gram
    for moduli in (volume.stiffness, volume.quartic):
        if moduli.size:
            out = out + gram @ np.einsum("eg,gp,gq->epq", w * moduli, basis, basis) @ gram
    return out


def _inverses(C6: np.ndarray) -> np.ndarray:
    """Inverses (n, 6) of symmetric tensors (n, 6)."""
    C = C6[:, _VOIGT]
    return np.linalg.inv(C)[:, _ROW, _COLUMN]
