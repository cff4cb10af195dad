"""What a contact remembers from the steps before: its multipliers, and where friction holds its points."""

from dataclasses import dataclass, replace

from softtact.contact.friction import FrictionState
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
