"""MuJoCo without its graphics: a broken driver that MUJOCO_GL names would otherwise end the import, and with it the physics."""

import os


def import_mujoco() -> None:
    """Import MuJoCo with its graphics off in this process; pictures are drawn in another one (`softtact.robot.render`)."""
    wanted = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        import mujoco  # noqa: F401
    finally:
        if wanted is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = wanted
