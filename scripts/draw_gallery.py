"""Draw the pictures of docs/gallery.md into docs/gallery/: each block of Python there runs in an empty folder, leaves one picture.

    python scripts/draw_gallery.py [NAME ...]      (`make gallery`; by default all)
"""

import argparse
import contextlib
import re
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import matplotlib
from PIL import Image

matplotlib.use("Agg")
ROOT = Path(__file__).resolve().parents[1]
PAGE, FOLDER = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"
WIDTH_PX, COLOURS = 800, 128
ENTRY = re.compile(r"!\[[^\]]+\]\(gallery/(?P<name>\w+)\.png\)\n\n```python\n(?P<lines>.*?)^```", re.MULTILINE | re.DOTALL)


def entries() -> dict[str, str]:
    """{name of a picture: the lines that make it}."""
    return {found["name"]: found["lines"] for found in ENTRY.finditer(PAGE.read_text(encoding="utf-8"))}


def draw(name: str, lines: str) -> Image.Image:
    """The picture that the lines leave, in few colours and 800 px wide. They run in a temporary folder that holds config/."""
    import matplotlib.pyplot as plt

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("config").symlink_to(ROOT / "config")
        try:
            exec(compile(lines, f"gallery.md: {name}", "exec"), {"__name__": name})
        finally:
            plt.close("all")
        image = Image.open(f"{name}.png").convert("RGB")
        image.load()
    if image.width != WIDTH_PX:
        image = image.resize((WIDTH_PX, round(image.height * WIDTH_PX / image.width)), Image.Resampling.LANCZOS)
    return image.quantize(COLOURS, dither=Image.Dither.NONE)


def main(chosen: Mapping[str, str]) -> None:
    """Draw the chosen entries and write their pictures."""
    FOLDER.mkdir(exist_ok=True)
    for name, lines in chosen.items():
        draw(name, lines).save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    names = parser.parse_args().names
    if unknown := set(names) - set(entries()):
        sys.exit(f"{', '.join(sorted(unknown))}: no picture of docs/gallery.md; name some of {', '.join(entries())}.")
    main({name: lines for name, lines in entries().items() if not names or name in names})
