"""Two sensors on a gripper that is given as MJCF text: force, map and taxels while it holds a capsule, and a picture of it.

    python examples/attach_to_a_gripper.py --out attached_sensor.png
"""

import argparse

import matplotlib
import mujoco
import numpy as np

from softtact.robot import attach
from softtact.robot.render import draw_states

matplotlib.use("Agg")
GRIPPER = """<mujoco><option timestep="0.001" integrator="implicitfast"/>
<visual><headlight ambient=".5 .5 .5" diffuse=".5 .5 .5"/></visual>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1="1 1 1" rgb2=".85 .88 .92" width="64" height="384"/></asset>
<worldbody><body name="palm" pos="0 0 .2">
  <geom type="box" size=".05 .012 .008" pos="0 0 .045" contype="0" conaffinity="0" rgba=".25 .25 .27 1"/>
  <body name="left" pos="-.022 0 0"><joint name="left" type="slide" axis="1 0 0" damping="20"/>
    <geom type="box" size=".005 .012 .03" pos="-.0075 0 .008" mass=".1" rgba=".45 .45 .48 1"/></body>
  <body name="right" pos=".022 0 0"><joint name="right" type="slide" axis="-1 0 0" damping="20"/>
    <geom type="box" size=".005 .012 .03" pos=".0075 0 .008" mass=".1" rgba=".45 .45 .48 1"/></body></body>
  <body name="part" pos="0 0 .2" euler="35 0 0" gravcomp="1"><freejoint/>
    <geom type="capsule" size=".012 .005" mass=".05" rgba=".88 .5 .2 1"/></body></worldbody>
<actuator><motor joint="left" ctrlrange="0 20"/><motor joint="right" ctrlrange="0 20"/></actuator></mujoco>"""


def main(arguments=None):
    """Grip, read, draw; return the readings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--force", type=float, default=10.0, metavar="N", help="of each motor (default: 10)")
    parser.add_argument("--out", default="attached_sensor.png", metavar="FILE")
    options = parser.parse_args(arguments)
    spec = mujoco.MjSpec.from_string(GRIPPER)
    sensors = [attach(spec, "left", "coro", pose=[0, 0, 0, 0, 90, 0]), attach(spec, "right", "coro", pose=[0, 0, 0, 0, -90, 0])]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = options.force
    mujoco.mj_step(model, data, nstep=600)
    readings = [sensor.read(data) for sensor in sensors]
    for sensor, reading in zip(sensors, readings, strict=True):
        print(f"{sensor.body:6} {np.round(reading.force_n, 3)} N, {reading.deformation_map_mm.max():.3f} mm deep, "
              f"largest taxel {reading.tactile_map.max():.0f} counts, {reading.validity_reason or 'valid'}")
    draw(model, data, readings, options.out)
    return readings


def draw(model, data, readings, path):
    """The scene beside map and taxels of both sensors."""
    import matplotlib.pyplot as plt

    images = draw_states(model, [data.qpos], camera=(75.0, -10.0, 0.16, 0.0, 0.0, 0.212))
    figure, axes = plt.subplots(1, 5, figsize=(13, 3.4), width_ratios=[2.6, 1, 1, 1, 1], layout="constrained")
    axes[0].set_axis_off()
    if images is not None:
        axes[0].imshow(images[0])
    for side, (name, reading) in enumerate(zip(("left", "right"), readings, strict=True)):
        for axis, values, label in ((axes[1 + 2 * side], reading.deformation_map_mm, "deformed by (mm)"),
                                    (axes[2 + 2 * side], reading.tactile_map, "taxels (counts)")):
            shown = axis.imshow(values, origin="lower", extent=(-11, 11, -18.5, 18.5))
            axis.set_title(f"{name}, {-reading.force_n[2]:.2f} N\n{label}", fontsize=9)
            figure.colorbar(shown, ax=axis, shrink=0.8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
