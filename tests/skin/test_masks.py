"""A load by a mask presses where the picture is dark on white paper, whatever the picture's mode."""

import numpy as np
import pytest
from PIL import Image

from softtact.errors import FrameWarning, InputError
from softtact.skin.loads import mask

ROW, COLUMN = np.mgrid[:60, :60]
INK = (ROW - 29.5)**2 + (COLUMN - 29.5)**2 < 15**2
BLACK, WHITE = np.zeros((60, 60, 3), np.uint8), np.full((60, 60, 3), 255, np.uint8)


def layered(colour, alpha):
    return Image.fromarray(np.dstack([colour, alpha.astype(np.uint8)]), "RGBA")


def area_mm2(picture, path):
    picture.save(path)
    return mask(path, (0.0, 0.0), pixel_mm=0.1, pressure_mpa=0.01).total_n / 0.01


ON_NOTHING = layered(BLACK, 255 * INK)
PICTURES = {"black on white": Image.fromarray(np.where(INK, 0, 255).astype(np.uint8)),
            "16 bits": Image.fromarray(np.where(INK, 20000, 65535).astype(np.uint16)), "black on nothing": ON_NOTHING,
            "grey and alpha": ON_NOTHING.convert("LA"), "a palette with a transparent colour": ON_NOTHING.quantize(4),
            "black on white, opaque": layered(np.where(INK[..., None], BLACK, WHITE), np.full((60, 60), 255)),
            "black on white, in a transparent frame": layered(np.where(INK[..., None], BLACK, WHITE), 255 * (ROW > 5)),
            "faint shadow around it": layered(BLACK, np.where(INK, 255, 100))}


@pytest.mark.parametrize("name", PICTURES)
def test_a_mask_presses_where_ink_is_seen_on_white(name, tmp_path):
    assert area_mm2(PICTURES[name], tmp_path / "print.png") == pytest.approx(0.01 * INK.sum())


def test_what_is_transparent_is_named_in_the_load(tmp_path):
    for name, sentence in (("black on nothing", "(7.16 mm2, without what is transparent)"), ("black on white", "(7.16 mm2)")):
        PICTURES[name].save(tmp_path / "print.png")
        assert sentence in mask(tmp_path / "print.png", (0.0, 0.0), pixel_mm=0.1, pressure_mpa=0.01).words


def test_white_ink_on_nothing_is_refused(tmp_path):
    with pytest.raises(InputError, match="no pixel that is seen is dark, and what is transparent does not press"):
        area_mm2(layered(WHITE, 255 * INK), tmp_path / "print.png")


@pytest.mark.parametrize(("kind", "white"), [("f4", 1.0), ("i4", 255), ("i4", 65535), ("u2", 255), ("u2", 4095)])
def test_the_lightest_pixel_of_more_than_8_bits_is_paper(kind, white, tmp_path):
    picture = Image.fromarray(np.where(INK, 0, white).astype(kind))
    assert area_mm2(picture, tmp_path / "print.tif") == pytest.approx(0.01 * INK.sum())


def test_white_on_black_is_told(tmp_path):
    with pytest.warns(FrameWarning, match="print.png: its whole edge is dark and presses; if the print is white on black, invert"):
        area_mm2(Image.fromarray(np.where(INK, 255, 0).astype(np.uint8)), tmp_path / "print.png")
