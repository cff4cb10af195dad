"""A rigid ball pressed into a round gel that is bonded to a rigid plate: finite strain, axisymmetric, from slipping to sticking.

The force is proportional to the gel's modulus if Poisson's ratio and friction stay the same, so one path of unit modulus serves
every modulus. x is the radius and y the axis; the gel's free surface is y = 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.errors import InputError
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidPath

_FINE = 0.62        # share of the ball's radius whose elements are of one width; beyond, they grow
_PENALTY = 40.0     # times the modulus over an element's width


@dataclass(frozen=True)
class Disc:
    """A round gel under a ball; lengths in mm."""

    radius_mm: float
    """Of the gel; its side is free."""
    height_mm: float
    """Of the gel, bonded below."""
    ball_mm: float
    """Radius of the ball."""
    bulk_over_shear: float = 50.0
    """Bulk over shear modulus of the neo-Hookean gel; 50: Poisson's ratio 0.490."""
    friction: float = 0.0
    """Coulomb's coefficient between ball and gel."""
    element_mm: float = 0.4
    """Width of the elements under the ball."""

    def __post_init__(self) -> None:
        for name in ("radius_mm", "height_mm", "ball_mm", "bulk_over_shear", "element_mm"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"Disc: {name}={getattr(self, name):g} is not possible; give a finite number above 0.")
        if not 0 <= self.friction < np.inf:
            raise InputError(f"Disc: friction={self.friction:g} is not possible; give a finite number from 0 on.")


@dataclass(frozen=True)
class DiscPress:
    """A path of depths."""

    depth_mm: np.ndarray
    """(step,) of the ball's lowest point below the surface at rest; the first is 0."""
    force_over_shear: np.ndarray
    """(step,) force over the shear modulus, mm^2."""
    radius_mm: np.ndarray
    """(node,) of the surface's nodes at rest, rising."""
    outward_mm: np.ndarray
    """(step, node) their motion away from the axis."""
    lowering_mm: np.ndarray
    """(step, node) their motion into the gel."""

    def at(self, depth_mm: np.ndarray | float) -> np.ndarray:
        """Force over the shear modulus at other depths: cubic and monotone in force^(1/2), which is nearly straight over depth."""
        self._check(depth_mm, self.depth_mm[-1], "depth", "mm")
        return PchipInterpolator(self.depth_mm, np.sqrt(self.force_over_shear))(depth_mm)**2

    def depth_at(self, force_over_shear: np.ndarray | float) -> np.ndarray:
        """Depth in mm at a force over the shear modulus in mm^2."""
        self._check(force_over_shear, self.force_over_shear[-1], "force over the shear modulus", "mm^2")
        return PchipInterpolator(np.sqrt(self.force_over_shear), self.depth_mm)(np.sqrt(force_over_shear))

    def motion_at(self, depth_mm: float, radius_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Motion outwards and into the gel, in mm, of points of the surface at rest (r,) at a depth: linear between the steps."""
        out, low = (self._between(values, depth_mm) for values in (self.outward_mm, self.lowering_mm))
        return np.interp(radius_mm, self.radius_mm, out), np.interp(radius_mm, self.radius_mm, low)

    def surface_at(self, depth_mm: float) -> tuple[np.ndarray, np.ndarray]:
        """Radius and lowering (node,) in mm of the surface's nodes at a depth."""
        return self.radius_mm + self._between(self.outward_mm, depth_mm), self._between(self.lowering_mm, depth_mm)

    def _between(self, values, depth_mm):
        self._check(depth_mm, self.depth_mm[-1], "depth", "mm")
        last = min(max(int(np.searchsorted(self.depth_mm, depth_mm)), 1), len(self.depth_mm) - 1)
        share = (depth_mm - self.depth_mm[last - 1]) / (self.depth_mm[last] - self.depth_mm[last - 1])
        return (1 - share) * values[last - 1] + share * values[last]

    def _check(self, wanted, last, what, unit):
        wanted = np.ravel(wanted)
        if not (wanted >= 0).all():
            raise InputError(f"the {what} {wanted[~(wanted >= 0)][0]:g} {unit} is not on the path; give numbers from 0 on.")
        if (largest := wanted.max(initial=0.0)) > last * (1 + 1e-9):
            raise InputError(f"the {what} {largest:g} {unit} is beyond the path's last, {last:g} {unit}; compute a longer path.")


def press_disc(disc: Disc, depths_mm: Sequence[float], *, report: Callable[[float], None] = lambda share: None) -> DiscPress:
    """The forces at rising depths.  report: called with the share that is done

    Raises ConvergenceError where a step is not reached.
    """
    depths = np.asarray(depths_mm, dtype=float)
    if not len(depths):
        raise InputError("press_disc: there is no depth; give at least one, in mm.")
    if not (np.diff(depths, prepend=0.0) > 0).all() or not depths[-1] < 0.9 * disc.height_mm:
        raise InputError(f"depths {', '.join(f'{one:g}' for one in depths)} mm: give rising numbers above 0 and below nine tenths "
                         f"of the gel's height, {disc.height_mm:g} mm.")
    ways = [{"y": -float(step)} for step in np.diff(np.concatenate([[0.0], depths]))]
    motion = Motion()
    for way in ways:
        motion = motion.step(ways=way)
    body = _body(disc)
    nodes = body.mesh.face_nodes("y1")
    nodes = nodes[np.argsort(body.points[nodes, 0])]
    forces, moved = [0.0], [np.zeros((len(nodes), 2))]
    for step in SolidPath(body, {"ball": motion}, settings=SolidSettings(penetration_mm=1e-4)).run():
        forces.append(-float(step.loads[0, 1]))
        moved.append(step.state.displacement[nodes, :2])
        report(len(forces) / (len(depths) + 1))
    outward, rise = np.moveaxis(np.array(moved), 2, 0)
    return DiscPress(np.concatenate([[0.0], depths]), np.array(forces), body.points[nodes, 0], outward, -rise)


def _body(disc: Disc) -> SolidBody:
    """Gel and ball; the ball is a strip of elements that a frame carries."""
    width = min(_FINE * disc.ball_mm, 0.75 * disc.radius_mm)
    fine = int(np.ceil(width / disc.element_mm))
    lines = _growing(np.linspace(0, width, fine + 1), disc.radius_mm)
    levels = -_growing(np.array([0.0, disc.element_mm]), disc.height_mm)[::-1]
    gel = box((0, -disc.height_mm), (disc.radius_mm, 0), (len(lines) - 1, len(levels) - 1), geometry="axisymmetric",
              grading=(lines / disc.radius_mm, (levels + disc.height_mm) / disc.height_mm))
    rim = min(0.9 * disc.ball_mm, 1.2 * disc.radius_mm)

    def to_ball(x):
        rise = disc.ball_mm - np.sqrt(disc.ball_mm**2 - x[:, 0]**2)
        return x + np.column_stack([0 * rise, rise, 0 * rise])

    ball = box((0.0, 0.0), (rim, 0.1 * rim), (2 * int(np.ceil(rim / disc.element_mm)), 1), region="ball",
               geometry="axisymmetric").moved(to_ball)
    mesh = gel.joined(ball, prefix="on ")
    law = make_law("neo_hooke", {"c10": 0.5}, bulk_over_shear=disc.bulk_over_shear)
    body = SolidBody(mesh, {"body": law, "on ball": law}, held={"x0": "x", "y0": "xy"},
                     carried={"ball": ((0, 0, 0), ["on boundary"])})
    body.add(ContactPair(Surface.of(mesh.face("y1")), Surface.of(mesh.face("on y0")), stiffness=_PENALTY / disc.element_mm,
                         reach_mm=2.0, friction=disc.friction, rigid=True, axisymmetric=True))
    return body


def _growing(start: np.ndarray, end: float, *, ratio: float = 1.3) -> np.ndarray:
    """Lines that continue those of `start` with growing distances to `end`."""
    lines, step = list(start), start[-1] - start[-2]
    while end - lines[-1] > 1.2 * ratio * step:
        step *= ratio
        lines.append(lines[-1] + step)
    return np.array([*lines, end])
