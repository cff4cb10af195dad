"""Robot skins on the page: a coarse press at small strains while an object moves, and the whole one by a long model where it rests.

The coarse press has a coarse mesh and reads the taxels as parallel plates; the whole one solves the electric field.
"""

from dataclasses import replace

import numpy as np

from softtact.geometry.pose import Pose
from softtact.geometry.repair import Mended
from softtact.play.bench import Pressed, Results
from softtact.play.state import Press, State
from softtact.press.sensor import Sensor
from softtact.press.skin import over_skin, prepared_design
from softtact.skin.analysis import CoarseSkin
from softtact.skin.contact import force_at_depth

_FIRST = 0.04    # share of the largest force that the page begins with: a small object soon presses an elastomer beyond its tests


class OnSkin:
    """A module or a patch; the object comes straight down, so that only the last place counts."""

    refines, is_ready, long_on_release = False, True, True
    models = ("elastic", "solid")

    def __init__(self, sensor: Sensor) -> None:
        design = prepared_design(sensor.spec)
        layout, self._elastomer, thickness = design.layout, design.elastomer, design.design.module.thickness_mm
        self.sensor, self._skin = sensor, CoarseSkin(layout, thickness_mm=thickness, poisson=self._elastomer.poisson,
                                                     permittivity=self._elastomer.permittivity_fe)
        self._coarse = replace(sensor, prepared_models={"elastic": self._skin})
        self.middle_mm = np.append(layout.outline_mm.mean(axis=0), thickness)
        self.size_mm = np.append(np.ptp(layout.outline_mm, axis=0), thickness)
        self.force_range_n: tuple[float, float] = sensor.spec.force_range_n
        self.first_force_n = _FIRST * self.force_range_n[1]
        self._results = Results()
        self.take = self._results.take

    def prepare(self) -> None:
        """See `Bench`."""

    def press(self, state: State, mended: Mended, *, draft: bool) -> Pressed:
        """See `Bench`."""
        del draft
        values = state.pose(mended.mesh, moved=True, middle_mm=self.middle_mm)
        pose = Pose.from_values(values)
        placed = over_skin(self._skin, mended.mesh, pose, self.sensor.spec.name)
        force = state.force_n if state.load_by == "force" else force_at_depth(self._skin, placed, state.depth_mm,
                                                                               elastomer=self._elastomer)
        force = float(f"{force:g}")
        press = Press(state.sensor, state.object, values, force, "elastic", bool(mended.repairs))
        if whole := self._results.get(press):
            press = replace(press, model=whole.model)
        result = whole or self._coarse.press(mended.mesh, pose=pose, force_n=force, model="elastic", label="", threads=1)
        lowered = placed.vertices[0] - pose.apply(mended.mesh.vertices[:1])[0] - [0.0, 0.0, result.indentation_mm[-1]]
        end = pose.translation_mm + lowered, pose.rotation.as_quat(scalar_first=True)
        return Pressed(press, result, end, stage="whole" if whole else "coarse")

    def follows(self, model: str) -> bool:
        """See `Bench`."""
        return False
