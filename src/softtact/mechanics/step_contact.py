"""The object's contact with a slab as a step of Newton's method sees it."""

from softtact.mechanics.parallel import SERIAL


class StepContact:
    """The object's contact in the course of a step from a `SlabState`; `planes` and `points` are what it is at present.

    surface: looked up anew where the step leads; None: the points keep the planes that they face
    """

    def __init__(self, slab, state, indentation, surface=None, *, workers=SERIAL):
        self._slab, self._state, self._indentation, self._surface, self._workers = slab, state, indentation, surface, workers
        self._face(state.planes)

    def _face(self, planes):
        self.planes, self.points = planes, self._slab.linear_gaps(self._state.displacement, planes, self._indentation)

    def frames(self, kept):
        """`NodeFrames` of the nodes that the object touches or is near; the `kept` nodes if they are enough."""
        return self._slab.facing_frames(self.points.gaps, self.planes, kept)

    def rubber_forces(self, rubber, step):
        """Forces (unknowns,) of the rubber's tangent against a step (unknowns,) in mm."""
        return self._slab.product(rubber.data, step, workers=self._workers)

    def follow(self, step, lowering):
        """Look up what the points face after a step (unknowns,) in mm of the slab; True if there is a surface to ask."""
        if self._surface is None:
            return False
        displacement = self._state.displacement.copy()
        displacement.ravel()[self._slab.unknowns] += step
        self._face(self._slab.facing(displacement, self._surface))
        return True
