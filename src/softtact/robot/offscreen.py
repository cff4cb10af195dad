"""Draw states of a scene in a separate process: `python -m softtact.robot.offscreen FOLDER` (see `render`).

Without a folder it draws the state of each line of stdin, until stdin ends. It imports only MuJoCo and NumPy, so a picture does not
wait for the imports of the rest.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np


def main(folder: str | Path) -> None:
    """Draw the states of states.npz in the scene of scene.mjb and write images.npz."""
    import mujoco

    folder = Path(folder)
    mujoco.set_mju_user_warning(lambda text: print(text, file=sys.stderr))     # else it writes MUJOCO_LOG.TXT
    model = mujoco.MjModel.from_binary_path(str(folder / "scene.mjb"))
    data = mujoco.MjData(model)
    with np.load(folder / "states.npz", allow_pickle=False) as states:
        qpos, camera_of, (height, width) = states["qpos"], states["camera"], states["size"]
    images = np.empty((len(qpos), height, width, 3), dtype=np.uint8)
    with mujoco.Renderer(model, height=int(height), width=int(width)) as renderer:
        for number, (position, camera) in enumerate(zip(qpos, camera_of, strict=True)):
            data.qpos[:] = position
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera=_camera(mujoco, camera))
            images[number] = renderer.render()
    np.savez(folder / "images.npz", images=images)


def serve() -> None:
    """Draw a state for each line of stdin, and write each image, (height, width, 3) bytes, to stdout.

    A line is JSON: `scene`, the path of a scene.mjb where it is another one than before, else null; `qpos`, `camera`, `size`
    """
    import mujoco

    images = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)     # what drivers print must not come between the images
    mujoco.set_mju_user_warning(lambda text: print(text, file=sys.stderr))
    renderer: mujoco.Renderer | None = None
    for line in sys.stdin:
        state = json.loads(line)
        if state["scene"]:
            if renderer:
                renderer.close()
            model = mujoco.MjModel.from_binary_path(state["scene"])
            data = mujoco.MjData(model)
            renderer = mujoco.Renderer(model, *state["size"])
        data.qpos[:] = state["qpos"]
        mujoco.mj_forward(model, data)
        assert renderer is not None     # the first line names a scene
        renderer.update_scene(data, camera=_camera(mujoco, state["camera"]))
        images.write(renderer.render().tobytes())
        images.flush()


def _camera(mujoco, values):
    """A free camera of azimuth and elevation in degrees, distance in m and the point (3,) in m at its centre."""
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = values[:3]
    camera.lookat[:] = values[3:]
    return camera


if __name__ == "__main__":
    main(sys.argv[1]) if sys.argv[1:] else serve()
