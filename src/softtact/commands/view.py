"""`softtact view`: a pressed sensor in a browser, or as a picture; a recording as pictures over time."""

import argparse
import sys
import tempfile
from pathlib import Path

from softtact.commands.common import add_command, check_names, find_browser, show
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

EXAMPLES = """
  softtact press part.stl --unit mm --force 5 --force 20 --model elastic --out press.nc --vtu press.vtu
  softtact view press.nc                           # opens a page that turns; a picture where there is no browser
  softtact view press.vtu --save press.png    # a picture of the whole sensor at the largest force
  softtact view press.nc --page press.html    # the page, to keep or to send
  softtact view recording.csv --save recording.png     # both fingers at six times; .gif or .mp4 plays it
  softtact view recording.csv --force-log force.csv --save recording.gif
  softtact view recording.csv --force-log force.csv --save recording.mcap     # converts it to a ROS 2 bag
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "view", _view, "Show a pressed sensor from all sides, or play a recording.", EXAMPLES)
    command.add_argument("result", metavar="RESULT", type=Path,
                         help="the .nc or .vtu file of softtact press, or a recording of a TSF-85: a .csv, or a ROS 2 bag "
                              "(.mcap, folder)")
    command.add_argument("--save", type=Path, metavar="FILE.png",
                         help="draw a picture, and open nothing; of a recording a strip of pictures, or .gif or .mp4; .mcap or "
                              ".rosbag2 writes it as a ROS 2 bag")
    command.add_argument("--force-log", type=Path, metavar="FILE",
                         help="of a recording: the force over time, a .csv with time_s and force_n (or force_n_0, force_n_1), or a "
                              "ROS 2 bag")
    command.add_argument("--baseline", choices=("auto", "subtracted", "kept"), default="auto",
                         help="of a recording: how the recorder wrote it (default: found from the lowest readings)")
    command.add_argument("--topic", action="append", metavar="/NAME",
                         help="of a bag: the topic of the taxels, or of the force, where several fit; repeat it")
    command.add_argument("--page", type=Path, metavar="FILE.html", help="write the page, and open nothing")


def _view(options):
    from softtact.reporting.press_view import read_view, save_picture, write_page

    check_outputs(options.save, options.page)
    refuse_overwriting([options.result, options.force_log], {"--save": options.save, "--page": options.page})
    from softtact.readout.bags import is_bag

    if options.result.suffix.lower() == ".csv" or is_bag(options.result):
        return _view_recording(options)
    if options.force_log or options.baseline != "auto" or options.topic:
        raise InputError(f"{options.result}: --force-log, --baseline and --topic have an effect only on a recording (.csv, or a "
                         "bag); leave them out.")
    check_names({options.save: (".png",), options.page: (".html",)})
    view = read_view(options.result)
    result = {"page": None, "picture": None, "opened": False, "drawn_with": None, "triangles": len(view.triangles)}
    picture, page = options.save, options.page
    if not picture and not page:
        browser = find_browser()
        if browser:
            page = Path(tempfile.mkdtemp(prefix="softtact-")) / f"{options.result.stem}.html"
        else:
            picture = Path(f"{options.result.name}.png")
            print(f"softtact view: there is no browser or no screen here; a picture is drawn: {picture}", file=sys.stderr)
    if page:
        write_page(view, page)
        result |= {"page": str(page), "opened": page != options.page and browser.open(page.as_uri())}
    if picture:
        result |= {"drawn_with": save_picture(view, picture), "picture": str(picture)}
    show(result, as_json=options.json, lines=_lines(result))


def _view_recording(options):
    """Draw a recording as a strip of pictures, a GIF or an MP4."""
    from softtact.readout.bags import FOLDER, write_bag
    from softtact.readout.checks.finding import left_out, zeroed
    from softtact.readout.checks.recording import check_recording
    from softtact.readout.sources import recording_of, with_force_of
    from softtact.reporting.recording_view import save_strip, save_video

    if options.page:
        raise InputError(f"--page {options.page}: a recording is drawn as .png, .gif or .mp4; give --save.")
    picture = options.save or Path(f"{options.result.name}.png")
    check_names({picture: (".png", ".gif", ".mp4", ".mcap", FOLDER)})
    recording = recording_of(options.result, baseline=options.baseline, topics=options.topic or ())
    if options.force_log:
        recording = with_force_of(recording, options.force_log, topics=options.topic or ())
    checked = check_recording(recording)
    found = [one.sentence for one in checked]
    for sentence in (*recording.attrs.get("notes", ()), *found):
        print(f"softtact view: {sentence}", file=sys.stderr)
    wrong = left_out(recording, [one for one in checked if one.check == "wrong reading"])
    shown = zeroed(recording, checked)
    shown = shown.assign(counts=shown.counts.where(~wrong)) if wrong.any() else shown
    if picture.suffix.lower() in (".mcap", FOLDER):
        write_bag(picture, recording)
    else:
        (save_strip if picture.suffix.lower() == ".png" else save_video)(shown, picture)
    result = {"picture": str(picture), "readings": len(recording.time), "seconds": float(recording.time[-1] - recording.time[0]),
              "largest_counts": float(shown.counts.max()), "findings": found}
    show(result, as_json=options.json, lines=[
        f"{result['readings']} readings in {result['seconds']:.3g} s, up to {result['largest_counts']:g} counts",
        f"written: {picture}"])


def _lines(result):
    if result["page"]:
        yield f"{'opened' if result['opened'] else 'written'}: {result['page']}"
    if result["picture"]:
        yield f"written: {result['picture']} (drawn with {result['drawn_with']})"
