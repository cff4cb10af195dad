"""Friction of a layered body as one: of the object on its top and of its support on the board, each where it has a coefficient."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from softtact.contact.friction import FrictionResponse, FrictionState
from softtact.models.hyperelastic.rigid_contact import TopContact
from softtact.models.hyperelastic.support import Support

if TYPE_CHECKING:
    from softtact.models.hyperelastic.body import BodyHistory, BodyState


class BodyFriction:
    """What a press has to do about friction between Newton's runs; without any coefficient all of it does nothing."""

    def __init__(self, top: TopContact, support: Support) -> None:
        """top: the slab's `TopContact`, support: what is below the slab."""
        self._top, self._support = top, support
        self.reset()

    def reset(self) -> None:
        """Forget the last tangent."""
        self._last: Sequence[FrictionResponse | None] = None, None             # friction on top and board at the last tangent

    @property
    def active(self) -> bool:
        return self._top.friction is not None or self._support.friction is not None

    def begin_step(self, state: "BodyState", *, growth: float = 1.0) -> "BodyHistory":
        """History with the points held where a step starts from a `BodyState`, by pressures as they are to grow: a first guess."""
        top = self._top.first_friction_state(state.slab, state.indentation)
        support = self._support.first_friction_state(state.support)
        return self._history(state, *(part and replace(part, pressure=growth * part.pressure) for part in (top, support)))

    def renewed(self, state: "BodyState", *, halfway: bool = False) -> "BodyHistory":
        """History with friction up to date with the pressures of a `BodyState`, or half the way there."""
        parts: list[FrictionState | None] = []
        part: Any
        of_part: Any
        for part, of_part in ((self._top, state.slab), (self._support, state.support)):
            if part.friction is None:
                parts.append(None)
                continue
            renewed = part.renewed_friction_state(of_part)
            parts.append(of_part.history.friction.halfway(renewed) if halfway else renewed)
        return self._history(state, *parts)

    @staticmethod
    def _history(state, top, support):
        history = state.history
        return replace(history, top=history.top.held_by(top), support=history.support.held_by(support))

    def for_tangent(self, state: "BodyState") -> "BodyState":
        """The state whose friction knows that of the last tangent (see `FrictionResponse.after`)."""
        if not self.active:
            return state
        now = state.slab.friction_response, state.support.friction_response
        self._last = top, support = [part and part.after(before) for part, before in zip(now, self._last, strict=True)]
        return replace(state, slab=replace(state.slab, friction_response=top),
                       support=replace(state.support, friction_response=support))
