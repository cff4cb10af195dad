"""One frustum under a rigid root: its forces at given movement, tilt and descent, folding sides and neighbours included."""

import numpy as np

_STEP_MM = 0.01        # largest movement of the root at once
_TOLERANCE_N = 1e-7    # of the forces inside, against some 1e-2 N on the root
_ITERATIONS, _HALVINGS = 40, 8


class SingleFrustum:
    """The only frustum of a `FrustumArray`, from its state at rest on; each `move` goes on from the last."""

    def __init__(self, support):
        self.support, self._displacement, self._place = support, np.zeros((1, support.nodes, 3)), np.zeros(3)
        self._x = support.coordinates[0][support.root, 0] - support.geometry.centres[0][0]

    def move(self, movement, tilt, descent):
        """Force and moment (2,) in N and N mm, along x, that hold the root at a movement and descent in mm and a tilt along x.

        None where a step on the way finds no balance, and from then on.
        """
        target = np.array([movement, tilt, descent])
        far = np.abs((target - self._place) * [1.0, self._x.max(), 1.0]).max()
        count = max(1, int(np.ceil(far / _STEP_MM)))
        for place in self._place + np.linspace(0, 1, count + 1)[1:, None] * (target - self._place):
            if self._displacement is None:
                return None
            self._step(place)
        return None if self._displacement is None else self._forces()

    def _step(self, place):
        """Move the root, the inside along the tangent, and let it settle."""
        root = np.zeros((len(self._x), 3))
        root[:, 0], root[:, 2] = place[0], place[1] * self._x - place[2]
        move = (root - self._displacement[0, self.support.root]).reshape(1, -1)
        trial = self._displacement + self._newton_step(self.support.evaluate(self._displacement), move)
        self._displacement, self._place = self._settled(trial), place

    def _newton_step(self, state, move):
        self.support.condense(state, np.array([0]))
        _, forward_solved = self.support.condensed_residual(state)
        return self.support.inner_step(forward_solved, move)

    def _settled(self, displacement):
        """Displacements (1, nodes, 3) in balance, the root's kept; None if there are none."""
        state = self.support.evaluate(displacement)
        for _ in range(_ITERATIONS):
            if state is None:
                return None
            if self._residual(state) <= _TOLERANCE_N:
                return state.displacement
            state = self._searched(state, self._newton_step(state, np.zeros((1, 3 * len(self._x)))))
        return None

    def _searched(self, state, step):
        """The state after the first of the step's shares 1, 1/2, 1/4 ... that lowers the energy or the residual."""
        for k in range(_HALVINGS):
            trial = self.support.evaluate(state.displacement + 0.5**k * step)
            if trial is not None and (trial.energy < state.energy or self._residual(trial) < self._residual(state)):
                return trial
        return None

    def _residual(self, state):
        return np.abs(self.support.inner_residual(state)).max()

    def _forces(self):
        force = self.support.evaluate(self._displacement).force[0, self.support.root]
        return np.array([force[:, 0].sum(), force[:, 2] @ self._x])
