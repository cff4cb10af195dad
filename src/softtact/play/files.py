"""Files that the page writes: presses, recordings and uploaded meshes, all in one folder, none over another."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path, PurePosixPath

import numpy as np

from softtact.errors import InputError
from softtact.imaging.movies import check_movie, write_movie
from softtact.inputs import check_limit
from softtact.outputs import check_output_folder, not_written
from softtact.play.state import Press
from softtact.press.result import PressResult

_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST = 80     # characters of a name
FPS = 10.0        # of a movie


class Folder:
    """The folder that the page writes to."""

    def __init__(self, path: Path) -> None:
        """Raises InputError or OutputError where no file can be written in it."""
        check_output_folder(path)
        self.path = path

    def save_press(self, *pressed: tuple[Press, PressResult]) -> list[Path]:
        """Write NetCDF and PNG of each result, and a text with the command line and the Python lines of each; return the files.

        pressed: the press that is shown, and that of a long model at the same place, if there is one
        """
        with self._new("press", ".txt") as text:
            written = [text]
            for press, result in pressed:
                stem = text.with_name(f"{text.stem}_{result.model}")
                if stem.with_suffix(".nc") in written:     # the long model was auto, which chose the fast one
                    stem = text.with_name(f"{stem.name}_long")
                with_command = replace(result, attributes=result.attributes | {"command": press.command})
                with_command.write(stem.with_suffix(".nc"), settings={"command": press.command})
                result.plot(stem.with_suffix(".png"))
                written += [stem.with_suffix(".nc"), stem.with_suffix(".png")]
            text.write_text("\n".join(f"{press.command}\n\n{press.python}\n" for press, _ in pressed), encoding="utf-8")
        return written

    def save_movie(self, frames: Iterable[np.ndarray]) -> Path:
        """Write an MP4 of frames (h, w, 3) uint8, `FPS` a second. Raises InputError where its writer is not installed."""
        check_movie("recording.mp4")
        with self._new("recording", ".mp4") as path:
            write_movie(path, frames, fps=FPS, options={"crf": "18"})
        return path

    def keep_upload(self, name: str, content: bytes) -> Path:
        """Keep an uploaded file under a safe name; the same file is kept once. Raises InputError for one over the limit."""
        safe = _UNSAFE.sub("_", PurePosixPath(name.replace("\\", "/")).name)[-_LONGEST:].lstrip("._")
        if not safe or not Path(safe).suffix:
            raise InputError(f"{name!r}: the name has no ending such as .stl or .csv; give a file of a mesh or a recording.")
        check_limit(safe, "mesh", len(content))
        folder, stem, suffix = self.path / "uploads", Path(safe).stem, Path(safe).suffix
        for number in count(1):
            path = folder / (safe if number == 1 else f"{stem}_{number}{suffix}")
            if not path.exists() and _claim(path):
                with _deleted_unless_done(path):
                    path.write_bytes(content)
                return path
            if path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content:
                return path
        raise AssertionError("numbers do not end")

    @contextmanager
    def _new(self, stem: str, suffix: str) -> Iterator[Path]:
        """A new file with the next free number, made at once so that no other tab takes it; deleted if the block fails."""
        for number in count(1):
            path = self.path / f"{stem}_{number}{suffix}"
            if next(self.path.glob(f"{stem}_{number}[._]*"), None) is None and _claim(path):
                with _deleted_unless_done(path):
                    yield path
                return


def _claim(path: Path) -> bool:
    """Make an empty file; False if there is one."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("x").close()
    except FileExistsError:
        return False
    except OSError as error:
        raise not_written(path, error) from None
    return True


@contextmanager
def _deleted_unless_done(path: Path) -> Iterator[None]:
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise
