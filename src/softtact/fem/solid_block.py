"""A block of elements of one material: energy, internal force and tangent at finite strain.

The law's volumetric energy U(J), with the modulus K - k, depends on J only through its projection on functions in each element:
linear ones (four modes: discontinuous linear pressure) or trilinear ones (eight). The pressure is not an additional unknown, and
the tangent is symmetric (Sussman and Bathe, Computers & Structures 26 (1987) 357). With linear functions the element does not
lock for any bulk modulus (Q2/P-1 is stable); trilinear ones are not stable in this sense, and are 1 to 3 % stiffer at K = 20 mu.

Volume changes outside the projection are resisted only by the shear stiffness. At pressures of several mu that is not enough:
elements collapse to J = 0.1, and no further step converges. Frusta under sharp or deep objects reach such pressures.
Two penalties prevent this:
* k/4 (J^2 - 1 - 2 ln J) acts on J at every point; alone it is the volumetric law of a material of Poisson's ratio 0.38 for
  k = 4 mu, far from locking.
* q/4 (J - its projection)^4 vanishes for small deviations, which are discretisation errors, and limits large ones: an element
  that buckles finds a new equilibrium nearby instead of collapsing.
Their effects and cost: docs/notebook/2026-11-23-folding-frusta.md.

Frusta need full quadrature (27 points): with 8 points spurious modes soften them once they fold (13 % more compression
at 0.4 MPa) and Newton's method stalls.
"""

import copy
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softtact.fem import kernels
from softtact.fem.elements import HEX20, HEX27, WEDGE18, reference_gradients
from softtact.fem.kernels import ElementArrays, VolumePenalties, VolumeResponse, add_penalties, project
from softtact.linalg.workers import SERIAL, Workers, slices, unique_rows
from softtact.materials.inelastic import PointHistory
from softtact.materials.laws.base import IsochoricResponse, Law
from softtact.materials.laws.stretches import stretch_range

_NONE = np.zeros((0, 0))
_POINTS_AT_ONCE = 20_000     # points at which a thread evaluates a law at once
_AT_ONCE = 400   # elements evaluated at once, so that their fields mostly fit into the processor's cache


@dataclass(frozen=True)
class BlockState:
    """The result of one evaluation: the elements' energies (e,) in mJ, forces (e, 3 m) in N, and displacement."""

    energies: np.ndarray
    force: np.ndarray
    displacement: np.ndarray

    @property
    def energy(self) -> float:
        """Energy of all elements in mJ."""
        return float(self.energies.sum())


class SolidBlock:
    """Elements of one kind and one law, by their shape functions' gradients.

    gradients (u, g, m, 3) in 1/mm and volumes (u, g) in mm3 of the u different shapes; shapes (e,): each element's index among
    them, by default a different one for each; basis (g, p): functions on which the volume change is projected (`pressure_modes`);
    unprojected_penalty_ratio: k / mu; quartic_penalty_ratio: q / mu.
    Displacements are given per element (e, m, 3) in mm. at_rest: the arrays as `ElementArrays`. loops: the implementation of the
    sums over points and nodes, `kernels` or `WarpKernels`. history: what the points of an inelastic law remember; without one
    the law is that of first loading.
    """

    loops = kernels

    def __init__(self, gradients: np.ndarray, volumes: np.ndarray, basis: np.ndarray, law: Law, *,
                 shapes: np.ndarray | None = None, unprojected_penalty_ratio: float = 0.0,
                 quartic_penalty_ratio: float = 0.0) -> None:
        self.law = law
        self._unprojected_penalty_ratio, self._quartic_penalty_ratio = unprojected_penalty_ratio, quartic_penalty_ratio
        volumes, basis = np.ascontiguousarray(volumes), np.ascontiguousarray(basis)
        gram = np.einsum("eg,gp,gq->epq", volumes, basis, basis, optimize=True)
        self.at_rest = ElementArrays(np.ascontiguousarray(gradients.transpose(0, 1, 3, 2)), volumes,
                                     np.arange(len(gradients)) if shapes is None else shapes, basis, np.linalg.inv(gram))

    @property
    def unprojected_modulus(self) -> float:
        """k in MPa."""
        return min(self._unprojected_penalty_ratio * self.law.mu0, self.law.projected_modulus)

    @property
    def quartic_modulus(self) -> float:
        """q in MPa."""
        return self._quartic_penalty_ratio * self.law.mu0

    @cached_property
    def _volume_law(self):
        """The law's U with the modulus K - k, and the penalties."""
        penalties = VolumePenalties(self.unprojected_modulus, self.quartic_modulus)
        return self.law.volumetric.with_modulus(self.law.projected_modulus - penalties.unprojected), penalties

    def isochoric(self, C6: np.ndarray, *, tangent: bool, history: PointHistory | None = None) -> IsochoricResponse:
        """The law's response at points with C6 (n, 6), with what they remember."""
        elastic = self.law.isochoric(C6, tangent=tangent)
        return elastic if history is None else self.law.inelastic.response(history, elastic, C6)    # type: ignore[union-attr]

    def evaluate(self, displacement: np.ndarray, elements: np.ndarray | slice = slice(None), *,
                 workers: Workers = SERIAL, history: PointHistory | None = None) -> BlockState | None:
        """Energies and internal forces of the chosen elements; None if one is inverted (J <= 0 at a quadrature point).

        history: of all points of the block
        """
        shapes, history = self.at_rest.shapes[elements], self._of(history, elements)
        parts = workers.map(lambda part: self._evaluate(displacement[part], self.at_rest._replace(shapes=shapes[part]),
                                                        self._of(history, part)),
                            slices(len(shapes), _AT_ONCE))
        if any(part is None for part in parts):
            return None
        energies, forces = zip(*parts, strict=True)
        return BlockState(energies=np.concatenate(energies), force=np.concatenate(forces), displacement=displacement)

    def _of(self, history, elements):
        return None if history is None else history.part(elements, self.at_rest.gradients.shape[1])

    def _evaluate(self, displacement, at_rest, history):
        deformed = self.loops.deformation(displacement, at_rest)
        if not deformed.J.min() > 0:
            return None
        response, volume = self.isochoric(deformed.C, tangent=False, history=history), self._volumetric(deformed.J, at_rest)
        if volume is None:
            return None
        energies = (at_rest.volumes[at_rest.shapes] * response.energy.reshape(deformed.J.shape)).sum(axis=1) + volume.energies
        return energies, self.loops.internal_force(deformed, at_rest, response.stress, volume.pressure)

    def tangent(self, displacement: np.ndarray, elements: np.ndarray | slice = slice(None), *,
                precision: type[np.floating] = np.float64, history: PointHistory | None = None) -> np.ndarray:
        """Tangent (e, 3 m, 3 m) in N/mm of the chosen elements, whose displacement (e, m, 3) is given.

        precision: float32 takes two thirds of the time, for steps that are corrected by a residual in double precision
        history: of all points of the block
        """
        at_rest = self.at_rest._replace(shapes=self.at_rest.shapes[elements])
        deformed = self.loops.deformation(displacement, at_rest)
        history = self._of(history, elements)
        response, volume = self.isochoric(deformed.C, tangent=True, history=history), self._volumetric(deformed.J, at_rest)
        return self.loops.tangent(deformed, at_rest, response.stress, response.tangent, volume,     # type: ignore[arg-type]
                                  np.empty(0, precision))

    def add_tangent(self, values: np.ndarray, positions: np.ndarray, displacement: np.ndarray, *,
                    workers: Workers = SERIAL, history: PointHistory | None = None) -> None:
        """Add the tangent of all elements to a matrix's values, see `assembly.add_upper`; only with loops that sum on a device."""
        deformed = self.loops.deformation(displacement, self.at_rest)
        parts = workers.map(lambda part: self.isochoric(deformed.C[part], tangent=True,
                                                        history=history and history.part(part, 1)),
                            slices(len(deformed.C), _POINTS_AT_ONCE))
        stress, moduli = (np.concatenate([getattr(part, name) for part in parts]) for name in ("stress", "tangent"))
        volume = self._volumetric(deformed.J, self.at_rest)
        self.loops.add_tangent(values, positions, deformed, self.at_rest, stress, moduli, volume)     # type: ignore[attr-defined]

    def never_loaded(self) -> PointHistory | None:
        """The history of all points before any load; None for an elastic law."""
        inelastic, points = self.law.inelastic, len(self.at_rest.shapes) * self.at_rest.gradients.shape[1]
        return None if inelastic is None else inelastic.at_rest(points)

    def history_after(self, history: PointHistory | None, displacement: np.ndarray, seconds: float) -> PointHistory | None:
        """The history at the end of an increment with displacement (e, m, 3) in mm, from which one of `seconds` begins."""
        if history is None:
            return None
        elastic = self.law.isochoric(self.loops.deformation(displacement, self.at_rest).C, tangent=False)
        return self.law.inelastic.after(history, elastic, seconds)      # type: ignore[union-attr]

    @property
    def volume(self) -> float:
        """Volume of all elements in mm3."""
        return float(self.at_rest.volumes.sum(axis=1)[self.at_rest.shapes].sum())

    def volume_outside(self, displacement: np.ndarray, window: tuple[float, float]) -> float:
        """Volume (mm3) in which a principal stretch is outside of `window` (lowest, highest): the isochoric stretch, or the total
        one for a law of foams.
        """
        low, high = stretch_range(self.loops.deformation(displacement, self.at_rest).C, isochoric=self.law.projected_modulus > 0)
        return float(self.at_rest.volumes[self.at_rest.shapes].ravel() @ ((low < window[0]) | (high > window[1])))

    def _volumetric(self, J, at_rest):
        """`VolumeResponse` of elements with volume ratios J (e, g); None where U does not exist at a projected J."""
        projected, penalties = self._volume_law
        seen = project(J - 1.0, at_rest)
        if not projected.linear and not seen.min() > projected.least_change:
            return None
        # U' at the projected J; unless U' is linear in J, only its projection contributes to the nodal forces.
        pressure = projected.pressure(seen) if projected.linear else project(projected.pressure(seen), at_rest)
        energies, quartic = add_penalties(J, at_rest, seen, projected.energy(seen), pressure, penalties)
        stiffness = _NONE if projected.linear else projected.stiffness(seen)
        return VolumeResponse(energies, pressure, projected.bulk_modulus, stiffness, penalties.unprojected, quartic)


def joined(parts: Iterable[tuple[np.ndarray, SolidBlock]]) -> list[tuple[np.ndarray, SolidBlock]]:
    """The elements merged into one block for each kind; parts and result: [(nodes (e, m), block)].

    A kind is a law with a number of nodes and of points; the original blocks then use views of the merged blocks' arrays.
    """
    kinds: dict[tuple, list[tuple[np.ndarray, SolidBlock]]] = {}
    for nodes, block in parts:
        kinds.setdefault((id(block.law), type(block), *block.at_rest.gradients.shape[1:]), []).append((nodes, block))
    return [(np.vstack([nodes for nodes, _ in alike]), _joined_block([block for _, block in alike])) for alike in kinds.values()]


def _joined_block(blocks):
    whole, first = copy.copy(blocks[0]), np.cumsum([0, *(len(block.at_rest.gradients) for block in blocks)])
    arrays = {name: np.concatenate([getattr(block.at_rest, name) for block in blocks])
              for name in ("gradients", "volumes", "gram_inverse")}
    whole.at_rest = whole.at_rest._replace(
        shapes=np.concatenate([block.at_rest.shapes + start for block, start in zip(blocks, first, strict=False)]), **arrays)
    for k, block in enumerate(blocks):
        block.at_rest = block.at_rest._replace(**{name: values[first[k]:first[k + 1]] for name, values in arrays.items()})
    return whole


def pressure_modes(points: np.ndarray, trilinear: bool = False) -> np.ndarray:
    """Functions of the pressure at parent points (g, 3): (g, 4), or (g, 8) if trilinear."""
    linear = np.column_stack([np.ones(len(points)), points])
    if not trilinear:
        return linear
    x, y, z = points.T
    return np.column_stack([linear, x * y, y * z, z * x, x * y * z])


def _unlike(coordinates):
    """One element (u,) of each different shape among coordinates (e, m, 3), and the index (e,) of each element's shape."""
    return unique_rows((coordinates - coordinates[:, :1]).reshape(len(coordinates), -1))


def _distinct(numbers):
    """The distinct numbers of each row of (r, k) in rising order (r, w), short rows padded with the last; and indices (r, k).

    Negative numbers are ignored and have the index -1.
    """
    order = np.argsort(numbers, axis=1, kind="stable")
    rising = np.take_along_axis(numbers, order, axis=1)
    new = (rising >= 0) & (np.diff(rising, axis=1, prepend=-1) > 0)
    place = np.cumsum(new, axis=1) - 1
    rows, _ = np.nonzero(new)
    found = np.full((len(numbers), place.max() + 1), -1, dtype=numbers.dtype)
    found[rows, place[new]] = rising[new]
    back = np.empty_like(place)
    np.put_along_axis(back, order, place, axis=1)
    return np.maximum.accumulate(found, axis=1), back


class _ElementBlock(SolidBlock):
    """Elements of a kind at coordinates (e, m, 3) in mm, with full or reduced quadrature, or with another rule.

    trilinear: the volume change is projected on trilinear instead of linear functions
    """

    def __init__(self, element, coordinates, law, *, reduced=False, rule=None, trilinear=False, **options):
        rule, (first, shapes) = rule or (element.reduced if reduced else element.quadrature), _unlike(coordinates)
        gradients, volumes = reference_gradients(coordinates[first], element.shape(rule.points)[1], rule.weights)
        super().__init__(gradients, volumes, pressure_modes(rule.points, trilinear), law, shapes=shapes, **options)


class HexBlock(_ElementBlock):
    """Hexahedra HEX20 or HEX27 given by coordinates (e, 20 or 27, 3) in mm; options as `SolidBlock` has them.

    reduced: 2 x 2 x 2 points instead of 3 x 3 x 3;  rule: another `Quadrature`;  trilinear: functions of the pressure
    """

    def __init__(self, coordinates: np.ndarray, law: Law, **options: Any) -> None:
        super().__init__({20: HEX20, 27: HEX27}[coordinates.shape[1]], coordinates, law, **options)


class WedgeBlock(_ElementBlock):
    """Wedges WEDGE18 given by coordinates (e, 18, 3) in mm; options as `SolidBlock` has them."""

    def __init__(self, coordinates: np.ndarray, law: Law, **options: Any) -> None:
        super().__init__(WEDGE18, coordinates, law, **options)


def hanging_node_constraints(masters: np.ndarray, weights: np.ndarray, elements: np.ndarray,
                             block: SolidBlock) -> tuple[np.ndarray, SolidBlock]:
    """Master nodes (e, w) of elements (e, m) with hanging nodes, and the block with shape functions of the masters."""
    masters, weights = masters[elements], weights[elements]
    nodes, column = _distinct(np.where(np.abs(weights) > 1e-12, masters, -1).reshape(len(elements), -1))
    follow = np.zeros((*elements.shape, nodes.shape[1]))
    element, node, _ = np.indices(masters.shape, sparse=True)     # type: ignore[misc]
    column, used = column.reshape(masters.shape), column.reshape(masters.shape) >= 0
    np.add.at(follow, tuple(np.broadcast_to(index, masters.shape)[used] for index in (element, node, column)), weights[used])
    at_rest = block.at_rest
    table = np.hstack([at_rest.shapes[:, None], follow.reshape(len(follow), -1)])
    first, shapes = unique_rows(table)
    shape = table[first, 0].astype(int)
    gradients = np.ascontiguousarray(np.einsum("egdm,emw->egdw", at_rest.gradients[shape], follow[first], optimize=True))
    block.at_rest = at_rest._replace(gradients=gradients, volumes=at_rest.volumes[shape], shapes=shapes,
                                     gram_inverse=at_rest.gram_inverse[shape])
    return nodes, block
