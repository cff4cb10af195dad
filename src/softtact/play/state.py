"""What one tab of the page presses: object, sensor, place and load; and the command line and Python lines of the same press."""

import shlex
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

_DECIMALS = 4       # of a pose in mm and degrees, in the press itself as in its command line
_SLIDE_STEPS, _TWIST_STEPS = 5, 3


@dataclass(frozen=True)
class Object:
    """A mesh file that is pressed."""

    path: Path
    """The file."""
    unit: str | None
    """Of the file; None where the format states it."""


def free_name(objects: Mapping[str, Object], new: Object) -> str:
    """A name for a new object among others: its file's, with its unit or a number where another object has that name."""
    name = new.path.name
    names = chain([name], [f"{name} ({new.unit})"] if new.unit else [], (f"{name}, {number}" for number in count(2)))
    return next(one for one in names if objects.get(one, new) == new)


@dataclass(frozen=True)
class State:
    """Object, place and load; immutable, so that a press in another thread sees one of them whole."""

    sensor: str
    """Name, or path of a YAML file."""
    object: Object
    """The object."""
    x_mm: float = 0.0
    """The middle of the object's bounding box over the sensor."""
    y_mm: float = 0.0
    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """About the sensor's fixed x, then y, then z axis, through the middle of the object's bounding box."""
    load_by: Literal["force", "depth"] = "force"
    """Which of the two is given."""
    force_n: float = 10.0
    depth_mm: float = 0.3
    slide_mm: tuple[float, float] = (0.0, 0.0)
    """Along x and y, after the press down."""
    twist_deg: float = 0.0
    """About the vertical axis, after the press down."""

    @property
    def moves(self) -> bool:
        """Whether the object moves aside or turns after the press down."""
        return any(self.slide_mm) or bool(self.twist_deg)

    def pose(self, mesh: trimesh.Trimesh, *, moved: bool,
             middle_mm: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)) -> tuple[float, ...]:
        """The pose of a mesh (mm), its lowest point at the middle's height, as six numbers of `Pose.from_values`.

        moved: after slide and twist, where nothing but the last place counts; else before
        middle_mm: of the sensing surface in the sensor's frame
        """
        turn = Rotation.from_euler("xyz", self.rotation_deg, degrees=True)
        place = np.array([self.x_mm, self.y_mm])
        if moved:
            turn, place = Rotation.from_euler("z", self.twist_deg, degrees=True) * turn, place + self.slide_mm
        centre = mesh.bounds.mean(axis=0)
        lowest = turn.apply(mesh.vertices - centre)[:, 2].min()
        shift = np.append(place, -lowest) - turn.apply(centre) + middle_mm
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Gimbal lock")     # at 90 degrees about y one of the other angles is free
            angles = turn.as_euler("xyz", degrees=True)
        return tuple((np.round([*shift, *angles], _DECIMALS) + 0.0).tolist())     # no -0

    @property
    def load(self) -> float | str:
        """The force in N where it is all, else press, slide and twist as the text of a `Motion`."""
        if self.load_by == "force":
            return self.motion(self.force_n) if self.moves else float(f"{self.force_n:g}")
        return f"z -{self.depth_mm:g}" + self.motion(self.force_n).removeprefix(f"fz -{self.force_n:g}")

    def motion(self, force_n: float) -> str:
        """The press, the slide and the twist as the text of a `Motion`."""
        x, y = self.slide_mm
        aside = " ".join(f"{axis} {value:g}" for axis, value in (("x", x), ("y", y)) if value)
        steps = [f"fz -{force_n:g}", *([f"{aside} in {_SLIDE_STEPS}"] if aside else []),
                 *([f"rz {self.twist_deg:g} in {_TWIST_STEPS}"] if self.twist_deg else [])]
        return "; ".join(steps)


@dataclass(frozen=True)
class Press:
    """One press as the command line and `Sensor.press` state it."""

    sensor: str
    """Name or YAML file."""
    object: Object
    """The mesh."""
    pose: tuple[float, ...]
    """Of the mesh in the sensor's frame, as six numbers of `Pose.from_values`."""
    load: float | str
    """A force in N, or the text of a motion."""
    model: str
    """The model's name, or auto."""
    repaired: bool = False
    """Whether the mesh had to be repaired."""

    @property
    def arguments(self) -> list[str]:
        """The words after `softtact`."""
        load = ["--force", f"{self.load:g}"] if isinstance(self.load, float) else ["--motion", self.load]
        unit = ["--unit", self.object.unit] if self.object.unit else []
        return ["press", str(self.object.path), *unit, f"--pose={','.join(self._pose)}", "--sensor", self.sensor, *load,
                "--model", self.model]

    @property
    def command(self) -> str:
        """The command line that gives the same press."""
        return shlex.join(["softtact", *self.arguments, "--out", "press.nc"])

    @property
    def command_lines(self) -> str:
        """The command line with an option on each line."""
        words = [shlex.quote(word) for word in ["softtact", *self.arguments, "--out", "press.nc"]]
        return "".join(f" \\\n    {word}" if word.startswith("--") else f" {word}" for word in words).strip()

    @property
    def python(self) -> str:
        """The lines of Python that give the same press."""
        load = f"force_n={self.load:g}" if isinstance(self.load, float) else f"motion={self.load!r}"
        unit = f", unit={self.object.unit!r}" if self.object.unit else ""
        mesh = f"{str(self.object.path)!r}{unit}"
        read, pressed = ("", mesh)
        if self.repaired:
            read = f"from softtact.geometry.repair import read_mended\n\nmesh = read_mended({mesh}).mesh\n"
            pressed = "mesh"
        return (f"import softtact\n{read}\nsensor = softtact.load_sensor({self.sensor!r})\nresult = sensor.press(\n    {pressed},\n"
                f"    pose=[{', '.join(self._pose)}],\n    {load}, model={self.model!r})")

    @property
    def _pose(self):
        return [f"{value:.{_DECIMALS}f}".rstrip("0").rstrip(".") for value in self.pose]
