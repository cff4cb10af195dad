"""Draw states of a scene in a separate process: `python -m softtact.robot.offscreen FOLDER` (see `render`).

It imports only MuJoCo and NumPy, so a picture does not wait for the imports of the rest.
"""

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


def _camera(mujoco, values):
    """A free camera of azimuth and elevation in degrees, distance in m and the point (3,) in m at its centre."""
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = values[:3]
    camera.lookat[:] = values[3:]
    return camera


if __name__ == "__main__":
    main(sys.argv[1])
