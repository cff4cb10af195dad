"""The support of the slab: a lattice of frusta (`FrustumArray`), the board itself, or nothing (`Support`).

    frusta   each with separate unknowns, tied to the slab at its root, in contact with the board
    base     the slab's lower side is bonded to the board: its nodes are fixed (`Slab.hold`), with no unknowns below
    none     the slab's lower side is free: it is held by its sides in the sensor's shell
"""


from dataclasses import replace

import numpy as np

from softtact.contact.friction import Coulomb, FrictionState
from softtact.contact.penalty import Contact
from softtact.linalg.workers import SERIAL, Workers
from softtact.models.hyperelastic.states import BodyState, ContactHistory, SupportState


class Support:
    """Interface of a `LayeredBody` to its support: `count` bodies of `nodes` nodes each, tied to the slab at `root`.

    This class has no bodies: the board under a bonded slab, or nothing, without energy and contact. `FrustumArray` has bodies; it
    also condenses them for the slab's cells (`SheetCells`) and finds their local equilibria (`body.balanced`).
    """

    friction: Coulomb | None
    count, nodes, friction = 0, 1, None
    root = np.zeros(0, dtype=np.int64)

    def __init__(self, kind: str, contact: Contact | None = None) -> None:
        """kind: base or none;  contact: a penalty for the history that every support has; no point uses it"""
        self.kind, self.contact = kind, contact or Contact(stiffness=1.0, smoothing=1.0)

    @property
    def blocks(self) -> list:
        """Blocks of its elements; none without bodies."""
        return []

    @property
    def in_words(self) -> str:
        """Its description in messages."""
        return {"base": "bonded to the board", "none": "free below"}[self.kind]

    def fresh_history(self) -> ContactHistory:
        """The contacts' history before the first touch."""
        return ContactHistory(self.contact)

    def evaluate(self, displacement: np.ndarray, history: ContactHistory | None = None, *,
                 workers: Workers = SERIAL) -> SupportState | None:
        """The state at displacement (f, nodes, 3); None if an element is inverted. history: of the contacts, by default none"""
        nothing = np.zeros((0, self.nodes, 3))
        return SupportState(elastic=(np.zeros(0), nothing), energy=0.0, force=nothing, gaps=np.zeros((0, 1)),
                            displacement=displacement, history=history or self.fresh_history())

    def reevaluate_contact(self, state: SupportState, history: ContactHistory) -> SupportState:
        """The same displacements with another history of the contacts."""
        return replace(state, history=history)

    def inner_residual(self, state: SupportState) -> np.ndarray:
        """Unbalanced forces (f, inner) in N of the inner unknowns."""
        return np.zeros((0, 1))

    def contact_error(self, state: SupportState) -> float:
        """Deepest overlap, or widest gap under pressure, in mm."""
        return 0.0

    def augmented(self, state: SupportState) -> ContactHistory:
        """The contacts' history after one augmentation."""
        return state.history

    def first_friction_state(self, state: SupportState) -> FrictionState | None:
        """The friction state at a step's start, None without friction."""
        return None

    def most_compressed(self, state: SupportState) -> tuple[float, str] | None:
        """Largest compression of a body relative to its height, and which body in words; None without bodies."""
        return None

    def largest_compression(self, displacement: np.ndarray) -> float:
        """Largest compression (mm) of a body; nan without bodies."""
        return np.nan


class NoCells:
    """Replaces `SheetCells` for a slab without bodies below it: nothing is eliminated, every unknown is global."""

    outer_dofs: list[np.ndarray]
    outer: list[np.ndarray]
    count, outer_dofs, outer = 0, [], []
    roots, eliminated = np.zeros((0, 1), dtype=np.int64), np.zeros(0, dtype=np.int64)

    def positive_outer(self, *, workers: Workers = SERIAL) -> list[np.ndarray]:
        return []

    def refresh(self, state: BodyState, *, kept_mm: float = 0.0, workers: Workers = SERIAL) -> int:
        return 0

    def damp(self, slab_step: np.ndarray, bed_step: np.ndarray) -> bool:
        return False

    def reset(self) -> None:
        pass

    def forget(self, cells: np.ndarray | None = None) -> None:
        pass

    def condensed_residual(self, state: BodyState, *, workers: Workers = SERIAL) -> tuple[np.ndarray, None]:
        return state.slab.force.copy(), None

    def recover(self, kept: None, slab_step: np.ndarray, *, workers: Workers = SERIAL) -> tuple[np.ndarray, np.ndarray]:
        return slab_step, np.zeros((0, Support.nodes, 3))
