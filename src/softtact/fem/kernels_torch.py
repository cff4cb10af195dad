"""The loops of `kernels` as batched products on a torch device: elements are evaluated on a GPU, material laws on the processor.

A law takes C at all points (6 numbers each) and returns stress and moduli (6 and 36), so each law has one implementation. Sums are
in double precision, except for the products of a tangent in single precision, as in `kernels`; both agree to rounding.
"""

import numpy as np
import torch

from softtact.fem.kernels import Deformation, ElementArrays, VolumeResponse

_ROW, _COL = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]     # of xx, yy, zz, xy, yz, zx
_VOIGT = [[0, 3, 5], [3, 1, 4], [5, 4, 2]]


class DeviceKernels:
    """`deformation`, `internal_force` and `tangent` with the arguments of `kernels`; F remains on the device."""

    def __init__(self, device: str | torch.device) -> None:
        self.device = torch.device(device)
        self._kept: dict[int, tuple[np.ndarray, torch.Tensor]] = {}

    def deformation(self, displacement: np.ndarray, at_rest: ElementArrays) -> Deformation:
        """See `kernels.deformation`."""
        F, C, J = _kinematics(self._constant(at_rest.gradients)[self._there(at_rest.shapes)], self._there(displacement))
        return Deformation(F, _back(C), _back(J))

    def internal_force(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """See `kernels.internal_force`."""
        (F, _, J), which = deformed, self._there(at_rest.shapes)
        force = _forces(F, self._there(J), self._constant(at_rest.gradients)[which], self._constant(at_rest.volumes)[which],
                        self._per_point(stress, J), self._there(pressure))
        return _back(force)

    def tangent(self, deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, moduli: np.ndarray, volume: VolumeResponse,
                like: np.ndarray) -> np.ndarray:
        """See `kernels.tangent`."""
        (F, _, J), which, precision = deformed, self._there(at_rest.shapes), torch.from_numpy(like).dtype
        G, w, J_there = self._constant(at_rest.gradients)[which], self._constant(at_rest.volumes)[which], self._there(J)
        pj, quartic, stiffness = self._there(volume.pressure) * J_there, self._some(volume.quartic), self._some(volume.stiffness)
        local = 0.5 * volume.unprojected * (J_there**2 + 1)
        if quartic is not None:
            local = local + quartic * J_there**2
        A, inverse = _moduli(F, w, self._per_point(stress, J), self._per_point(moduli, J), pj, local)
        change = torch.einsum("egij,egjm->egmi", (w * J_there)[..., None, None] * (F @ inverse), G).flatten(2)
        modes = [values.to(precision) for values in (self._constant(at_rest.basis), self._constant(at_rest.gram_inverse)[which], w)]
        volumetric = _volumetric(change.to(precision), *modes, volume.modulus if stiffness is None else stiffness.to(precision),     # type: ignore[call-arg]
                                 None if quartic is None else quartic.to(precision))
        return _back(volumetric + _products(A.to(precision), G.to(precision)))

    def _some(self, values):
        """The values on the device; None if there are none."""
        return self._there(values) if values.size else None

    def _there(self, values):
        return torch.as_tensor(values, device=self.device)

    def _per_point(self, values, J):
        """A law's result (e * g, ...) as (e, g, ...)."""
        return self._there(values).reshape(*J.shape, *values.shape[1:])

    def _constant(self, array):
        """A constant array, copied to the device once; it is kept so that no other array can get its identity."""
        if id(array) not in self._kept:
            self._kept[id(array)] = array, self._there(array)
        return self._kept[id(array)][1]


def _back(values):
    return values.cpu().numpy()


def _kinematics(G, u):
    """F (e, g, 3, 3), C (e * g, 6) and J (e, g) from gradients (e, g, 3, m) and displacements (e, m, 3)."""
    F = torch.einsum("egjm,emi->egij", G, u) + torch.eye(3, dtype=G.dtype, device=G.device)
    C = F.mT @ F
    x, y, z = F.unbind(-2)
    J = (x * torch.linalg.cross(y, z, dim=-1)).sum(-1)
    return F, C[..., _ROW, _COL].flatten(0, 1), J


def _inverse_of_c(F):
    """C^-1 (e, g, 3, 3) from the cofactors of F."""
    x, y, z = F.unbind(-2)
    cofactors = torch.stack([torch.linalg.cross(*pair, dim=-1) for pair in ((y, z), (z, x), (x, y))], dim=-2)
    inverse = cofactors / (x * cofactors[..., 0, :]).sum(-1)[..., None, None]     # F^-T
    return inverse.mT @ inverse


def _stress(w, stress, pj, inverse):
    """Second Piola-Kirchhoff stress (e, g, 3, 3) times the points' volumes."""
    return w[..., None, None] * (stress[..., _VOIGT] + pj[..., None, None] * inverse)


def _forces(F, J, G, w, stress, pressure):
    """Nodal forces (e, 3 m)."""
    P = F @ _stress(w, stress, pressure * J, _inverse_of_c(F))
    return torch.einsum("egij,egjm->emi", P, G).flatten(1)


def _moduli(F, w, stress, moduli, pj, local):
    """A (e, g, i, k, j, l) = F_ip F_jq D_pkql + delta_ij S_kl, times the points' volumes, and C^-1 (e, g, 3, 3)."""
    inverse = _inverse_of_c(F)
    S, rows = _stress(w, stress, pj, inverse), torch.tensor(_VOIGT, device=F.device)
    D = moduli[..., rows[:, :, None, None], rows[None, None, :, :]]
    D = D + (pj + local)[..., None, None, None, None] * torch.einsum("egij,egpq->egijpq", inverse, inverse)
    crossed = torch.einsum("egip,egjq->egijpq", inverse, inverse) + torch.einsum("egiq,egjp->egijpq", inverse, inverse)
    D = w[..., None, None, None, None] * (D - pj[..., None, None, None, None] * crossed)
    A = torch.einsum("egip,egpkql,egjq->egikjl", F, D, F)
    return A + torch.einsum("ij,egkl->egikjl", torch.eye(3, dtype=F.dtype, device=F.device), S), inverse


def _products(A, G):
    """K (e, 3 m, 3 m): the sum over points of G_ka A_ikjl G_lb."""
    elements, points, _, nodes = G.shape
    right = torch.einsum("egikjl,eglb->egkijb", A, G).reshape(elements, 3 * points, 9 * nodes)
    K = G.reshape(elements, 3 * points, nodes).mT @ right
    return K.reshape(elements, nodes, 3, 3, nodes).permute(0, 1, 2, 4, 3).reshape(elements, 3 * nodes, 3 * nodes)


def _volumetric(change, basis, gram_inverse, w, stiffness, quartic):
    """The volumetric part of K, see `kernels._add_volumetric`; change (e, g, 3 m): derivatives of the points' volumes.

    stiffness: U'', a number or at the points (e, g);  quartic: (e, g), or None
    """
    seen = basis.T @ change
    projected, measured = gram_inverse @ seen, w[..., None] * basis
    if isinstance(stiffness, torch.Tensor):
        stiff = (measured.mT @ (stiffness[..., None] * basis)) @ projected
    else:
        stiff = stiffness * seen
    if quartic is None:
        return projected.mT @ stiff
    weighted = quartic[..., None] * basis
    half = 0.5 * (stiff + (measured.mT @ weighted) @ projected) - weighted.mT @ change
    return torch.cat([projected, half], dim=1).mT @ torch.cat([half, projected], dim=1)

