"""What a press knows at one displacement, and what its contacts remember: plain records, which the files beside share.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from softtact.contact.friction import FrictionResponse, FrictionState
from softtact.contact.penalty import Contact


@dataclass(frozen=True)
class ContactHistory:
    """The history of one contact. It belongs to a state and never changes: a step forward gives a new one."""

    contact: Contact
    """Law of the points with their multipliers, as offsets in mm (augmented Lagrange)."""
    friction: FrictionState | None = None
    """How friction holds the points during a step; None without friction, or before the first touch."""

    def held_by(self, friction: FrictionState | None) -> "ContactHistory":
        """The same multipliers with another friction state."""
        return replace(self, friction=friction)


# Heights (n,) and outward normals (n, 3) of an object's underside over places x (n,), y (n,).
ObjectSurface = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class ContactProjection:
    """The planes of the object's facets that points face: anchors (p, 3) in mm at no indentation, outward normals (p, 3).

    covered (p,): share of a point's area that the object covers;  beside (p,): points that lie beside the object themselves
    contact_compliance (p,): mm/MPa of a spring between point and plane, where an edge covers it in part (`contact/edges`)
    overrun (p,): points that lay far under an edge where the planes were found
    offset_mm (2,): displacement of the object along x and y from its place at first touch, at which the anchors are
    A point keeps its plane during a step of Newton's method, so that each step lowers one potential.
    """

    anchors: np.ndarray
    normals: np.ndarray
    covered: np.ndarray
    beside: np.ndarray
    contact_compliance: np.ndarray
    offset_mm: np.ndarray = field(default_factory=lambda: np.zeros(2))
    overrun: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def taking(self, other: "ContactProjection", points: np.ndarray) -> "ContactProjection":
        """These planes, and those of another projection for some of the points (p,)."""
        kept = {name: getattr(self, name).copy() for name in ("anchors", "normals", "covered", "beside", "contact_compliance")}
        for name, values in kept.items():
            values[points] = getattr(other, name)[points]
        return replace(self, **kept, overrun=self.overrun | points)

    def moved(self, way_mm: np.ndarray) -> "ContactProjection":
        """The same planes after the object has moved by (2,) in mm along x and y."""
        return replace(self, anchors=self.anchors + [*way_mm, 0.0], offset_mm=self.offset_mm + way_mm)


@dataclass(frozen=True)
class SlabState:
    """energy (mJ), force (n, 3) in N, contact quantities at the top's points, displacement (n, 3).

    elastic: energy and force of the rubber alone; projection: what the points face; indentation_force: the object's, N downwards;
    history: of the contact, see `ContactHistory`;  friction_response: friction at the points, None without
    """

    elastic: tuple
    energy: float
    force: np.ndarray
    gaps: np.ndarray
    projection: ContactProjection
    displacement: np.ndarray
    indentation_force: float
    history: ContactHistory
    friction_response: FrictionResponse | None = None


@dataclass(frozen=True)
class SupportState:
    """energy (mJ), force (f, nodes, 3) on the support's nodes, gaps (f, p) at its contact points, displacement (f, nodes, 3).

    elastic: energies (f,) and force of the rubber alone;  history: of the contacts, see `ContactHistory`
    friction_response: friction at the points on the board (f, b), None without
    """

    elastic: tuple
    energy: float
    force: np.ndarray
    gaps: np.ndarray
    displacement: np.ndarray
    history: ContactHistory
    friction_response: FrictionResponse | None = None


@dataclass(frozen=True)
class BodyHistory:
    """The `ContactHistory` of the object on the slab's top, and of the support on the board."""

    top: ContactHistory
    support: ContactHistory


@dataclass(frozen=True)
class BodyState:
    """Slab and support at one displacement, and the potential energy (mJ) of both with their contacts and friction."""

    slab: SlabState
    support: SupportState
    indentation: float

    @property
    def energy(self) -> float:
        return self.slab.energy + self.support.energy

    @property
    def history(self) -> BodyHistory:
        """What the contacts remember, `BodyHistory`."""
        return BodyHistory(self.slab.history, self.support.history)

    @property
    def force(self) -> float:
        """Force (N) that the object exerts downwards."""
        return self.slab.indentation_force


@dataclass(frozen=True)
class BodyStep:
    """A Newton step: slab (n, 3), support (f, nodes, 3) in mm, indentation in mm, and what the object's contact faces in it."""

    slab: np.ndarray
    support: np.ndarray
    indentation: float
    projection: ContactProjection

    def largest(self) -> float:
        return max(np.abs(self.slab).max(), np.abs(self.support).max(initial=0.0), abs(self.indentation))


@dataclass(frozen=True)
class LinearGaps:
    """Contact points (p,) as they depend on a step: gaps (mm) at none, rows (p, n) of their change by each unknown.

    indentation increment (p,): their change when the object goes down by 1 mm;  area (p,) in mm2;  contact: a `Contact`
    """

    gaps: np.ndarray
    rows: sp.csr_matrix
    indentation_increment: np.ndarray
    area: np.ndarray
    contact: Contact

    def pressure(self, change: np.ndarray | float) -> np.ndarray:
        """Forces (p,) in N that the points carry after their gaps have changed, positive in compression."""
        return self.area * self.contact.response(self.gaps + change)[1]

    def slope(self, change: np.ndarray | float) -> np.ndarray:
        """Stiffness (p,) in N/mm of the points after their gaps have changed."""
        return self.area * self.contact.response(self.gaps + change)[2]
