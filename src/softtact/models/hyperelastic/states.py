"""States of a hyperelastic press and histories of its contacts: records that the modules of this package share.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from softtact.contact.friction import FrictionResponse, FrictionState
from softtact.contact.penalty import Contact


@dataclass(frozen=True)
class ContactHistory:
    """The history of one contact. It belongs to a state and is immutable: each step creates a new one."""

    contact: Contact
    """Law of the points with their multipliers, as offsets in mm (augmented Lagrange)."""
    friction: FrictionState | None = None
    """Friction variables during a step; None without friction, or before the first touch."""

    def held_by(self, friction: FrictionState | None) -> "ContactHistory":
        """This history with another friction state and the same multipliers."""
        return replace(self, friction=friction)


# Heights (n,) and outward normals (n, 3) of an object's underside over places x (n,), y (n,). Those of meshes are also `rounded`.
ObjectSurface = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class ContactProjection:
    """The contact projection: planes of the object's facets, anchors (p, 3) in mm at zero indentation, outward normals (p, 3).

    covered (p,): share of a point's area that the object covers;  beside (p,): points that are not under the object
    contact_compliance (p,): mm/MPa of a spring between point and plane, where an edge covers the area in part (`contact/edges`)
    overrun (p,): points that were far under an edge when the projection was computed
    offset_mm (2,): displacement of the object along x and y from its position at first touch, included in the anchors
    edge_radius_mm: of the object's edges, where the planes touch the object with rounded edges; 0 for those of its facets
    A point keeps its plane during a Newton step, so that each step decreases one potential.
    """

    anchors: np.ndarray
    normals: np.ndarray
    covered: np.ndarray
    beside: np.ndarray
    contact_compliance: np.ndarray
    offset_mm: np.ndarray = field(default_factory=lambda: np.zeros(2))
    overrun: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    edge_radius_mm: float = 0.0

    def taking(self, other: "ContactProjection", points: np.ndarray) -> "ContactProjection":
        """This projection with the planes of another one for some of the points (p,)."""
        kept = {name: getattr(self, name).copy() for name in ("anchors", "normals", "covered", "beside", "contact_compliance")}
        for name, values in kept.items():
            values[points] = getattr(other, name)[points]
        return replace(self, **kept, overrun=self.overrun | points)

    def moved(self, way_mm: np.ndarray) -> "ContactProjection":
        """The planes after a displacement (2,) in mm of the object along x and y."""
        return replace(self, anchors=self.anchors + [*way_mm, 0.0], offset_mm=self.offset_mm + way_mm)


@dataclass(frozen=True)
class SlabState:
    """energy (mJ), force (n, 3) in N, contact quantities at the top's points, displacement (n, 3).

    elastic: energy and force of the rubber alone; projection: of the points on the object; indentation_force: the object's force, N
    downwards; history: of the contact, see `ContactHistory`;  friction_response: at the points, None without friction
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
    friction_response: at the points on the board (f, b), None without friction
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
        """The `BodyHistory` of both contacts."""
        return BodyHistory(self.slab.history, self.support.history)

    @property
    def force(self) -> float:
        """Force (N) that the object exerts downwards."""
        return self.slab.indentation_force


@dataclass(frozen=True)
class BodyStep:
    """A Newton step: slab (n, 3), support (f, nodes, 3) in mm, indentation in mm, and the contact projection that it assumes.

    straight: gives the same step before it was corrected for the object's curvature; None: it was not
    """

    slab: np.ndarray
    support: np.ndarray
    indentation: float
    projection: ContactProjection
    straight: "Callable[[], BodyStep] | None" = None

    def share(self, share: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Movements of slab, support and object in a share of the step.

        The correction grows with the square of the share, as what it corrects does: so the way begins along the step that lowers
        the potential, which a corrected one need not do.
        """
        if self.straight is None or share == 1.0:
            return share * self.slab, share * self.support, share * self.indentation
        first = self.straight()
        begun, turned = share * (1.0 - share), share**2
        return (begun * first.slab + turned * self.slab, begun * first.support + turned * self.support,
                begun * first.indentation + turned * self.indentation)

    def largest(self) -> float:
        return max(np.abs(self.slab).max(), np.abs(self.support).max(initial=0.0), abs(self.indentation))


@dataclass(frozen=True)
class LinearGaps:
    """Linearised gaps of contact points (p,): gaps (mm) before the step, rows (p, n): their derivatives by the unknowns.

    indentation_increment (p,): their derivatives by the object's indentation;  area (p,) in mm2;  contact: a `Contact`
    """

    gaps: np.ndarray
    rows: sp.csr_matrix
    indentation_increment: np.ndarray
    area: np.ndarray
    contact: Contact

    def pressure(self, change: np.ndarray | float) -> np.ndarray:
        """Contact forces (p,) in N after a change of the gaps, positive in compression."""
        return self.area * self.contact.response(self.gaps + change)[1]

    def slope(self, change: np.ndarray | float) -> np.ndarray:
        """Contact stiffness (p,) in N/mm after a change of the gaps."""
        return self.area * self.contact.response(self.gaps + change)[2]
