"""Friction of a layered body as one: of the object on its top and of the frusta on the board, each where it has a coefficient.

Like the contacts' offsets, the friction states that friction acts by belong to the body and stay as they are while Newton's method
runs.
"""

from dataclasses import replace


class BodyFriction:
    """What a press has to do about friction between Newton's runs; without any coefficient all of it does nothing."""

    def __init__(self, top, support):
        """top: the slab's `TopContact`, support: the `FrustumArray`."""
        self._top, self._frustum_array = top, support
        self._friction_responses = None, None             # friction on top and board at the last tangent

    @property
    def active(self):
        return self._top.friction is not None or self._frustum_array.friction is not None

    def release(self):
        """No point holds to anything: before a press."""
        self._top.friction_state = self._frustum_array.friction_state = None

    def begin_step(self, state, *, growth=1.0):
        """Hold the points where a step starts from a `BodyState`, by pressures as they are to grow: a first guess of its end's."""
        self._top.begin_step(state.slab, state.indentation)
        self._frustum_array.begin_step(state.support)
        for part in (self._top, self._frustum_array):
            if part.friction is not None:
                part.friction_state = replace(part.friction_state, pressure=growth * part.friction_state.pressure)

    def renew(self, state, *, halfway=False):
        """Bring friction up to date with the pressures of a `BodyState`, or half the way there."""
        for part, of_part in ((self._top, state.slab), (self._frustum_array, state.support)):
            if part.friction is not None:
                renewed = part.renewed_friction_state(of_part)
                part.friction_state = of_part.friction_response.friction_state.halfway(renewed) if halfway else renewed

    def for_tangent(self, state):
        """The state whose friction knows that of the last tangent (see `FrictionResponse.after`)."""
        if not self.active:
            return state
        friction_responses = state.slab.friction_response, state.support.friction_response
        self._friction_responses = top, board = [friction_response and friction_response.after(before) for friction_response,
                                                 before in zip(friction_responses, self._friction_responses, strict=True)]
        return replace(state, slab=replace(state.slab, friction_response=top),
                       support=replace(state.support, friction_response=board))
