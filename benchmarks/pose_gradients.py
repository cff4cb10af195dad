"""How right the foundation model's derivatives by the pose are, and what they take: against differences of presses on the coro.

    python benchmarks/pose_gradients.py      (a minute; writes benchmarks/results/pose_gradients.json)

Ellipsoids of falling size and bodies with sharp edges, one force each. Errors are those of deformation maps over the norm of the
difference of presses 0.1 mm or 1 degree to either side, with a tolerance of the forces of 2e-6. A press itself is no smooth
function of the pose: `steps apart` says how far differences by half of that step are from it, and no derivative can be nearer.
Times are the processor's, of a gradient by x, y, rx and ry, and of a press.
"""

import time
import warnings

import numpy as np
import record
import trimesh

import softtact
from softtact.models.foundation import solve

STEPS = {"x": (0, 0.1), "y": (1, 0.1), "rx": (3, 1.0), "ry": (4, 1.0)}     # place in a pose, and mm or degrees to either side
BALL, BODY, TILTED = (0.31, -0.4, 3.0, 6.0, -4.0, 20.0), (0.5, 1.0, 3.0, 0.0, 0.0, 20.0), (0.5, 1.0, 3.0, 3.0, 2.0, 20.0)


def ellipsoid(radius):
    """Semi-axes of 1, 0.8 and 0.9 times a radius in mm."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    return mesh.apply_scale([radius, 0.8 * radius, 0.9 * radius])


CASES = {**{f"ellipsoid of {radius} mm": (ellipsoid(radius), BALL, 5.0) for radius in (2, 3, 4, 6, 10)},
         "box of 6 x 9 mm": (trimesh.creation.box((6, 9, 4)), BODY, 10.0),
         "box of 6 x 20 mm, tilted": (trimesh.creation.box((6, 20, 4)), TILTED, 10.0),
         "cylinder of 3 mm, upright": (trimesh.creation.cylinder(radius=3, height=4, sections=96), BODY, 6.0)}


def compared(sensor, name):
    """The row of one object."""
    mesh, pose, force_n = CASES[name]

    def press(place=0, aside=0.0):
        at = np.array(pose)
        at[place] += aside
        return sensor.press(mesh, pose=at, force_n=force_n, model="foundation", threads=1, label="")

    def difference(place, step):
        return (press(place, step).deformation_map_mm - press(place, -step).deformation_map_mm) / (2 * step)

    start = time.process_time()
    here = press()
    pressed = time.process_time()
    found = here.gradient(of="deformation_map", by=list(STEPS))
    row = {"object": name, "press_s": round(pressed - start, 2), "gradient_s": round(time.process_time() - pressed, 2)}
    for by, (place, step) in STEPS.items():
        wanted, half = difference(place, step), difference(place, 0.5 * step)
        size = np.linalg.norm(wanted)
        row |= {by: round(float(np.linalg.norm(found[by] - wanted) / size), 3),
                f"{by}_steps_apart": round(float(np.linalg.norm(half - wanted) / size), 3)}
    return row


def main():
    """All objects, one after the other."""
    warnings.simplefilter("ignore")
    sensor = softtact.load_sensor("coro")
    sensor.press(*CASES["ellipsoid of 6 mm"][:1], force_n=1.0, model="foundation", label="").gradient(by="x")     # compiles
    solve.settled_contacts.__kwdefaults__["settings"] = solve.FoundationSettings(tolerance=2e-6)
    rows = []
    for name in CASES:
        rows.append(compared(sensor, name))
        print(rows[-1], flush=True)
    record.write("pose_gradients", rows=rows)


if __name__ == "__main__":
    main()
