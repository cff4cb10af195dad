"""Forces on films: the normal traction of a part's face, integrated over the film.

The traction t follows from the part's internal forces f at the face's nodes: M t = f with the face's mass matrix M, so that the
traction is in balance with the forces (consistent flux recovery: Hughes et al., J. Comput. Phys. 163 (2000) 467).
A film's force is then q . f with q = M^-1 int_film N dx. The sum over a whole face is that of its forces, to rounding.
"""

from dataclasses import dataclass

import numpy as np

from softtact.fem.kernels import add_forces
from softtact.models.solid.body import SolidBody
from softtact.probe.design import Film, PalpationDesign

_MASS = np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]]) / 30      # of a quadratic line of length 1
_ROUNDING_MM = 1e-6


@dataclass(frozen=True)
class FilmReader:
    """Reads a film's force off the displacement of a body's nodes."""

    body: SolidBody
    region: str
    nodes: np.ndarray
    """(k,) of the face."""
    weight: np.ndarray
    """(k,) q of each node."""
    sign: float

    def force_n(self, displacement: np.ndarray) -> float:
        """Force in N on the film, positive in compression; displacement (n, 3) in mm."""
        force = np.zeros_like(displacement)
        for region, nodes, block in self.body.blocks:
            if region == self.region:
                state = block.evaluate(displacement[nodes])
                assert state is not None       # the state was balanced with these elements
                add_forces(force, nodes, state.force.reshape(*nodes.shape, 3))
        return float(self.sign * (self.weight @ force[self.nodes, 1]))


def film_reader(body: SolidBody, design: PalpationDesign, film: Film) -> FilmReader:
    """The reader of a film of a design's body."""
    own = np.unique(np.concatenate([nodes.ravel() for region, nodes, _ in body.blocks if region == film.on]))
    y = body.points[own, 1]
    nodes = own[np.abs(y - (y.max() if film.side == "top" else y.min())) < _ROUNDING_MM]
    x, inverse = np.unique(np.round(body.points[nodes, 0], 9), return_inverse=True)
    return FilmReader(body, film.on, nodes, line_weights(x, film.start, film.end)[inverse], -1.0 if film.side == "top" else 1.0)


def line_weights(x: np.ndarray, start: float, end: float) -> np.ndarray:
    """q (k,) of quadratic lines with nodes at rising x (k,), k odd: q . f is the part of forces f (k,) from start to end."""
    mass, load = np.zeros((len(x), len(x))), np.zeros(len(x))
    for first in range(0, len(x) - 2, 2):
        own, low, length = slice(first, first + 3), x[first], x[first + 2] - x[first]
        mass[own, own] += length * _MASS
        a, b = np.clip([(start - low) / length, (end - low) / length], 0.0, 1.0)
        load[own] += length * (_integrals(b) - _integrals(a))
    return np.linalg.solve(mass, load)


def _integrals(s):
    """Of the three shape functions of a quadratic line from 0 to s."""
    return np.array([s - 1.5 * s**2 + 2 * s**3 / 3, 2 * s**2 - 4 * s**3 / 3, -0.5 * s**2 + 2 * s**3 / 3])
