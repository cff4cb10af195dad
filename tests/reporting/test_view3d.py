"""The view that turns: self-contained, safe in a page, and refused where its arrays do not fit."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.reporting.view3d import html_view

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
        ({"triangles": [[0, 1, 4]]}, "triangles be made of them"),
        ({"points_mm": np.full((4, 3), np.nan)}, "must be finite"),
        ({"labels": ["a", "b"]}, "1 states and 2 labels"),
        ({"points_mm": np.zeros((2, 4, 3)), "values": np.zeros((3, 4))}, "2 states and its values 3"),
    ]:
        with pytest.raises(InputError, match=re.escape(said)):
            view(**changed)


@pytest.mark.skipif(not shutil.which("chromium"), reason="Chromium is not installed")
def test_a_browser_draws_two_views_in_their_colours(tmp_path):
    """The first is red, the second blue."""
    from imageio.v3 import imread

    page, picture = tmp_path / "page.html", tmp_path / "page.png"
    high = view(values=np.ones(4), limits=(0, 1), map_name="winter_r")
    page.write_text("<!doctype html><meta charset=utf-8>" + view(values=np.zeros(4), limits=(0, 1), map_name="autumn") + high)
    subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
                    f"--screenshot={picture}", "--window-size=600,1200", page.as_uri()],
                   check=True, capture_output=True, timeout=60)
    red, green, blue = imread(picture)[..., :3].astype(int).transpose(2, 0, 1)
    upper, lower = np.s_[60:460], np.s_[640:1100]     # the canvas of either view
    assert (red - np.maximum(green, blue) > 80)[upper].sum() > 10_000
    assert (blue - np.maximum(red, green) > 80)[lower].sum() > 10_000
