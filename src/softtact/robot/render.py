"""Pictures of a grasp: the robot drawn off screen by MuJoCo, beside maps and counts of both sensors.

MuJoCo needs EGL (on Debian libegl1, libegl-mesa0 and libgl1-mesa-dri). A driver that fails may crash its process, so the robot is
drawn in another process, `python -m softtact.robot.offscreen FOLDER`. If that fails, a sentence on stderr reports it, and there is
no picture of the robot.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from softtact.drawing import drawn_apart
from softtact.errors import InputError
from softtact.outputs import temporary_folder
from softtact.press.plot import around_points, save
from softtact.processes import start_tied
from softtact.robot.arm import JOINTS
from softtact.robot.events import GraspRecord
from softtact.robot.scene import MM, SENSOR_IN_TOOL, Scene, quaternion

if TYPE_CHECKING:
    import xarray


WHOLE, CLOSE = (60.0, -18.0, 1.9), (20.0, -20.0, 0.28)     # azimuth and elevation in degrees, distance in m
_ABOVE_HAND = np.array([0.0, 0.0, 0.03])     # of the picture's middle, in m
_COMMAND = (sys.executable, "-m", "softtact.robot.offscreen")
_NO_PICTURE = "no picture of the robot: MuJoCo does not draw off screen here"


def draw_rows(scene: Scene, record: GraspRecord, rows: Sequence[int], *, view: tuple[float, float, float] = CLOSE,
              size: tuple[int, int] = (480, 640), timeout_s: float = 120.0) -> np.ndarray | None:
    """Images (row, height, width, 3) of rows of a record, or None, with a sentence on stderr, if MuJoCo cannot draw.

    view: azimuth and elevation in degrees, distance in m, towards the hand or, beyond 1 m, the middle of the arm
    """
    return _drawn(scene.model, [state_of(scene, record, row) for row in rows], [_camera(record, row, view) for row in rows], size,
                  timeout_s)


def draw_states(model: Any, states: Sequence[np.ndarray], *, camera: tuple[float, float, float, float, float, float],
                size: tuple[int, int] = (480, 640), timeout_s: float = 120.0) -> np.ndarray | None:
    """Images (state, height, width, 3) of any mujoco.MjModel in states of its qpos, or None, with a sentence on stderr.

    camera: azimuth and elevation in degrees, distance in m, and the point in m at which it looks
    """
    return _drawn(model, states, [camera] * len(states), size, timeout_s)


def _drawn(model, states, cameras, size, timeout_s):
    with temporary_folder() as folder:
        mujoco.mj_saveModel(model, str(folder / "scene.mjb"), None)
        np.savez(folder / "states.npz", qpos=np.array(states), size=size, camera=cameras)
        images = drawn_apart(_COMMAND, folder, sentence=_NO_PICTURE, timeout_s=timeout_s, environment=_environment())
    return None if images is None else images["images"]


def _environment():
    return os.environ | {"MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl" if sys.platform == "linux" else "")}


class Painter:
    """Draws states of scenes one after the other, in one process that stays until `close`.

    size: (height, width) of the images;  view: azimuth and elevation in degrees, distance in m, towards the hand
    """

    def __init__(self, *, size: tuple[int, int] = (480, 640), view: tuple[float, float, float] = CLOSE) -> None:
        self._size, self._view = size, view
        self._process: subprocess.Popen | None = None
        self._scene: Scene | None = None

    def draw(self, scene: Scene, data: Any) -> np.ndarray:
        """Image (height, width, 3), uint8, of a scene in the state of a mujoco.MjData; InputError where MuJoCo cannot draw here."""
        if self._process is None:
            self._process = start_tied(_COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                       env=_environment())
        hand = np.mean([data.site(f"sensor_{finger}").xpos for finger in SENSOR_IN_TOOL], axis=0)
        state = {"qpos": data.qpos.tolist(), "size": self._size, "camera": [*self._view, *(hand + _ABOVE_HAND).tolist()]}
        with temporary_folder() as folder:
            another = scene is not self._scene
            if another:
                mujoco.mj_saveModel(scene.model, str(folder / "scene.mjb"), None)
            image = self._answer(json.dumps(state | {"scene": str(folder / "scene.mjb") if another else None}))
        self._scene = scene
        return image

    def _answer(self, line):
        process, shape = self._process, (*self._size, 3)
        try:
            process.stdin.write(line.encode() + b"\n")
            process.stdin.flush()
            content = process.stdout.read(int(np.prod(shape)))
        except BrokenPipeError:
            content = b""
        except BaseException:      # an interrupt: the image that nobody reads would be taken for the next one
            self.close()
            raise
        if len(content) < np.prod(shape):
            reason = process.communicate()[1].decode(errors="replace").strip().splitlines() or ["without a message"]
            self.close()
            raise InputError(f"{_NO_PICTURE} ({reason[-1]:.200}); install EGL (on Debian libegl1, libegl-mesa0 and "
                             "libgl1-mesa-dri), or leave render_mode out.")
        return np.frombuffer(content, np.uint8).reshape(shape)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in filter(None, (self._process.stdin, self._process.stdout, self._process.stderr)):
                stream.close()
        self._process = self._scene = None


def state_of(scene: Scene, record: GraspRecord, row: int) -> np.ndarray:
    """MuJoCo's qpos of a row of a record."""
    model = scene.model
    qpos = np.array(model.qpos0)
    for name, angle in zip(JOINTS, record.joint_rad[row], strict=True):
        qpos[model.joint(name).qposadr[0]] = angle
    for finger in SENSOR_IN_TOOL:
        qpos[model.joint(f"finger_{finger}").qposadr[0]] = 0.5 * record.opening_mm[row] * MM
    sensor, seen = record.sensor_pose_world[row, 0], record.object_pose_sensor[row, 0]
    turn = Rotation.from_quat(sensor[3:], scalar_first=True)
    first = model.joint("object").qposadr[0]
    qpos[first:first + 3] = (sensor[:3] + turn.apply(seen[:3])) * MM
    qpos[first + 3:first + 7] = quaternion(turn * Rotation.from_quat(seen[3:], scalar_first=True))
    return qpos


def _camera(record, row, view):
    """A camera's six numbers: `view` and the point (3,) in m at its centre."""
    hand = record.sensor_pose_world[row, :, :3].mean(axis=0) * MM
    near = view[2] < 1.0
    return [*view, *(hand + _ABOVE_HAND if near else [0.35, 0.0, 0.35])]


def draw_grasp(data: "xarray.Dataset", path: str | Path, *, images: Sequence[np.ndarray | None]) -> None:
    """Write a PNG or SVG with a row for each event: the robot, maps of both fingers with their scale, and counts with theirs.

    data: of an `events.nc`;  images: views of the robot, each (event, height, width, 3), or None where it could not be drawn
    """
    from matplotlib.figure import Figure

    views = [view for view in images if view is not None]
    events, first = data.sizes["event"], len(views)
    figure = Figure(figsize=(3.2 * first + 7.6, 2.6 * events + 0.9), layout="constrained")
    grid = figure.subplots(events, 4 + first, squeeze=False, width_ratios=[2.2] * first + [1.0] * 4)
    figure.suptitle(f"{Path(str(data.attrs.get('mesh', 'object'))).name} in the gripper, sensor {data.attrs['sensor']}")
    for event in range(events):
        head = f"{data.event.values[event]}, {float(data.time_s[int(data.event_row[event])]):.2f} s"
        for axis, view in zip(grid[event], views, strict=False):
            axis.imshow(view[event])
            axis.set_axis_off()
        for axis in grid[event, first:]:
            axis.set_xlabel("x (mm)", fontsize=7)
            axis.tick_params(labelsize=7)
        if first:
            grid[event, 0].set_title(head, fontsize=9, loc="left")
        grid[event, first].set_ylabel("y (mm)" if first else f"{head}\ny (mm)", fontsize=7)
    for column, (name, label) in enumerate((("deformation_map_mm", "deformation towards the board (mm)"),
                                            ("tactile_map", "taxels, counts of an ideal readout"))):
        axes = grid[:, first + 2 * column:first + 2 * column + 2]
        shown = _draw_fingers(data, axes, name)
        figure.colorbar(shown, ax=axes, label=label, shrink=0.6).ax.tick_params(labelsize=7)
    save(figure, path)


def _draw_fingers(data, grid, name):
    """Images of an array for each event and finger on axes (event, 2), all of one scale, which is that of the last image."""
    highest = max(float(data[name].max()), 1e-9)
    points = name == "deformation_map_mm"     # the others are cells side by side
    extent = around_points(data.x, data.y) if points else [float(data[axis][end]) for axis in ("x", "y") for end in (0, -1)]
    for (event, finger), axes in np.ndenumerate(grid):
        force, model = -float(data.force_n[int(data.event_row[event]), finger, 2]), data.model.values[event, finger]
        axes.set_title(f"{data.finger.values[finger]}, {force:.3g} N\n{model}", fontsize=8)
        shown = axes.imshow(data[name][event, finger], origin="lower", extent=extent, vmin=0, vmax=highest, cmap="viridis")
    return shown
