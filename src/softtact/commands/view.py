"""`softtact view`: a pressed sensor in a browser, or as a picture."""

import argparse
import os
import sys
import tempfile
from pathlib import Path

from softtact.commands.common import add_command, check_folders, check_names, show

EXAMPLES = """
  softtact press part.stl --unit mm --force 5 --force 20 --model elastic --out press.nc --vtu press.vtu
  softtact view press.nc                           # opens a page that turns; a picture where there is no browser
  softtact view press.vtu --save press.png    # a picture of the whole sensor at the largest force
  softtact view press.nc --page press.html    # the page, to keep or to send
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "view", _view, "Show a pressed sensor from all sides, in a browser or as a picture.", EXAMPLES)
    command.add_argument("result", metavar="RESULT", type=Path,
                         help="the .nc or .vtu file of softtact press, or of a press of solids (.npz, too)")
    command.add_argument("--save", type=Path, metavar="FILE.png", help="draw a picture, and open nothing")
    command.add_argument("--page", type=Path, metavar="FILE.html", help="write the page, and open nothing")


def _view(options):
    from softtact.files import refuse_overwriting
    from softtact.reporting.press_view import save_picture, write_page
    from softtact.reporting.solid_view import read_view

    check_folders(options.save, options.page)
    refuse_overwriting([options.result], {"--save": options.save, "--page": options.page})
    check_names({options.save: (".png",), options.page: (".html",)})
    view = read_view(options.result)
    result = {"page": None, "picture": None, "opened": False, "drawn_with": None, "triangles": len(view.triangles)}
    picture, page = options.save, options.page
    if not picture and not page:
        browser = _browser()
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


def _browser():
    """The browser of this screen, or None where there is no screen or no browser."""
    import webbrowser

    screen = sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    try:
        return webbrowser.get() if screen else None
    except webbrowser.Error:
        return None


def _lines(result):
    if result["page"]:
        yield f"{'opened' if result['opened'] else 'written'}: {result['page']}"
    if result["picture"]:
        yield f"written: {result['picture']} (drawn with {result['drawn_with']})"
