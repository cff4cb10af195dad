"""Objects that bend as the sensor does: what a press by the solid model takes in place of a rigid mesh."""

from dataclasses import dataclass

import numpy as np

from softtact.contact.shell import Shell
from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.geometry.pose import Pose
from softtact.materials.laws.base import Law

OBJECT = "object"  # the frame that moves what is pressed


@dataclass(frozen=True)
class SoftObject:
    """A soft object: what bends as the sensor does.

    mesh: in mm, of one region;  law: its hyperelastic law;  held_share: share of its height, from the top, that a rigid holder
    carries;  friction: Coulomb's coefficient against the sensing surface
    """

    mesh: SolidMesh
    """The body in mm, of one region; `softtact.mesh_body` makes one of a closed surface."""
    law: Law
    """Its law."""
    held_share: float = 0.3
    """Share of its height, from the top down, whose surface a rigid holder carries."""
    friction: float = 0.0
    """Coulomb's coefficient against the sensing surface."""

    def __post_init__(self) -> None:
        if not 0 < self.held_share < 1:
            raise InputError(
                f"SoftObject: held_share={self.held_share:g} leaves nothing to hold or nothing to press; give a share "
                "between 0 and 1."
            )
        if len(self.mesh.regions) != 1:
            raise InputError(f"SoftObject: its mesh has the regions {', '.join(self.mesh.regions)}; give a mesh of one region.")

    def placed(self, pose: Pose | None, height_mm: float, shell: Shell) -> SolidMesh:
        """The body in the frame of the solid sensor, whose surface is at `height_mm`, where it just touches pad or shell.

        pose: by default centred; its height does not count. Raises InputError where no node is over the pad.
        """
        points = self.mesh.points
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        points = points - [middle[0], middle[1], 0.0] if pose is None else pose.apply(points)
        over = (np.abs(points[:, :2]) <= 0.5 * np.asarray(shell.footprint_mm)).all(axis=1)
        if not over.any():
            raise InputError(_missing(points, shell.footprint_mm))
        lift = height_mm - points[over, 2].min()
        if (beside := shell.beneath(points)).any():
            lift = max(lift, height_mm - shell.below_mm - points[beside, 2].min())
        return self.with_faces(points + [0.0, 0.0, lift], np.array([0.0, 0.0, -1.0]))

    def with_faces(self, points: np.ndarray, direction: np.ndarray) -> SolidMesh:
        """The body with its nodes at points (n, 3), and faces `held`, its rear as seen along a unit vector (3,), and `pressed`."""
        along = points @ direction
        end = along.min() + self.held_share * np.ptp(along)
        return self.mesh.moved(lambda _: points).with_faces(
            held=lambda x: x @ direction < end, pressed=lambda x: x @ direction >= end
        )


def _missing(points: np.ndarray, footprint_mm: tuple[float, float]) -> str:
    """What is said of an object of which no node is over the sensor."""
    (x0, y0, _), (x1, y1, _) = points.min(axis=0), points.max(axis=0)
    return (
        f"The soft object misses the sensor: it spans x {x0:.4g} to {x1:.4g} mm and y {y0:.4g} to {y1:.4g} mm, and none of its "
        f"nodes is over the {footprint_mm[0]:g} x {footprint_mm[1]:g} mm footprint about the origin; correct its pose."
    )
