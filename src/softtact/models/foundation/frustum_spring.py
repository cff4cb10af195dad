"""Force of one frustum on the sheet: its unit cell's nonlinear law of compression, and its linear stiffness otherwise.

The cell is the hyperelastic one, for any law and geometry, with board, folding sides and neighbours. In the stiffness K of the
root's nodes (tip fixed, at rest) the part against a uniform descent is replaced by the cell's force:
    K 1 = k b,  1.b = 1:    forces on the root = (K - k b b') u + b p(w),   w = b.u
So the frustum resists small displacements of any kind by its linear stiffness, and a compression w by the cell's force p(w).
If the root moves sideways, a tip that is only fixed in the board's plane would tilt. A moment from the board keeps it flat; it is
limited by the tip's force: beyond the limit, the frustum rocks on its tip's rim and lifts the root (`FrustumLaw.rise`).
The meshes of root and slab do not match. The root's nodes follow weighted means of the slab's displacement, so that the root's
forces act on the slab as the traction with these nodal forces (mortar coupling; Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989).
A tie at single points would apply point loads, whose displacements grow without bound as the slab's elements are refined.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError
from softtact.fem.elements import HEX27, QUAD9
from softtact.fem.quadrature import gauss
from softtact.files import read_arrays
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.mesh_settings import MeshSettings, NewtonSettings
from softtact.models.newton import solve
from softtact.sensors.frusta import SensorSpec

if TYPE_CHECKING:
    from softtact.models.hyperelastic.frusta import FrustumArray
    from softtact.models.hyperelastic.states import SupportState

_STEP_MM = 0.01        # largest movement of the root at once
_TOLERANCE_N = 1e-7    # of the inner forces; forces on the root are about 1e-2 N
_ITERATIONS = 40
_FIRST_N, _LEVELS_A_DECADE = 2e-3, 9
_MORTAR_POINTS = 10      # along a side of a root's face: dense enough for elements of a tenth of a pitch
_MOVEMENT, _TILT, _LATERAL_LEVELS = 0.25, 0.1, 16   # of the height; about what 50 N do beside a punch's edge
_PRESSURE_MPA = 2.0      # largest pressure on the cell: about five times that of 50 N on a flat punch of 11 mm


class SingleFrustum:
    """The only frustum of a `FrustumArray`, first at rest; each `move` continues from the last state."""

    def __init__(self, support: "FrustumArray") -> None:
        self.support, self._displacement, self._place = support, np.zeros((1, support.nodes, 3)), np.zeros(3)
        self._x = support.coordinates[0][support.root, 0] - support.geometry.centres[0][0]

    def move(self, movement: float, tilt: float, descent: float) -> np.ndarray | None:
        """Reaction force and moment (2,) of the root in N and N mm along x, at a displacement, a tilt along x and a descent (mm).

        None if a step does not converge, and for all later calls.
        """
        target = np.array([movement, tilt, descent])
        far = np.abs((target - self._place) * [1.0, self._x.max(), 1.0]).max()
        count = max(1, int(np.ceil(far / _STEP_MM)))
        for place in self._place + np.linspace(0, 1, count + 1)[1:, None] * (target - self._place):
            if self._displacement is None:
                return None
            self._step(place)
        return None if self._displacement is None else self._forces()

    def _step(self, place):
        """Move the root, predict the inner nodes by the tangent, and find the equilibrium."""
        root = np.zeros((len(self._x), 3))
        root[:, 0], root[:, 2] = place[0], place[1] * self._x - place[2]
        move = (root - self._displacement[0, self.support.root]).reshape(1, -1)
        trial = self._displacement + self._newton_step(self.support.evaluate(self._displacement), move)
        self._displacement, self._place = self._settled(trial), place

    def _newton_step(self, state, move):
        self.support.condense(state, np.array([0]))
        _, forward_solved = self.support.condensed_residual(state)
        return self.support.inner_step(forward_solved, move)

    def _settled(self, displacement):
        """Displacements (1, nodes, 3) in equilibrium with a fixed root; None if Newton's method does not converge."""
        state = self.support.evaluate(displacement)
        found = None if state is None else solve(self, state, max_iterations=_ITERATIONS).state
        return None if found is None else found.displacement

    # The frustum with a fixed root as a `Problem` of Newton's method.

    def prepared(self, state: "SupportState", iteration: int) -> "SupportState":
        return state

    def residual(self, state: "SupportState") -> float:
        return np.abs(self.support.inner_residual(state)).max()

    def balanced(self, state: "SupportState", residual: float) -> bool:
        return residual <= _TOLERANCE_N

    def step(self, state: "SupportState") -> "tuple[SupportState, np.ndarray]":
        return state, self._newton_step(state, np.zeros((1, 3 * len(self._x))))

    def first_share(self, step: np.ndarray) -> float:
        return 1.0

    def moved(self, state: "SupportState", step: np.ndarray, share: float) -> "SupportState | None":
        return self.support.evaluate(state.displacement + share * step)

    def better(self, trial: "SupportState", state: "SupportState", residual: float) -> bool:
        return trial.energy < state.energy or self.residual(trial) < residual

    def accepted(self, state: "SupportState", trial: "SupportState") -> None:
        """Nothing is kept from one step to the next."""

    def recovered(self, state: "SupportState") -> bool:
        return False

    def _forces(self):
        force = self.support.evaluate(self._displacement).force[0, self.support.root]
        return np.array([force[:, 0].sum(), force[:, 2] @ self._x])


@dataclass(frozen=True)
class FrustumLaw:
    """force_n (f,) of one frustum at compressions compression_mm (f,), both from 0 on; extrapolated with the last slope.

    root_xy (s, 2) in mm: points of the root about the axis;  spread (m, s): displacements of the root's nodes from those there
    rest (3 m, 3 m) in N/mm: linear stiffness except against compression;  descent (3 m,): b
    lateral (4, 3 m): displacement (mm) and tilt of the root along x, then along y, from its nodes' displacements
    stiffness (g, 3): at compressions lateral_at_mm (g,), of displacement (N/mm), coupling to tilt (N), of tilt (N mm)
    lean in 1/mm: tilt of a free tip per lateral displacement of the root;  upright in N mm: stiffness of the tip against tilt
    tip_radius_mm: of the rim on which a frustum rocks
    """

    force_n: np.ndarray
    compression_mm: np.ndarray
    root_xy: np.ndarray
    spread: np.ndarray
    rest: np.ndarray
    descent: np.ndarray
    lateral: np.ndarray
    lateral_at_mm: np.ndarray
    stiffness: np.ndarray
    lean: float
    upright: float
    tip_radius_mm: float

    @cached_property
    def _curve(self):
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.force_n, self.compression_mm)

    @cached_property
    def _curve_slope(self):
        return self._curve.derivative()

    @property
    def limit_mm(self) -> float:
        """Largest compression that the cell reached."""
        return float(self.compression_mm[-1])

    def extension(self, force: np.ndarray) -> np.ndarray:
        """Compression in mm under forces >= 0 in N, of any shape."""
        inside = np.minimum(force, self.force_n[-1])
        return self._curve(inside) + self._last_slope * (force - inside)

    def slope(self, force: np.ndarray) -> np.ndarray:
        """Derivative of `extension` in mm/N."""
        return np.where(force < self.force_n[-1], self._curve_slope(np.minimum(force, self.force_n[-1])), self._last_slope)

    def rise(self, sideways: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Lift in mm of roots at lateral displacements `sideways` (mm) by frusta that rock under forces >= 0 (N).

        A rigid tip of radius e on a board without tension: its moment is at most e times the force. The tilt in excess of the
        one that this moment prevents rotates the tip about its rim.
        """
        return self.tip_radius_mm * np.maximum(self.lean * sideways - self.tip_radius_mm * force / self.upright, 0.0)

    def rocking_compliance(self, rise: np.ndarray) -> np.ndarray:
        """By how much `rise` falls with the force, in mm/N, where it is positive, else 0."""
        return np.where(rise > 0, self.tip_radius_mm**2 / self.upright, 0.0)

    def rise_rate(self, sideways: np.ndarray, force: np.ndarray, sideways_rate: np.ndarray, force_rate: np.ndarray) -> np.ndarray:
        """Rate of `rise` from those of its arguments."""
        rate = self.tip_radius_mm * (self.lean * sideways_rate - self.tip_radius_mm * force_rate / self.upright)
        return np.where(self.rise(sideways, force) > 0, rate, 0.0)

    def stiffening(self, force: np.ndarray) -> tuple[np.ndarray, ...]:
        """Additional stiffness (b, 2, 2) of (displacement, tilt) of frusta under forces (b,) in N relative to rest, and its
        derivative by their compression, per mm.
        """
        place = np.clip(self.extension(force), 0.0, self.lateral_at_mm[-1])
        growth = np.where((place < self.lateral_at_mm[-1])[:, None], self._stiffness_slope(place), 0.0)
        more = self._stiffness(place) - self.stiffness[0]
        return tuple(values[:, [0, 1, 1, 2]].reshape(-1, 2, 2) for values in (more, growth))

    def stiffening_rate(self, force: np.ndarray) -> np.ndarray:
        """Derivative (b, 2, 2) by the compression of the second part of `stiffening`, per mm2."""
        place = np.clip(self.extension(force), 0.0, self.lateral_at_mm[-1])
        curving = np.where((place < self.lateral_at_mm[-1])[:, None], self._stiffness.derivative(2)(place), 0.0)
        return curving[:, [0, 1, 1, 2]].reshape(-1, 2, 2)

    @cached_property
    def _stiffness(self):
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.lateral_at_mm, self.stiffness)

    @cached_property
    def _stiffness_slope(self):
        return self._stiffness.derivative()

    @cached_property
    def _last_slope(self):
        return float(self._curve_slope(self.force_n[-1]))

    def save(self, path: Path) -> None:
        """Write as a NumPy archive."""
        np.savez(path, **self.arrays())

    @classmethod
    def load(cls, path: Path) -> "FrustumLaw":
        """Read what `save` wrote."""
        with read_arrays(path) as data:
            values: dict[str, Any] = dict(data)
            return cls(**values)

    def arrays(self) -> dict[str, Any]:
        """All fields by name, to be saved."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def frustum_law(spec: SensorSpec, law: Law, *, mesh: MeshSettings | None = None, pressure_mpa: float = _PRESSURE_MPA) -> FrustumLaw:
    """The `FrustumLaw` of a sensor's frusta with a hyperelastic law, from its unit cell up to a pressure, or until it fails.

    mesh: `MeshSettings` of the cell; by default frusta of two rings (of one ring: 2 % too stiff)
    """
    from softtact.models.hyperelastic.build import build_unit_cell  # not loaded for a law that is kept

    body = build_unit_cell(spec, dielectric_law=law, mesh=mesh or MeshSettings(frustum_rings=2))
    support = body.support
    root_xy, spread, mass = _root_mortar(support)
    stiffness = _root_stiffness(support)
    straight: np.ndarray = np.zeros((len(spread), 3))
    straight[:, 2] = 1.0
    straight = straight.ravel()
    along = stiffness @ straight
    k = float(straight @ along)
    descent = along / k
    lean, upright, radius = _tip(support)
    lateral = _lateral(support, mass)
    force, compression = _cell_curve(spec, body, descent, pressure_mpa * spec.dielectric.frusta.pitch_mm**2)
    at, stiffer = _lateral_stiffness(support, compression[-1])
    body.close()
    return FrustumLaw(force_n=force, compression_mm=compression, root_xy=root_xy, spread=spread, descent=descent, lateral=lateral,
                      lateral_at_mm=at, stiffness=stiffer, rest=stiffness - k * np.outer(descent, descent), lean=lean,
                      upright=upright, tip_radius_mm=radius)


def _root_mortar(support):
    """Points (s, 2) of a frustum's root about its axis, and weights (m, s) from a field there to values at the root's nodes.

    The values are the L2 projection of the field on the root's quadratic shape functions.
    """
    place = np.full(support.nodes, -1)
    place[support.root] = np.arange(len(support.root))
    faces = place[support.mesh.layer(support.mesh.layers - 1)[:, HEX27.top]]
    xy = (support.coordinates[0][support.root, :2] - support.geometry.centres[0])[faces]
    points, weights = gauss(_MORTAR_POINTS, 2)
    values, slopes = QUAD9.shape(points)
    areas = weights * np.linalg.det(np.einsum("gad,fai->fgid", slopes, xy))
    mass, products = np.zeros((len(support.root),) * 2), np.zeros((len(support.root), *areas.shape))
    for f, (face, area) in enumerate(zip(faces, areas, strict=True)):
        mass[np.ix_(face, face)] += values.T @ (area[:, None] * values)
        products[face, f] = values.T * area
    return np.einsum("ga,fai->fgi", values, xy).reshape(-1, 2), np.linalg.solve(mass, products.reshape(len(mass), -1)), mass


def _root_stiffness(support):
    """Stiffness (3 m, 3 m) of a frustum's root nodes at rest, with the tip fixed on the board."""
    return _condensed(_stiffness_at_rest(support), np.setdiff1d(support.inner, 3 * support.tip + 2), support.root_dofs)


def _stiffness_at_rest(support):
    """Stiffness (3 n, 3 n) of all of a frustum's nodes."""
    tangents = support.block.tangent(support.per_element(np.zeros((1, support.nodes, 3))))
    stiffness = np.zeros((3 * support.nodes,) * 2)
    for element, nodes in zip(tangents, support.mesh.hexes, strict=True):
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        stiffness[np.ix_(dofs, dofs)] += element
    return stiffness


def _condensed(stiffness, inner, outer):
    """Stiffness of the unknowns `outer` after static condensation of `inner`."""
    coupling = stiffness[np.ix_(inner, outer)]
    return stiffness[np.ix_(outer, outer)] - coupling.T @ np.linalg.solve(stiffness[np.ix_(inner, inner)], coupling)


def _tip(support):
    """Tilt of a free tip per lateral displacement of the root (1/mm), its stiffness against tilt (N mm), and its radius (mm).

    For vertical displacements z = x of the tip: the moment is work-conjugate to the tilt of a plane tip.
    """
    x = support.coordinates[0][support.tip, 0] - support.geometry.centres[0][0]
    vertical = 3 * support.tip + 2
    inner = np.setdiff1d(support.inner, vertical)
    kept = np.concatenate([vertical, support.root_dofs])
    stiffness = _condensed(_stiffness_at_rest(support), inner, kept)
    sideways = np.tile([1.0, 0.0, 0.0], len(support.root))
    tips = len(support.tip)
    free = -np.linalg.solve(stiffness[:tips, :tips], stiffness[:tips, tips:] @ sideways)
    return float(abs(free @ x) / (x @ x)), float(x @ stiffness[:tips, :tips] @ x), float(np.abs(x).max())


def _lateral(support, mass):
    """Displacement and tilt along x, then along y, from a root's nodal displacements (4, 3 m): least-squares fit on its area."""
    xy = support.coordinates[0][support.root, :2] - support.geometry.centres[0]
    rows = []
    for axis, sideways in enumerate(np.eye(3)[:2]):
        for shape, direction in ((np.ones(len(xy)), sideways), (xy[:, axis], np.eye(3)[2])):
            weight = mass @ shape
            rows.append(np.outer(weight / (weight @ shape), direction).ravel())
    return np.array(rows)


def _lateral_stiffness(support, largest_mm):
    """Compressions (g,) in mm, and a root's stiffness (g, 3) there: of displacement, coupling to tilt, and of tilt.

    They are secants for displacements as of a frustum beside an edge, since contacts begin in between. The table ends where a
    frustum cannot be compressed further under a rigid root.
    """
    movement, descents = _MOVEMENT * support.geometry.heights[0], np.linspace(0.0, largest_mm, _LATERAL_LEVELS)
    moved, tilted = ([frustum.move(*place, descent) for descent in descents] for frustum, place in
                     ((SingleFrustum(support), (movement, 0.0)), (SingleFrustum(support), (0.0, _TILT))))
    both = [(*(a / movement), b[1] / _TILT) for a, b in zip(moved, tilted, strict=True) if a is not None and b is not None]
    return descents[:len(both)], np.array(both)


def _cell_curve(spec, body, descent, largest_n):
    """Forces and compressions (f,) of the cell under a plate, from 0 up to `largest_n`, or to the last converged load step."""
    from softtact.models.hyperelastic.path import press_load_steps

    plate = trimesh.creation.box((4 * spec.dielectric.frusta.pitch_mm,) * 2 + (1.0,))
    plate.apply_translation([0, 0, 0.5])
    forces = np.geomspace(_FIRST_N, largest_n, int(np.ceil(_LEVELS_A_DECADE * np.log10(largest_n / _FIRST_N))))
    settings = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.05, smallest_increment_n=1e-3)
    reached = [(0.0, 0.0)]
    try:
        for load_step in press_load_steps(body, HeightField(plate), forces, settings=settings):
            root = load_step.state.support.displacement[0][body.support.root].ravel()
            compression = -float(descent @ root)
            if compression <= reached[-1][1]:
                break
            reached.append((load_step.force_n, compression))
    except ConvergenceError:
        if len(reached) < 10:
            raise
    return tuple(np.array(reached).T)
