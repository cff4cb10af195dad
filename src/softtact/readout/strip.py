"""Forces on strips of a surface: the readout `strip`, and the films of palpation sensors.

    readouts: {rim: {kind: strip, x_mm: [-11, -9], y_mm: [-18, 18]}}

The force of a strip under contact is the integral of the contact pressure over it. A film inside a body has no contact: the normal
traction t of the face that it lies on follows from the internal forces f at the face's nodes, M t = f with the face's mass matrix
M, so that the traction is in balance with the forces (consistent flux recovery: Hughes et al., J. Comput. Phys. 163 (2000) 467). A
film's force is then q . f with q = M^-1 int_film N dx. The sum over a whole face is that of its forces, to rounding.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from softtact.errors import InputError
from softtact.fem.kernels import add_forces
from softtact.models.solid.body import SolidBody
from softtact.readout.registry import Samples, SurfaceMotion, labelled, register
from softtact.sensors.fields import FiniteSection

if TYPE_CHECKING:
    import xarray

QUANTITIES, UNITS = ("force", "pressure"), ("N", "MPa")
_MASS = np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]]) / 30      # of a quadratic line of length 1
_ROUNDING_MM = 1e-6


@register("strip")
class Strip(FiniteSection):
    """The part of a face from one value of x, of y (and of z) to below another, at rest.

    Readings (step, quantity): the contact's normal force on it in N and its mean pressure in MPa, positive in compression; nan
    where the model gives no pressure.
    """

    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    z_mm: tuple[float, float] | None = Field(None, description="by default at any height")
    face: str | None = Field(None, description="by default the sensing surface")

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Strip`. Raises InputError where the face has nothing within the strip."""
        rest, pressed = surface.displacement(self.face)[0], surface.pressure(self.face)
        area = float(rest.area_mm2[self._within(rest)].sum())
        if area <= 0:
            raise InputError(f"a strip from x {self.x_mm[0]:g} to {self.x_mm[1]:g} and y {self.y_mm[0]:g} to {self.y_mm[1]:g} mm "
                             "has nothing of the face; correct its sides.")
        force = np.full(surface.steps, np.nan)
        if pressed is not None:
            force = np.array([(one.area_mm2 * one.values)[self._within(one)].sum() for one in pressed])
        return labelled(np.column_stack([force, force / area]), ("step", "quantity"),
                        coordinates={"quantity": list(QUANTITIES), "units": ("quantity", list(UNITS))})

    def _within(self, samples: Samples) -> np.ndarray:
        sides = (self.x_mm, self.y_mm, self.z_mm or (-np.inf, np.inf))
        return np.all([(low <= column) & (column < high) for (low, high), column in zip(sides, samples.points_mm.T, strict=True)],
                      axis=0)


@dataclass(frozen=True)
class FilmReader:
    """The force on a film, between two values of x on a face of a plane body, from the displacement of the body's nodes."""

    body: SolidBody
    """The body."""
    region: str
    """The region that the film lies on."""
    nodes: np.ndarray
    """(k,) of the face."""
    weight: np.ndarray
    """(k,) q of each node."""
    sign: float
    """1 on a lower face, -1 on an upper one."""

    @classmethod
    def on(cls, body: SolidBody, region: str, side: str, ends: tuple[float, float]) -> "FilmReader":
        """The reader of a film on the `top` or `bottom` side of a region, between two values of x in mm."""
        used = np.unique(np.concatenate([nodes.ravel() for name, nodes, _ in body.blocks if name == region]))
        y = body.points[used, 1]
        nodes = used[np.abs(y - (y.max() if side == "top" else y.min())) < _ROUNDING_MM]
        x, inverse = np.unique(np.round(body.points[nodes, 0], 9), return_inverse=True)
        return cls(body, region, nodes, line_weights(x, *ends)[inverse], -1.0 if side == "top" else 1.0)

    def force_n(self, displacement: np.ndarray) -> float:
        """Force in N on the film, positive in compression; displacement (n, 3) in mm."""
        force = np.zeros_like(displacement)
        for region, nodes, block in self.body.blocks:
            if region == self.region:
                state = block.evaluate(displacement[nodes])
                assert state is not None       # the balanced state has valid elements
                add_forces(force, nodes, state.force.reshape(*nodes.shape, 3))
        return float(self.sign * (self.weight @ force[self.nodes, 1]))


def line_weights(x: np.ndarray, start: float, end: float) -> np.ndarray:
    """q (k,) of quadratic lines with nodes at rising x (k,), k odd: q . f is the part of forces f (k,) from start to end."""
    mass, load = np.zeros((len(x), len(x))), np.zeros(len(x))
    for first in range(0, len(x) - 2, 2):
        line, low, length = slice(first, first + 3), x[first], x[first + 2] - x[first]
        mass[line, line] += length * _MASS
        a, b = np.clip([(start - low) / length, (end - low) / length], 0.0, 1.0)
        load[line] += length * (_integrals(b) - _integrals(a))
    return np.linalg.solve(mass, load)


def _integrals(s):
    """Of the three shape functions of a quadratic line from 0 to s."""
    return np.array([s - 1.5 * s**2 + 2 * s**3 / 3, 2 * s**2 - 4 * s**3 / 3, -0.5 * s**2 + 2 * s**3 / 3])
