"""What `softtact press` adds for gels with a camera: --image, --movie, and a table of force, slip and motion of markers."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.commands.common import check_names
from softtact.errors import InputError, require

if TYPE_CHECKING:
    import numpy as np

    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor

_SECONDS, _MOST_FPS = 2.0, 10      # a movie of few steps lasts as long; one of many shows so many a second


def add_images(command: argparse.ArgumentParser) -> None:
    """The options for images of a sensor with a camera."""
    command.add_argument("--image", type=Path, metavar="FILE.png",
                         help="of a gel with a camera: write its image at the last step (PNG)")
    command.add_argument("--movie", type=Path, metavar="FILE.mp4",
                         help="of a gel with a camera: its images from the untouched gel on, a frame for each step (MP4 or GIF)")


def check_images(options: argparse.Namespace, spec: Any) -> None:
    """Refuse an image or a movie of a sensor without a camera, or of another kind of file."""
    check_names({options.image: (".png",)})
    if options.image:
        require("PIL", options.image)
    if options.movie:
        from softtact.imaging.movies import check_movie

        check_movie(options.movie)
    for option in ("image", "movie"):
        if getattr(options, option) and not camera_names(spec):
            raise InputError(f"--{option} {getattr(options, option)}: {spec.name} has no readout of the kind camera; take a gel "
                             "such as gelsight_mini, add a camera to the sensor's readouts, or leave the option out.")


def camera_names(spec: Any) -> list[str]:
    """Names of a sensor's readouts of the kind camera."""
    return [name for name, entry in spec.stated_readouts.items() if entry.kind == "camera"]


def write_images(result: "PressResult", sensor: "Sensor", image: Path | None, movie: Path | None) -> None:
    """Write the image of the last step, and the movie of all."""
    if not (image or movie):
        return
    from softtact.files import atomic_path
    from softtact.imaging.movies import write_movie

    name = camera_names(sensor.spec)[0]
    frames = result.readings[name].values
    if image:
        from PIL import Image

        with atomic_path(image) as temporary:
            Image.fromarray(frames[-1]).save(temporary, format="PNG")
    if movie:
        write_movie(movie, [_untouched(sensor, name), *frames], fps=min(max(len(frames) / _SECONDS, 1.0), _MOST_FPS))


def _untouched(sensor: "Sensor", name: str) -> "np.ndarray":
    """The camera's image before any contact."""
    from softtact.press.kinds import KINDS

    image: np.ndarray = sensor.readouts[name].read(KINDS[sensor.spec.kind].at_rest(sensor)).values[0]
    return image


def is_image(reading: Any) -> bool:
    """Whether a reading holds images, which are no numbers for people."""
    return {"y", "x"} <= set(reading.dims)


def marker_motion(result: "PressResult") -> "np.ndarray | None":
    """(step, marker) in px: how far each marker moved in the image; None without markers."""
    import numpy as np

    for reading in (result.readings[name] for name in result.readings if name != "taxels"):
        if "rest_x_px" in reading.coords:
            rest = np.column_stack([reading["rest_x_px"].values, reading["rest_y_px"].values])
            return np.linalg.norm(reading.values - rest, axis=2)
    return None


def summary_of_gel(result: "PressResult") -> dict[str, Any]:
    """Share of slipping points and motion of markers at each load step, as plain JSON values; nothing without slip or markers."""
    import numpy as np

    shares, motion = result.slipping_share, marker_motion(result)
    known = {} if np.isnan(shares).all() else {"slipping_share": [None if share != share else share for share in shares.tolist()]}
    if motion is None:
        return known
    return known | {"marker_motion_mean_px": motion.mean(axis=1).tolist(), "marker_motion_most_px": motion.max(axis=1).tolist()}


def gel_lines(summary: dict[str, Any]) -> Iterator[str]:
    """Lines of a sensor without taxels: force, depth, contact, slip, motion of markers."""
    markers = "marker_motion_mean_px" in summary
    yield (f"{'force x, y, z, N':>30}{'depth, mm':>11}{'contact, mm2':>14}{'slipping':>10}"
           + f"{'markers moved, px (mean, most)':>32}" * markers)
    steps = len(summary["force_n"])
    shares = summary.get("slipping_share", [None] * steps)
    for step in range(steps):
        force = "".join(f"{round(value, 4) + 0.0:10.4f}" for value in summary["force_n"][step])      # no -0
        slipping = "-" if shares[step] is None else f"{shares[step]:.0%}"
        moved = "".join(f"{summary[f'marker_motion_{name}_px'][step]:16.2f}" for name in ("mean", "most")) if markers else ""
        yield (f"{force}{summary['indentation_mm'][step]:11.3f}{summary['contact_area_mm2'][step]:14.2f}{slipping:>10}{moved}")
