"""The view that turns: self-contained, safe in a page, and refused where its arrays do not fit."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.reporting.view3d import ColourScale, html_view

POINTS = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def view(**changed):
    options = {"points_mm": POINTS, "triangles": FACES, "values": POINTS[:, 2], "title": "A corner", "unit": "mm"} | changed
    return html_view(options.pop("points_mm"), options.pop("triangles"), options.pop("values"), **options)


def test_a_view_asks_for_nothing_from_outside():
    assert not re.search(r"https?://|\bsrc=|\bimport\b|fetch\(|XMLHttpRequest", view())


def test_titles_and_labels_cannot_end_the_script_or_add_tags():
    text = view(title="</figure><b>", values=np.stack([POINTS[:, 0], POINTS[:, 1]]), labels=["</script>", "2"])
    assert "<b>" not in text and text.count("</script>") == 1


def test_arrays_that_do_not_fit_are_refused():
    for changed, said in [
        ({"values": np.zeros(3)}, "values (n,); these are"),
        ({"triangles": [[0, 1, 4]]}, "triangles must refer to them"),
        ({"points_mm": np.full((4, 3), np.nan)}, "must be finite"),
        ({"labels": ["a", "b"]}, "1 states and 2 labels"),
        ({"points_mm": np.zeros((2, 4, 3)), "values": np.zeros((3, 4))}, "2 states and its values 3"),
    ]:
        with pytest.raises(InputError, match=re.escape(said)):
            view(**changed)


needs_browser = pytest.mark.skipif(not shutil.which("chromium"), reason="Chromium is not installed")


def drawn(folder, text, *, window):
    """Red, green and blue (rows, columns) of a browser's picture of a page."""
    from imageio.v3 import imread

    page, picture = folder / "page.html", folder / "page.png"
    page.write_text(f"<!doctype html><meta charset=utf-8>{text}")
    subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}",
                    f"--screenshot={picture}", f"--window-size={window[0]},{window[1]}", page.as_uri()],
                   check=True, capture_output=True, timeout=600)
    return imread(picture)[..., :3].astype(int).transpose(2, 0, 1)


@needs_browser
@pytest.mark.parametrize("window", [(1400, 900), (390, 800)])
def test_a_tall_thing_is_whole_in_a_wide_and_in_a_narrow_window(window, tmp_path):
    """Its parts at the top and at the bottom, in yellow, are both seen."""
    corners = np.array([[x, y, z] for z in (0, 90) for x, y in ((0, 0), (9, 0), (0, 9))], dtype=float)
    text = view(points_mm=corners, triangles=[[0, 1, 2], [3, 4, 5]], values=np.ones(6), scale=ColourScale((0, 1)))
    red, _, blue = drawn(tmp_path, text, window=window)
    height = min(0.75 * window[0], 0.75 * window[1])
    top = int(np.flatnonzero((red - blue > 80).any(axis=1))[0])     # the colour bar lies below the canvas
    yellow = (red - blue > 80)[:top + int(height)].any(axis=1)
    assert np.count_nonzero(np.diff(yellow.astype(int)) == 1) >= 2 and top > 5


@needs_browser
def test_a_browser_draws_two_views_in_their_colours(tmp_path):
    """The first is red, the second blue."""
    high = view(values=np.ones(4), scale=ColourScale((0, 1), "winter_r"))
    text = view(values=np.zeros(4), scale=ColourScale((0, 1), "autumn")) + high
    red, green, blue = drawn(tmp_path, text, window=(600, 1200))
    upper, lower = np.s_[60:460], np.s_[640:1100]     # the canvas of either view
    assert (red - np.maximum(green, blue) > 80)[upper].sum() > 10_000
    assert (blue - np.maximum(red, green) > 80)[lower].sum() > 10_000
