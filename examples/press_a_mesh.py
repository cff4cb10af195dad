"""Press a mesh on the sensor and draw the result.

    python examples/press_a_mesh.py config/objects/grasped/object_1.stl --unit mm --force 5 20 50 --out press.png

It prints the indentation, the contact area and the largest count for each force, and draws the deformation of the electrode plane
above the counts of the taxels. The elastic model takes some tenths of a second; its first press prepares the sensor in some ten
seconds and keeps that in the user's cache.
"""

import argparse
from pathlib import Path

import softtact
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose


def main(arguments=None):
    options = parse(arguments)
    sensor = softtact.load_sensor(options.sensor)
    mesh = read_mesh(options.mesh, unit=options.unit)                       # closed, in mm; a bad mesh is refused with a reason
    pose = Pose.from_values(options.pose) if options.pose else None         # None: centred over the sensor, its lowest side down
    result = sensor.press(mesh, pose=pose, force_n=options.force, model=options.model)
    print(f"{result.model} model on {result.sensor}: maps {result.deformation_map_mm.shape}, taxels {result.tactile_map.shape}")
    load_steps = zip(result.normal_force_n, result.indentation_mm, result.contact_area_mm2, result.tactile_map, strict=True)
    for force, depth, area, counts in load_steps:
        print(f"{force:5.1f} N: {depth:.3f} mm deep, {area:.0f} mm2 in contact, up to {counts.max():.0f} counts")
    result.plot(options.out)
    print(f"Drawn: {options.out}")
    return result


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--unit", required=True, help="mm, cm, m or inch")
    parser.add_argument("--force", type=float, nargs="+", default=[5.0, 20.0, 50.0], help="rising, in N")
    parser.add_argument("--pose", type=float, nargs=6, help="x y z in mm, rx ry rz in degrees")
    parser.add_argument("--sensor", default="coro")
    parser.add_argument("--model", default="elastic", choices=("auto", "elastic", "foundation", "hyperelastic"))
    parser.add_argument("--out", type=Path, default=Path("press.png"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
