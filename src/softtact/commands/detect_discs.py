"""`softtact detect-discs`: contact discs in camera frames."""

import argparse
import sys
from pathlib import Path

from softtact.commands.common import add_command, show
from softtact.errors import InputError
from softtact.outputs import check_outputs

EXAMPLES = """
  softtact detect-discs press.mp4 --pixel-mm 0.03 --out discs.csv
  softtact detect-discs frames/ --calibration-mm 10 --calibration-px 333 --every 5 --out discs.csv
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "detect-discs", _detect_discs,
                           "Measure the bright contact discs in camera frames: table and annotated pictures.", EXAMPLES)
    command.add_argument("frames", metavar="FRAMES", type=Path, help="an image, a multi-page TIFF, a video, or a folder of images")
    command.add_argument("--out", type=Path, required=True, metavar="DISCS.csv", help="the table to write, one row per disc")
    command.add_argument("--pixel-mm", type=float, metavar="MM", help="side of a pixel on the glass")
    command.add_argument("--calibration-mm", type=float, metavar="MM",
                         help="instead of --pixel-mm: a known length in the picture, with --calibration-px")
    command.add_argument("--calibration-px", type=float, metavar="PX", help="its length in pixels")
    command.add_argument("--min-diameter-mm", type=float, default=0.0, metavar="MM", help="leave smaller discs out")
    command.add_argument("--every", type=int, default=1, metavar="N", help="take each N-th frame only (default: 1)")
    command.add_argument("--transfer", choices=("linear", "srgb"),
                         help="values are proportional to light (linear, default), or encoded for a screen (srgb)")
    command.add_argument("--picture", type=Path, metavar="PATH",
                         help="the annotated picture (PNG), or for several frames the folder of theirs "
                              "(default: named after the table, beside it)")
    command.add_argument("--no-picture", action="store_true", help="draw none")


def _detect_discs(options):
    pixel_mm = _pixel_mm(options)
    _check_detect_discs(options)
    check_outputs(options.out)
    from softtact.reporting.disc_report import report_discs

    picture = None if options.no_picture else options.picture or options.out.with_suffix("")
    summary = report_discs(options.frames, options.out, picture=picture, pixel_mm=pixel_mm,
                           smallest_mm=options.min_diameter_mm, every=options.every, transfer=options.transfer)
    for sentence, names in summary["warnings"].items():
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        print(f"softtact detect-discs: warning: {names[0]}{more}: {sentence}", file=sys.stderr)
    show(summary, as_json=options.json, lines=_detect_discs_lines(summary))


def _pixel_mm(options):
    """Side of a pixel in mm, from the options."""
    calibration = (options.calibration_mm, options.calibration_px)
    if (options.pixel_mm is None) == (calibration == (None, None)) or (None in calibration and calibration != (None, None)):
        raise InputError("the scale is not clear; give either --pixel-mm, or both --calibration-mm and --calibration-px.")
    for name in ("pixel_mm", "calibration_mm", "calibration_px"):
        value = getattr(options, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name.replace('_', '-')} {value:g}: a length must be above 0; measure it again.")
    return options.pixel_mm or options.calibration_mm / options.calibration_px


def _check_detect_discs(options):
    if options.no_picture and options.picture:
        raise InputError(f"--picture {options.picture}: it has no effect with --no-picture; leave one of the two out.")
    if options.every < 1:
        raise InputError(f"--every {options.every}: give 1 for all frames, 2 for each second one, and so on.")
    if not 0 <= options.min_diameter_mm < float("inf"):
        raise InputError(f"--min-diameter-mm {options.min_diameter_mm:g}: a diameter cannot be below 0; give one in mm.")
    if options.out.suffix.lower() != ".csv":
        raise InputError(f"{options.out}: the table is written as CSV; give a name that ends in .csv.")


def _detect_discs_lines(summary):
    frames, discs = summary["frames"], sum(frame["discs"] for frame in summary["frames"])
    yield f"frames: {len(frames)}, discs: {discs}, a pixel is {summary['pixel_mm']:.4g} mm"
    yield f"{'frame':24}{'discs':>7}{'mean area, mm2':>16}{'total area, mm2':>17}{'clipped':>9}{'touching':>10}"
    for frame in frames if len(frames) <= 20 else [*frames[:10], None, *frames[-10:]]:
        yield "..." if frame is None else (
            f"{frame['frame']:24}{frame['discs']:7d}{frame['mean_area_mm2'] or 0:16.4f}{frame['total_area_mm2']:17.4f}"
            f"{frame['clipped']:9d}{frame['touching']:10d}")
    yield from (f"written: {summary[name]}" for name in ("table", "picture") if summary[name])
