"""The gallery of the documentation: each picture is there, small, and made by the lines beside it."""

import re

import numpy as np
import pytest
from draw_gallery import ENTRY, FOLDER, PAGE, WIDTH_PX, draw, entries
from PIL import Image

LARGEST = 60_000     # bytes of a picture


def test_every_picture_of_the_page_has_its_lines_and_every_block_its_picture():
    text = PAGE.read_text(encoding="utf-8")
    assert list(entries()) == re.findall(r"\(gallery/(\w+)\.png\)", text) and len(entries()) == 12
    assert text.count("```python") == len(ENTRY.findall(text))
    assert {path.stem for path in FOLDER.glob("*")} == set(entries())


@pytest.mark.parametrize("name", entries())
def test_a_picture_is_small_and_not_empty(name):
    path = FOLDER / f"{name}.png"
    image = Image.open(path)
    assert path.stat().st_size < LARGEST and image.width == WIDTH_PX
    assert np.asarray(image.convert("L")).std() > 10


@pytest.mark.slow
@pytest.mark.parametrize(("name", "lines"), entries().items(), ids=entries())
def test_the_lines_of_a_picture_still_draw_it(name, lines):
    drawn, kept = (np.asarray(image.convert("L").resize((40, 20)), dtype=float) for image in
                   (draw(name, lines), Image.open(FOLDER / f"{name}.png")))
    assert np.abs(drawn - kept).mean() < 12     # of 255: fonts and renderers differ from machine to machine, contents do not
