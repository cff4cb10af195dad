"""A rubber body on any mesh: elements of several kinds and laws on one set of nodes, pressed by a rigid object from above.

The control is the indentation d in mm: it lowers the object's planes, and carries nodes that follow it. Potential Pi(u, d): its
derivative by the free displacements is the residual, that by d the object's force. Lengths in mm, forces in N.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from free_bodies.contact_correction import ContactCorrection
from free_bodies.tetrahedra import LinearTetrahedra
from softtact.contact.penalty import penalty
from softtact.fem.assembly import SymmetricPattern, add_upper
from softtact.fem.solid_block import SolidBlock
from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, SuperLUSolver, make_solver, point_at_mkl
from softtact.linalg.workers import SERIAL, Workers

# Heights (n,) and outward normals (n, 3) of a rigid surface over places x (n,), y (n,).
Surface = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
_CHUNK = 400      # elements whose dense tangents are in memory at once
_PROBE_MM = 1e-7  # of the indentation, for the residual's derivative by it


class SolidElements:
    """Elements (e, m) given by a `blocks.SolidBlock`."""

    def __init__(self, nodes: np.ndarray, block: SolidBlock) -> None:
        self.nodes, self.block = np.ascontiguousarray(nodes), block

    def add_force(self, displacement: np.ndarray, force: np.ndarray) -> tuple[float, float] | None:
        """Add nodal forces (n, 3); returns energy (mJ) and the sum of all force components' magnitudes (N), None where J <= 0."""
        state = self.block.evaluate(displacement[self.nodes])
        if state is None:
            return None
        np.add.at(force, self.nodes.ravel(), state.force.reshape(-1, 3))
        return state.energy, float(np.abs(state.force).sum())

    def add_tangent(self, displacement: np.ndarray, values: np.ndarray, positions: np.ndarray) -> None:
        """Add the tangent's entries (i, j >= i) to the matrix's values at `positions`."""
        for start in range(0, len(self.nodes), _CHUNK):
            part = slice(start, start + _CHUNK)
            add_upper(values, self.block.tangent(displacement[self.nodes[part]], part), positions[part])


class RigidContact:
    """Frictionless penalty contact of faces (f, m) with a rigid surface, at points given by shape values (g, m) and areas (f, g).

    surface(x, y) gives heights and normals out of the object over points, in the object's place at d = 0; `moves`: down with d. A
    point keeps its plane until `face` looks anew. What is "near" is numbered by `near_nodes`, the faces' own nodes.
    """

    def __init__(self, points: np.ndarray, faces: np.ndarray, values: np.ndarray, areas: np.ndarray, surface: Surface, *,
                 moves: bool, stiffness: float, smoothing: float) -> None:
        self.nodes, self.values, self.areas = np.ascontiguousarray(faces), values, areas
        self.near_nodes, faces = np.unique(self.nodes, return_inverse=True)
        self._faces = faces.reshape(self.nodes.shape)
        self.surface, self.moves, self._law = surface, moves, {"stiffness": stiffness, "smoothing": smoothing}
        self._reference = self._at(points[self.near_nodes])
        self.face(np.zeros_like(points))

    def _at(self, field):
        return np.matmul(self.values, field[self._faces])

    def face(self, displacement: np.ndarray) -> None:
        """Take the planes of the object that the points (f, g) face now."""
        place = self._reference + self._at(displacement[self.near_nodes])
        height, normals = self.surface(place[..., 0].ravel(), place[..., 1].ravel())
        anchors = np.concatenate([place[..., :2], height.reshape(*place.shape[:2], 1)], axis=2)
        self._normals = normals.reshape(place.shape)
        self._gap0 = ((self._reference - anchors) * self._normals).sum(axis=2)

    def _gaps(self, near, indentation):
        gaps = self._gap0 + (self._normals * self._at(near)).sum(axis=2)
        return gaps + indentation * self._normals[..., 2] if self.moves else gaps

    def add_force(self, displacement: np.ndarray, indentation: float, force: np.ndarray) -> tuple[float, float]:
        """Add nodal forces (n, 3); returns the contact's energy (mJ) and the downward force (N) of a moving object."""
        near = displacement[self.near_nodes]
        density, _, _ = penalty(self._gaps(near, indentation), **self._law)
        nodal = self.near_force(near, indentation)
        force[self.near_nodes] += nodal
        return float((density * self.areas).sum()), float(nodal[:, 2].sum()) if self.moves else 0.0

    def near_force(self, near: np.ndarray, indentation: float) -> np.ndarray:
        """Nodal forces (c, 3) of the near nodes' displacement (c, 3): those of the residual, against what the object exerts."""
        _, pressure, _ = penalty(self._gaps(near, indentation), **self._law)
        active = pressure.any(axis=1)
        push = (pressure[active] * self.areas[active])[..., None] * self._normals[active]
        force = np.zeros_like(near)
        np.add.at(force, self._faces[active].ravel(), -np.matmul(self.values.T, push).reshape(-1, 3))
        return force

    def add_tangent(self, displacement: np.ndarray, indentation: float, values: np.ndarray, positions: np.ndarray) -> None:
        """Add the entries of faces in contact."""
        near = displacement[self.near_nodes]
        active = penalty(self._gaps(near, indentation), **self._law)[2].any(axis=1)
        _, shape, slope = self.near_touching(near, indentation)
        shape = shape.reshape(*slope.shape, 3 * self.nodes.shape[1])
        add_upper(values, np.matmul((shape * slope[..., None]).transpose(0, 2, 1), shape), positions[active])

    def near_touching(self, near: np.ndarray, indentation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The faces that touch, in near nodes (t, m); the gaps' derivatives (t, g, m, 3); the points' stiffness (t, g) in N/mm."""
        slope = penalty(self._gaps(near, indentation), **self._law)[2] * self.areas
        active = slope.any(axis=1)
        return self._faces[active], self.values[..., None] * self._normals[active][:, :, None], slope[active]

    def node_normals(self, points: np.ndarray) -> np.ndarray:
        """The object's normals over nodes at rest (n, 3)."""
        return self.surface(points[:, 0], points[:, 1])[1]


def flat_surface(height: float, radius: float = np.inf) -> Surface:
    """The underside of a flat punch of this radius (mm), as `RigidContact` asks for it."""
    from softtact.contact.height_field import NO_CONTACT_MM

    def surface(x, y):
        return np.where(x * x + y * y <= radius * radius, height, NO_CONTACT_MM), np.tile([0.0, 0.0, -1.0], (len(x), 1))

    return surface


def ground(height: float) -> Surface:
    """A plane below the body, as `RigidContact` asks for it."""
    return lambda x, y: (np.full(len(x), height), np.tile([0.0, 0.0, 1.0], (len(x), 1)))


@dataclass(frozen=True)
class FreeState:
    """Displacement (n, 3) in mm at an indentation (mm), energy (mJ), nodal forces (n, 3) and the object's downward force in N.

    mean_force: mean magnitude of all elements' nodal force components (N), the scale of the residual.
    """

    displacement: np.ndarray
    indentation: float
    energy: float
    force: np.ndarray
    object_force: float
    mean_force: float


class FreeBody:
    """Elements and contacts on one set of nodes.

    parts: `SolidElements` or `LinearTetrahedra`; held (n, 3): components that are given: zero, or -d times `follows` (n, 3).
    apart: keep the moving contact out of the factor (see `contact_correction`): worth it for some hundred touching nodes, as long
    as the rubber alone, under the pressure it has, is stable.
    workers: for the places of the elements' entries in the matrix
    """

    def __init__(self, points: np.ndarray, parts: Sequence[SolidElements | LinearTetrahedra], *, held: np.ndarray,
                 contacts: Sequence[RigidContact] = (), follows: np.ndarray | None = None,
                 solver: PardisoSolver | BlockTridiagonalSolver | SuperLUSolver | None = None, apart: bool = False,
                 workers: Workers = SERIAL) -> None:
        self.points, self.parts, self.contacts = points, parts, contacts
        self._follows = np.zeros(points.shape) if follows is None else -np.where(held, follows, 0.0)
        used = np.zeros(len(points), dtype=bool)
        for part in parts:
            used[part.nodes] = True
        free = ~held & used[:, None]
        self.free = np.flatnonzero(free.ravel())
        pattern = SymmetricPattern(free, [part.nodes for part in parts])
        self._matrix = pattern.matrix()
        self._positions = workers.map(lambda part: pattern.positions(part.nodes), (*parts, *contacts))
        self._components = sum(3 * part.nodes.size for part in parts)
        point_at_mkl()
        self.solver = solver or make_solver()
        self._apart = next((c for c in contacts if c.moves), None) if apart else None
        if self._apart:
            self._correction = ContactCorrection(self.solver, pattern.number, self._apart, self._apart.node_normals(points))

    def rest(self) -> FreeState:
        """The state without displacement."""
        return self.evaluate(np.zeros_like(self.points), 0.0)     # type: ignore[return-value]

    def carried(self, displacement: np.ndarray, indentation: float) -> np.ndarray:
        """The displacement with the nodes that follow the object where the indentation puts them."""
        return np.where(self._follows != 0, indentation * self._follows, displacement)

    def face(self, displacement: np.ndarray) -> None:
        """Let every contact point take the plane that it faces now."""
        for contact in self.contacts:
            contact.face(displacement)

    def evaluate(self, displacement: np.ndarray, indentation: float) -> FreeState | None:
        """`FreeState`; None where an element is inside out."""
        force = np.zeros_like(displacement)
        energy, size, pressed = 0.0, 0.0, 0.0
        for part in self.parts:
            result = part.add_force(displacement, force)
            if result is None:
                return None
            energy, size = energy + result[0], size + result[1]
        followed = float((force * self._follows).sum())   # d(energy)/dd through the nodes that follow
        for contact in self.contacts:
            stored, push = contact.add_force(displacement, indentation, force)
            energy, pressed = energy + stored, pressed + push
        return FreeState(displacement, indentation, energy, force, followed + pressed, size / self._components)

    def residual(self, state: FreeState) -> np.ndarray:
        """Unbalanced forces (unknowns,) in N."""
        return state.force.ravel()[self.free]

    def factor(self, state: FreeState) -> None:
        """Factor the tangent; where it is not positive definite, with as large a diagonal added as makes it so."""
        matrix = self._matrix
        matrix.data[:] = 0.0
        for part, positions in zip(self.parts, self._positions, strict=False):
            part.add_tangent(state.displacement, matrix.data, positions)
        for contact, positions in zip(self.contacts, self._positions[len(self.parts):], strict=True):
            if contact is self._apart:
                continue
            contact.add_tangent(state.displacement, state.indentation, matrix.data, positions)
        shift, diagonal = 0.0, matrix.indptr[:-1]
        while not self.solver.factor(matrix):
            more = max(shift, 1e-3 * float(np.abs(matrix.data[diagonal]).mean()))
            matrix.data[diagonal] += more
            shift += more

    def join_contact(self) -> bool:
        """Take a contact kept apart back into the factor, where the rubber alone hardly stands; False if there is none."""
        apart, self._apart = self._apart, None
        return apart is not None

    def step(self, state: FreeState) -> np.ndarray:
        """Newton's step (unknowns,) in mm with the last factor, at the state's indentation."""
        residual = self.residual(state)
        return self._correction.step(state, residual) if self._apart else -self.solver.solve(residual)

    def border(self, state: FreeState) -> tuple[np.ndarray, float]:
        """Derivative (unknowns,) of the residual by the indentation, and that of the object's force (N/mm), by a difference."""
        lowered = state.indentation + _PROBE_MM
        moved: Any = self.evaluate(self.carried(state.displacement, lowered), lowered)
        return ((self.residual(moved) - self.residual(state)) / _PROBE_MM, (moved.object_force - state.object_force) / _PROBE_MM)

    def moved(self, state: FreeState, step: np.ndarray, indentation_increment: float) -> FreeState | None:
        """The state after a step (unknowns,) in mm and an indentation increment of the object in mm; None where an element is
        inside out.
        """
        displacement = state.displacement.copy()
        displacement.ravel()[self.free] += step
        indentation = state.indentation + indentation_increment
        return self.evaluate(self.carried(displacement, indentation), indentation)
