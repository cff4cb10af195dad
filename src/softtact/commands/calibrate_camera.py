"""`softtact calibrate-camera`: a gel's shading and scale from presses of a ball, and a sensor's file that names them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.commands.common import add_command, check_names, sensor_path, show
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

if TYPE_CHECKING:
    from softtact.calibration.camera import CameraCalibration

EXAMPLES = """
  softtact calibrate-camera presses/ --ball-mm 4.7 --background untouched.png --out my_gel.yaml
  softtact calibrate-camera press_*.png --ball-mm 6 --mm-per-px 0.063 --circles circles.csv --out my_gel.yaml
  softtact press part.stl --unit mm --sensor my_gel.yaml --motion "z -0.8" --model elastic --image part.png
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "calibrate-camera", _calibrate,
                          "Calibrate the camera of a gel from images of a pressed ball: shading, and size of a pixel.", EXAMPLES)
    command.add_argument("images", metavar="IMAGES", type=Path, nargs="+",
                         help="images of presses of one ball, in different places and depths, or a folder of them")
    command.add_argument("--ball-mm", type=float, required=True, metavar="D", help="diameter of the ball")
    command.add_argument("--background", type=Path, metavar="IMAGE",
                         help="the untouched gel (default: the median of five images or more)")
    command.add_argument("--circles", type=Path, metavar="FILE.csv",
                         help="contacts by hand: columns image, centre_x_px, centre_y_px, radius_px (default: found in the images)")
    command.add_argument("--mm-per-px", type=float, metavar="MM",
                         help="side of a pixel on the gel (default: found from the presses, within some per cent)")
    command.add_argument("--sensor", default="gelsight_mini",
                         help="name or YAML file of the gel whose mechanics, distance and axes are taken (default: gelsight_mini)")
    command.add_argument("--shading", choices=("table", "quadratic", "phong"), default="table",
                         help="kind of the shading (default: table, a polynomial and what a table adds to it)")
    command.add_argument("--out", required=True, type=Path, metavar="MY_GEL.yaml",
                         help="the sensor's file to write; MY_GEL_shading.yaml and MY_GEL_background.png are written beside it")


def _calibrate(options):
    from softtact.sensors.base import read_mapping

    files = _outputs(options.out)
    check_outputs(*files.values())
    check_names({options.out: (".yaml", ".yml")})
    refuse_overwriting([*options.images, options.background, options.circles, sensor_path(options.sensor)], files)
    for name in ("ball_mm", "mm_per_px"):
        value = getattr(options, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name.replace('_', '-')} {value:g}: a length must be above 0; measure it again.")
    base = read_mapping(sensor_path(options.sensor))
    spec = _gel(options.sensor)
    from softtact.calibration.camera import calibrate_camera, read_presses

    presses, background = read_presses(options.images, options.background, options.circles)
    found = calibrate_camera(presses, background, ball_mm=options.ball_mm, mm_per_px=options.mm_per_px,
                             thickness_mm=spec.thickness_mm, poisson=spec.elastic_layer.poisson, kind=options.shading,
                             found=options.circles is None)
    _write(files, found, _sensor_values(base, options.out.stem, found, files))
    summary = _summary(found, files)
    show(summary, as_json=options.json, lines=_lines(summary))


def _outputs(out: Path) -> dict[str, Path]:
    """Files to write, the sensor's file last."""
    return {"shading": out.with_name(f"{out.stem}_shading.yaml"), "background": out.with_name(f"{out.stem}_background.png"),
            "--out": out}


def _gel(name):
    """The specification of a gel of one layer with a camera."""
    from softtact.sensors.specification import read_any_spec

    spec: Any = read_any_spec(sensor_path(name))
    camera = spec.stated_readouts.get("camera")
    if spec.kind != "layers" or camera is None or camera.kind != "camera":
        raise InputError(f"--sensor {name}: it is no gel with a readout 'camera'; take gelsight_mini, gelsight_wonkdim, digit or "
                         "your own.")
    return spec


def _sensor_values(base: dict[str, Any], name: str, found: "CameraCalibration", files: dict[str, Path]) -> dict[str, Any]:
    """Contents of the sensor's file: those of the base, with the camera's new values; without markers, as the images show none."""
    rows, columns = found.background.shape[:2]
    camera = dict(base["readouts"]["camera"]) | {
        "pixels": [columns, rows], "mm_per_px": round(found.mm_per_px, 6), "shading": files["shading"].name,
        "background": files["background"].name, "markers": "none"}
    readouts = {"camera": camera} | {key: entry for key, entry in base["readouts"].items() if entry.get("kind") == "depth"}
    return base | {"name": name, "readouts": readouts}


def _write(files: dict[str, Path], found: "CameraCalibration", values: dict[str, Any]) -> None:
    """Write all files, each whole, the sensor's file, which names the others, last."""
    import yaml
    from PIL import Image

    from softtact.files import atomic_path

    found.shading.save(files["shading"])
    with atomic_path(files["background"]) as temporary:
        Image.fromarray(found.background).save(temporary, format="PNG")
    with atomic_path(files["--out"]) as temporary:
        text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=132, allow_unicode=True)
        temporary.write_text(text, encoding="utf-8")


def _summary(found, files):
    from softtact.calibration.camera import covered_share

    return {"presses": len(found.presses), "circles_found": found.found, "mm_per_px": found.mm_per_px,
            "mm_per_px_found": found.scale_found, "ball_px": found.ball_px, "shading": found.shading.kind,
            "shadow_strength": None if found.shading.lamps is None else found.shading.lamps.strength.tolist(),
            "error_levels": found.error_levels, "covered_share": covered_share(found.presses),
            "circles": [{"image": Path(press.name).name, "centre_x_px": press.centre_px[0], "centre_y_px": press.centre_px[1],
                         "radius_px": press.radius_px} for press in found.presses],
            "written": [str(path) for path in files.values()]}


def _lines(summary):
    how = "found from the presses" if summary["mm_per_px_found"] else "as stated"
    yield (f"presses: {summary['presses']}; a pixel is {summary['mm_per_px']:.4g} mm ({how}), the ball {summary['ball_px']:.4g} px "
           "in radius")
    yield f"error of the shading on presses that it was not fitted to: {summary['error_levels']:.2f} grey levels in the contact"
    strength = summary["shadow_strength"]
    yield ("no shadows are seen around the contacts" if strength is None else "shadows around the contacts take up to "
           + ", ".join(f"{share:.0%} of {name}" for share, name in zip(strength, ("red", "green", "blue"), strict=True)))
    yield (f"the contacts spread over {summary['covered_share']:.0%} of the image; press in its corners, too, as what lies beyond "
           "them is extrapolated")
    yield f"{'image':28}{'column, px':>12}{'row, px':>12}{'radius, px':>12}"
    for one in summary["circles"]:
        yield f"{one['image']:28}{one['centre_x_px']:12.1f}{one['centre_y_px']:12.1f}{one['radius_px']:12.1f}"
    yield from (f"written: {path}" for path in summary["written"])
