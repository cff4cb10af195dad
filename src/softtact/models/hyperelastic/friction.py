"""Friction of a layered body as one: of the object on its top and of the frusta on the board, each where it has a coefficient.

Like the contacts' offsets, the grips that friction acts by belong to the body and stay as they are while Newton's method runs.
"""

from dataclasses import replace


class BodyFriction:
    """What a press has to do about friction between Newton's runs; without any coefficient all of it does nothing."""

    def __init__(self, top, bed):
        """top: the slab's `TopContact`, bed: the `FrustumBed`."""
        self._top, self._bed = top, bed
        self._drags = None, None             # friction on top and board at the last tangent

    @property
    def active(self):
        return self._top.friction is not None or self._bed.friction is not None

    def release(self):
        """No point holds to anything: before a press."""
        self._top.grip = self._bed.grip = None

    def begin_step(self, state, *, growth=1.0):
        """Hold the points where a step starts from a `BodyState`, by pressures as they are to grow: a first guess of its end's."""
        self._top.begin_step(state.slab, state.indentation)
        self._bed.begin_step(state.bed)
        for part in (self._top, self._bed):
            if part.friction is not None:
                part.grip = replace(part.grip, pressure=growth * part.grip.pressure)

    def renew(self, state, *, halfway=False):
        """Bring friction up to date with the pressures of a `BodyState`, or half the way there."""
        for part, of_part in ((self._top, state.slab), (self._bed, state.bed)):
            if part.friction is not None:
                renewed = part.renewed_grip(of_part)
                part.grip = of_part.drag.grip.halfway(renewed) if halfway else renewed

    def for_tangent(self, state):
        """The state whose friction knows that of the last tangent (see `Drag.after`)."""
        if not self.active:
            return state
        drags = state.slab.drag, state.bed.drag
        self._drags = top, board = [drag and drag.after(before) for drag, before in zip(drags, self._drags, strict=True)]
        return replace(state, slab=replace(state.slab, drag=top), bed=replace(state.bed, drag=board))
