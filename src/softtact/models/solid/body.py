"""Soft and rigid bodies on one set of nodes: their potential, what is out of balance, and the tangent.

Unknown are the free displacements u and the loaded freedoms q of the frames. The residual is the derivative of the potential
Pi(u, q) = energy of the regions + those of the items (contacts, frusta, pressures; `items`) - work of loads; the tangent is its
second derivative.
Frames' freedoms border the matrix: their columns are directional derivatives of the residual, taken by a difference. Lengths in mm,
forces in N, pressures in MPa.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from softtact.contact.pair import ContactPair
from softtact.contact.pair_state import PairHistory, PairState
from softtact.devices import find_device
from softtact.errors import ConvergenceError, InputError
from softtact.fem.assembly import SymmetricPattern, add_upper
from softtact.fem.kernels import add_forces
from softtact.fem.solid_block import SolidBlock
from softtact.fem.solid_mesh import SolidMesh
from softtact.linalg.refined import RefinedSolver
from softtact.linalg.workers import Workers, slices
from softtact.materials.inelastic import PointHistory
from softtact.materials.laws.base import Law
from softtact.models.solid.blocks import bodies_of, lift_from_corners, refuse_loose, region_blocks, sum_on
from softtact.models.solid.frames import FramePose, make_frames
from softtact.models.solid.items import FacePressure, Item, ItemState, PressureResponse
from softtact.progress import Watch

_CHUNK = 256  # elements whose dense tangents are in memory at once, for each thread
_COUPLED, _MOST_COUPLED = 1e-6, 60  # relative error and iterations of GMRES
_PROBE = 1e-7  # mm or radians, for derivatives by a frame's freedom
_ROUND_OFF = 8 * np.finfo(float).eps  # of a nodal force, a sum of some tens of terms each known to eps
AXES = "xyz"


@dataclass(frozen=True)
class SolidState:
    """All bodies at given places."""

    displacement: np.ndarray
    """(n, 3) of the nodes in mm, the frames' among them."""
    poses: tuple[FramePose, ...]
    """Of the frames."""
    items: tuple[ItemState, ...]
    """History and response of each item."""
    force: np.ndarray
    """(n, 3) in N: derivative of the potential by the nodes' places; at held nodes what holds them."""
    energy: float
    """In mJ: of regions and frusta, and the penalties."""
    strain_energy: float
    """In mJ: of regions and frusta; of a law that softens or relaxes, the potential of the increment."""
    size: float
    """In N: sum of what presses and holds, the scale of the residual."""
    memories: tuple[PointHistory | None, ...] = ()
    """Of each block of elements: what its points remember as the increment began; None where the law is elastic."""

    @property
    def item_histories(self) -> tuple[Any, ...]:
        """The history of each item."""
        return tuple(item.history for item in self.items)

    @property
    def histories(self) -> tuple[PairHistory, ...]:
        """Histories of the pairs in contact."""
        return tuple(item.history for item in self.items if isinstance(item.history, PairHistory))

    @property
    def contacts(self) -> tuple[PairState, ...]:
        """Contact of the pairs."""
        return tuple(item.response for item in self.items if isinstance(item.response, PairState))

    @property
    def pressures(self) -> np.ndarray:
        """(f,) in MPa on the faces under pressure."""
        return np.array([item.response.pressure for item in self.items if isinstance(item.response, PressureResponse)])


class SolidBody:
    """Meshed bodies with laws, held faces, frames, contacts and pressures.

    mesh: all soft bodies;  laws: by region;  held {face: axes such as "xyz"};  carried {frame: (reference point, faces[, axes])}:
    faces that a rigid frame moves, along axes such as "z" alone;  rigid {frame: (reference point, triangles' corners (t, 3, 3))}:
    rigid objects on further nodes;  device: where spatial elements are summed up: `cpu`, `warp` (Warp's kernels on the processor),
    `cuda`, or `auto`: a GPU where there is one
    """

    def __init__(
        self,
        mesh: SolidMesh,
        laws: Mapping[str, Law],
        *,
        held: Mapping[str, str] | None = None,
        carried: Mapping[str, tuple] | None = None,
        rigid: Mapping[str, tuple[Sequence[float], np.ndarray]] | None = None,
        threads: int = 1,
        device: str = "cpu",
    ) -> None:
        self.mesh, self.laws = mesh, dict(laws)
        self.blocks = region_blocks(mesh, laws)
        if (where := find_device(device, library="warp")) != "cpu":
            sum_on(self.blocks, where)
        self.workers, self.watch = Workers(threads), Watch()
        # What rounding hides of the energy is in proportion to modulus times volume, however small the strain.
        self.energy_noise = 3e-4 * sum(block.law.mu0 * block.volume for _, _, block in self.blocks)
        self.points, self.frames, self._surfaces = make_frames(mesh, carried or {}, rigid or {})
        self.free_components = self._free(held or {})
        self.free = np.flatnonzero(self.free_components.ravel())
        self.items: list[Item] = []
        self._held_faces = list(held or {})
        lift = lift_from_corners(mesh, laws, self.free)
        self.solver = RefinedSolver(self.points[self.free // 3], lift=lift, workers=self.workers)
        self._pattern: SymmetricPattern | None = None
        self._known_pairs: set[tuple[int, int]] = set()

    def _free(self, held):
        free, n = np.zeros(self.points.shape, dtype=bool), len(self.mesh.points)
        for _, nodes, _ in self.blocks:
            free[nodes.ravel()] = True
        if self.mesh.geometry != "solid":
            free[:, 2] = False
        for face, axes in held.items():
            if not axes or set(axes) - set(AXES):
                raise InputError(f"The face {face!r} is held along {axes!r}; name one or more of x, y and z.")
            free[np.ix_(self.mesh.face_nodes(face), [AXES.index(axis) for axis in axes])] = False
        for frame in self.frames:
            free[frame.carried] = False
        free[n:] = False
        return free

    def shifted_with(self, frame: int, translation: np.ndarray) -> np.ndarray:
        """The step (unknowns,) that shifts by (3,) in mm all bodies that this frame carries and nothing else holds."""
        body, carrier = bodies_of(self.mesh), self.frames[frame]
        bound = np.flatnonzero(~self.free_components[: len(body), : 3 if self.mesh.geometry == "solid" else 2].all(axis=1))
        elsewhere = np.setdiff1d(body[np.setdiff1d(bound, carrier.nodes)], -1)
        mine = np.setdiff1d(body[carrier.nodes[carrier.nodes < len(body)]], elsewhere)
        shift = np.zeros_like(self.points)
        shift[: len(body)][np.isin(body, mine)] = translation
        return shift.ravel()[self.free]

    def is_free(self, frame: int) -> bool:
        """Whether a frame carries a rigid object, or soft bodies that nothing else holds: contact alone bears its loads."""
        return bool(self.frames[frame].nodes.min() >= len(self.mesh.points) or self.shifted_with(frame, np.ones(3)).any())

    def surface_nodes(self, frame: str) -> np.ndarray:
        """Facets (t, 3) of a rigid object, in nodes of this body."""
        return self._surfaces[frame]

    def add(self, item: Item) -> None:
        """Let a contact pair, frusta or a pressure act; before the first state is made."""
        self.items.append(item)

    @property
    def pairs(self) -> list[ContactPair]:
        """The items that are contact pairs."""
        return [item for item in self.items if isinstance(item, ContactPair)]

    @property
    def pressures(self) -> list[FacePressure]:
        """The items that are pressures on faces."""
        return [item for item in self.items if isinstance(item, FacePressure)]

    @property
    def frictional(self) -> bool:
        """Whether friction acts somewhere: the balance then has no potential."""
        return any(item.friction for item in self.items)

    @contextmanager
    def frictionless(self) -> Iterator[None]:
        """While this lasts, friction acts nowhere."""
        before = [item.friction for item in self.items]
        for item in self.items:
            item.friction = 0.0
        try:
            yield
        finally:
            for item, friction in zip(self.items, before, strict=True):
                item.friction = friction

    def rest(self) -> SolidState:
        """The state without displacement. Raises InputError where nothing holds a body."""
        supported = np.concatenate([np.zeros(0, dtype=int), *(item.supported_nodes() for item in self.items)])
        refuse_loose(self.mesh, self.free_components, supported, self._held_faces)
        histories = tuple(item.first(self.points) for item in self.items)
        state = self.evaluate(np.zeros_like(self.points), tuple(FramePose() for _ in self.frames), histories)
        assert state is not None
        return state

    def evaluate(
        self,
        displacement: np.ndarray,
        poses: tuple[FramePose, ...],
        histories: tuple[Any, ...],
        before: SolidState | None = None,
        *,
        memories: tuple[PointHistory | None, ...] | None = None,
        nearby: bool = False,
    ) -> SolidState | None:
        """`SolidState` with the frames' nodes where the poses (one a frame) put them; None where an element is inside out.

        histories: of each item;  before: the state that this one follows on, with the same histories;  nearby: see `Item.evaluate`
        memories: of each block, by default those of `before`, and those of a body that was never loaded
        """
        if memories is None:
            memories = before.memories if before else tuple(block.never_loaded() for _, _, block in self.blocks)
        displacement = displacement.copy()
        for frame, pose in zip(self.frames, poses, strict=True):
            axes = ["xyz".index(axis) for axis in frame.axes]
            displacement[frame.carried] = pose.displacement(frame, self.points)[:, axes]
        force, strain_energy, penalty = np.zeros_like(displacement), 0.0, 0.0
        for (_, nodes, block), memory in zip(self.blocks, memories, strict=True):
            state = block.evaluate(displacement[nodes], workers=self.workers, history=memory)
            if state is None:
                return None
            strain_energy += state.energy
            add_forces(force, nodes, state.force.reshape(*nodes.shape, 3))
        size = float(np.abs(force[~self.free_components]).sum())
        x, items = self.points + displacement, []
        for k, (item, history) in enumerate(zip(self.items, histories, strict=True)):
            response = item.evaluate(history, x, None if before is None else before.items[k].response, nearby=nearby)
            item.add_forces(history, response, force)
            totals = item.totals(history, response)
            strain_energy, penalty, size = strain_energy + totals.strain_energy, penalty + totals.penalty, size + totals.size
            items.append(ItemState(history, response))
        return SolidState(displacement, poses, tuple(items), force, strain_energy + penalty, strain_energy, size, memories)

    def with_histories(self, state: SolidState, histories: Iterable[Any],
                       memories: tuple[PointHistory | None, ...] | None = None) -> SolidState:
        """The same places with other histories; every point of contact finds anew which facet it meets.

        memories: of each block, by default those of the state
        """
        memories = state.memories if memories is None else memories
        found = self.evaluate(state.displacement, state.poses, tuple(histories), memories=memories)
        assert found is not None
        return found

    def memories_after(self, state: SolidState, seconds: float) -> tuple[PointHistory | None, ...]:
        """What the points of each block remember of a balanced state, as an increment of so many seconds begins."""
        return tuple(block.history_after(memory, state.displacement[nodes], seconds)
                     for (_, nodes, block), memory in zip(self.blocks, state.memories, strict=True))

    @property
    def shortest_relaxation_s(self) -> float:
        """The shortest relaxation time of its materials in s; infinite where none relaxes."""
        return min((law.inelastic.shortest_s for law in self.laws.values() if law.inelastic), default=np.inf)

    def item_states(self, state: SolidState) -> Iterator[tuple[Item, Any, Any]]:
        """(item, history, response) one after the other."""
        return ((item, *both) for item, both in zip(self.items, state.items, strict=True))

    def moved(
        self,
        state: SolidState,
        step: np.ndarray,
        frame_steps: Sequence[np.ndarray],
        *,
        histories: tuple[Any, ...] | None = None,
        nearby: bool = False,
    ) -> SolidState | None:
        """The state after a step (unknowns,) of the free displacements and steps (6,) of each frame.

        histories: of the items, where they are other than the state's
        """
        displacement = state.displacement.copy()
        displacement.ravel()[self.free] += step
        poses = tuple(pose.moved(moved) for pose, moved in zip(state.poses, frame_steps, strict=True))
        histories = state.item_histories if histories is None else histories
        return self.evaluate(displacement, poses, histories, state, nearby=nearby)

    def residual(self, state: SolidState) -> np.ndarray:
        """Unbalanced forces (unknowns,) in N."""
        return state.force.ravel()[self.free]

    def rounding_n(self, state: SolidState) -> float:
        """Unbalanced force in N that rounding leaves, whatever the loads: no state can be nearer to balance.

        A displacement is known to eps |u| and a gradient F = 1 + du/dx of elements of length h to eps (1 + |u| / h), so a nodal
        force to that times the confined modulus K + 4/3 mu and an element's area.
        """
        farthest, largest = float(np.abs(state.displacement).max(initial=0.0)), 0.0
        for _, nodes, block in self.blocks:
            length = float(self._lengths(nodes).min())
            force = (block.law.bulk_modulus + 4 / 3 * block.law.mu0) * block.volume / len(nodes) / length
            largest = max(largest, force * (1.0 + farthest / length))
        return _ROUND_OFF * largest

    def unresolved_n(self, state: SolidState, penetration_mm: float) -> float:
        """Force in N that its contacts would bear at an overlap of so much wherever they touch: no contact is known better."""
        return sum(item.unresolved_n(history, response, penetration_mm) for item, history, response in self.item_states(state))

    def _lengths(self, nodes: np.ndarray) -> np.ndarray:
        """Least extents (e,) in mm of elements (e, k) along the axes in which they extend."""
        extents = np.ptp(self.points[nodes], axis=1)
        least: np.ndarray = np.where(extents > 0, extents, np.inf).min(axis=1)
        return least

    def frame_loads(self, state: SolidState) -> np.ndarray:
        """(frames, 6) in N and N mm: the loads under which the frames are in balance, about their reference points.

        Of a rigid object that is its force on the bodies that it touches.
        """
        return np.array(
            [pose.loads(frame, self.points, state.force) for frame, pose in zip(self.frames, state.poses, strict=True)]
        ).reshape(-1, 6)

    def border(self, state: SolidState, frame: int, freedom: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the residual (unknowns,) and of all frames' loads (frames, 6) along a direction (6,) of a frame."""
        size = float(np.abs(freedom).max())
        steps = [np.zeros(6) for _ in self.frames]
        steps[frame] = freedom * (_PROBE / size)
        moved = self.moved(state, np.zeros(len(self.free)), steps, nearby=True)
        assert moved is not None
        return (
            (self.residual(moved) - self.residual(state)) * (size / _PROBE),
            (self.frame_loads(moved) - self.frame_loads(state)) * (size / _PROBE),
        )

    def loads_along(self, state: SolidState, step: np.ndarray) -> np.ndarray:
        """Derivative (frames, 6) of the frames' loads along a step (unknowns,) of the free displacements."""
        share = _PROBE / max(float(np.abs(step).max(initial=0.0)), 1e-300)
        moved = self.moved(state, share * step, [np.zeros(6) for _ in self.frames], nearby=True)
        assert moved is not None
        return (self.frame_loads(moved) - self.frame_loads(state)) / share

    def solve(self, state: SolidState, right: np.ndarray, *, turning: bool = True) -> np.ndarray:
        """Solve with the tangent at a state for right-hand sides (unknowns, k), or with one near it that is positive definite.

        Where friction slides, the tangent has a part beside the matrix: GMRES, with the factor as its preconditioner.
        turning: see `tangent`
        """
        slides = any(item.slides(*both) for item, *both in self.item_states(state))
        found = self.solver.solve(self.tangent(state), right, factored=slides) if turning else None
        if found is None:
            found = self._definite(state, right, factored=slides)
        if not slides:
            return found

        def coupling(x):
            change, force = np.zeros(self.points.size), np.zeros_like(self.points)
            change[self.free] = x
            for item, *both in self.item_states(state):
                item.add_coupling(*both, change.reshape(-1, 3), force)
            return force.ravel()[self.free]

        def whole(x):
            return self.solver.product(self._matrix, x) + coupling(x)

        operator = spla.LinearOperator(
            (len(right), len(right)), matvec=lambda y: whole(self.solver.precondition(y)), dtype=float
        )
        for k in range(right.shape[1]):
            size = _COUPLED * float(np.linalg.norm(right[:, k]))
            rest = right[:, k] - whole(found[:, k])
            y, _ = spla.gmres(operator, rest, atol=size, rtol=0.0, restart=_MOST_COUPLED, maxiter=1)
            found[:, k] += self.solver.precondition(y)
        return found

    def _definite(self, state, right, *, factored):
        """With the tangent without the part that surfaces have as they turn, and as stiff as it takes to be positive definite."""
        matrix = self.tangent(state, turning=False)  # far from balance, pressed surfaces that turn may have no stiffness
        if not np.isfinite(matrix.data).all():  # no shift makes it positive definite
            raise ConvergenceError("The tangent holds what is no number; an element may be turned inside out.")
        shift, diagonal = 0.0, matrix.indptr[:-1]
        while (found := self.solver.solve(matrix, right, doubt=not shift, factored=factored)) is None:
            more = max(3.0 * shift, 1e-4 * float(np.abs(matrix.data[diagonal]).mean()))
            matrix.data[diagonal] += more
            shift += more
        return found

    def tangent(self, state: SolidState, *, turning: bool = True) -> sp.csr_matrix:
        """Upper triangle of the residual's derivative by the free displacements in N/mm; the next call fills the same matrix.

        turning: with what pressures do as surfaces turn and bend, a part that may be negative
        """
        x = self.points + state.displacement
        coupled = [part for item, *both in self.item_states(state) for part in item.tangents(*both, x, turning=turning)]  # type: ignore[misc]
        matrix = self._matrix_for(coupled)
        self._add_blocks(matrix.data, state)
        for nodes, matrices in coupled:
            add_upper(matrix.data, matrices, self._pattern.positions(nodes))  # type: ignore[union-attr]
        return matrix

    def _add_blocks(self, values, state):
        displacement = state.displacement
        for (_, nodes, block), positions, memory in zip(self.blocks, self._positions, state.memories, strict=True):
            if hasattr(block.loops, "add_tangent"):
                block.add_tangent(values, positions, displacement[nodes], workers=self.workers, history=memory)
                continue
            tangents, parts = partial(_tangents, block, nodes, displacement, memory), slices(len(nodes), _CHUNK)
            for start in range(0, len(parts), self.workers.threads):  # in turns, so that few are in memory at once
                several = parts[start : start + self.workers.threads]
                for part, matrices in zip(several, self.workers.map(tangents, several), strict=True):
                    add_upper(values, matrices, positions[part])

    def _matrix_for(self, coupled):
        """A matrix of zeros with room for the elements, and for the pairs of facets that ever met."""
        wanted = {(a, b) for nodes, _ in coupled for a, b in zip(nodes[:, 0].tolist(), nodes[:, -1].tolist(), strict=True)}
        if self._pattern is None or not wanted <= self._known_pairs:
            self._known_pairs |= wanted
            self._members = getattr(self, "_members", []) + [nodes for nodes, _ in coupled if len(nodes)]
            self._pattern = SymmetricPattern(self.free_components, [*(nodes for _, nodes, _ in self.blocks), *self._members])
            self._positions = [self._pattern.positions(nodes) for _, nodes, _ in self.blocks]
            self._matrix = self._pattern.matrix()
        self._matrix.data[:] = 0.0
        return self._matrix


def _tangents(block: SolidBlock, nodes: np.ndarray, displacement: np.ndarray, history: PointHistory | None,
              part: slice) -> np.ndarray:
    """Tangents of some of a block's elements."""
    return block.tangent(displacement[nodes[part]], part, history=history)
