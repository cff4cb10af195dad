"""One frustum under a rigid root: its forces at given movement, tilt and descent, folding sides and neighbours included."""

import numpy as np

from softtact.models.hyperelastic.frusta import FrustumArray
from softtact.models.hyperelastic.states import SupportState
from softtact.models.newton import solve

_STEP_MM = 0.01        # largest movement of the root at once
_TOLERANCE_N = 1e-7    # of the forces inside, against some 1e-2 N on the root
_ITERATIONS = 40


class SingleFrustum:
    """The only frustum of a `FrustumArray`, from its state at rest on; each `move` goes on from the last."""

    def __init__(self, support: FrustumArray) -> None:
        self.support, self._displacement, self._place = support, np.zeros((1, support.nodes, 3)), np.zeros(3)
        self._x = support.coordinates[0][support.root, 0] - support.geometry.centres[0][0]

    def move(self, movement: float, tilt: float, descent: float) -> np.ndarray | None:
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
        found = None if state is None else solve(self, state, max_iterations=_ITERATIONS).state
        return None if found is None else found.displacement

    # The frustum with its root held, as a `Problem` of Newton's method.

    def prepared(self, state: SupportState, iteration: int) -> SupportState:
        return state

    def residual(self, state: SupportState) -> float:
        return np.abs(self.support.inner_residual(state)).max()

    def balanced(self, state: SupportState, residual: float) -> bool:
        return residual <= _TOLERANCE_N

    def step(self, state: SupportState) -> tuple[SupportState, np.ndarray]:
        return state, self._newton_step(state, np.zeros((1, 3 * len(self._x))))

    def first_share(self, step: np.ndarray) -> float:
        return 1.0

    def moved(self, state: SupportState, step: np.ndarray, share: float) -> SupportState | None:
        return self.support.evaluate(state.displacement + share * step)

    def better(self, trial: SupportState, state: SupportState, residual: float) -> bool:
        return trial.energy < state.energy or self.residual(trial) < residual

    def accepted(self, state: SupportState, trial: SupportState) -> None:
        """Nothing is kept from one step to the next."""

    def recovered(self, state: SupportState) -> bool:
        return False

    def _forces(self):
        force = self.support.evaluate(self._displacement).force[0, self.support.root]
        return np.array([force[:, 0].sum(), force[:, 2] @ self._x])
