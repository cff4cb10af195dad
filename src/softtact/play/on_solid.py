"""Sensors of kind solid on the page: the object at first touch, and pressed where the solid model has run.

That model takes seconds to minutes, so it runs as a long one, and its results are kept.
"""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import MissError
from softtact.fem.solid_mesh import fine_triangles
from softtact.geometry.pose import Pose
from softtact.geometry.repair import Mended
from softtact.models.solid.result import SolidFields
from softtact.play.bench import Pressed, Results
from softtact.play.state import Press, State
from softtact.press.kinds import solid_at_rest
from softtact.press.objects import distance_to_touch
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor
from softtact.readout.registry import readings_of

_DOWN = np.array([0.0, 0.0, -1.0])


class OnSolid:
    """A body that the solid model alone presses."""

    refines, is_ready, long_on_release = False, True, True
    models = ("solid",)

    def __init__(self, sensor: Sensor) -> None:
        self.sensor, mesh = sensor, sensor.elements
        assert mesh is not None
        self._face = fine_triangles(mesh.face(sensor.spec.contact.face), mesh.points)
        low, high = self._face.min(axis=(0, 1)), self._face.max(axis=(0, 1))
        self.middle_mm = np.append(0.5 * (low + high)[:2], high[2])
        self.size_mm = np.append(np.ptp(mesh.points[:, :2], axis=0), high[2] - mesh.points[:, 2].min())
        self.force_range_n: tuple[float, float] = sensor.spec.force_range_n
        self.first_force_n = self.force_range_n[1]
        self._results = Results()
        self.take = self._results.take

    def prepare(self) -> None:
        """See `Bench`."""

    def press(self, state: State, mended: Mended, *, draft: bool) -> Pressed:
        """See `Bench`."""
        del draft
        pose = state.pose(mended.mesh, moved=False, middle_mm=self.middle_mm)
        press = Press(state.sensor, state.object, pose, state.load, "solid", bool(mended.repairs))
        touching = self._at_touch(mended.mesh, Pose.from_values(pose))
        if (result := self._results.get(press)) is not None:
            return Pressed(press, result, _moved(touching, result.solid))
        end = touching.translation_mm, touching.rotation.as_quat(scalar_first=True)
        return Pressed(press, self._at_rest(), end, stage="touching")

    def follows(self, model: str) -> bool:
        """See `Bench`."""
        return True

    def _at_touch(self, mesh: trimesh.Trimesh, pose: Pose) -> Pose:
        """The object's pose at first touch."""
        distance = distance_to_touch(pose.apply(mesh.vertices)[mesh.faces], self._face, _DOWN)
        if not np.isfinite(distance):
            spec = self.sensor.spec
            raise MissError(f"The object misses the face {spec.contact.face!r} of {spec.name}; move it over the sensor.")
        return Pose(pose.translation_mm + distance * _DOWN, pose.rotation)

    def _at_rest(self) -> PressResult:
        mesh, nothing = self.sensor.elements, np.zeros(1)
        assert mesh is not None
        return PressResult(
            model="solid", sensor=self.sensor.spec.name, solver="", normal_force_n=nothing, indentation_mm=nothing,
            contact_area_mm2=nothing, penetration_mm=nothing, frustum_compression_mm=np.full(1, np.nan), residual_n=nothing,
            extrapolated_volume_fraction=nothing, iterations=nothing, converged=np.ones(1), within_validity=np.ones(1),
            wall_time_s=nothing, readings=readings_of(self.sensor.readouts, solid_at_rest(self.sensor)),
            solid=SolidFields.of_displacement(mesh, np.zeros((1, *mesh.points.shape))))


def _moved(touching, solid):
    """Translation (3,) and quaternion (4,) of a rigid object after a press, from its pose at first touch and its nodes' paths."""
    before = solid.object_points_mm
    after, middle = before + solid.object_displacement_mm[-1], before.mean(axis=0)
    turn, _ = Rotation.align_vectors(after - after.mean(axis=0), before - middle)
    translation = after.mean(axis=0) + turn.apply(touching.translation_mm - middle)
    return translation, (turn * touching.rotation).as_quat(scalar_first=True)
