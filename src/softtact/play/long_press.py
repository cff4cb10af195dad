"""A press by a model that takes long, in a process of its own: the very command line that the page shows."""

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

from softtact.errors import SofttactError
from softtact.outputs import temporary_folder
from softtact.play.state import Press
from softtact.press.result import PressResult, read_press
from softtact.processes import start_tied

_NICE = 10         # lower priority than the maps that follow the mouse
_WAIT_S = 5.0     # for a process that was told to end


class LongPress:
    """A press that runs; it ends with the thread that started it."""

    def __init__(self, press: Press, within: Path) -> None:
        """Start a press; its files are in a hidden folder within `within` until `close`."""
        self.press, self._start = press, time.monotonic()
        within.mkdir(parents=True, exist_ok=True)
        self._place = temporary_folder(within)
        self._folder = self._place.__enter__()
        self._file, self._words = self._folder / "press.nc", self._folder / "words.txt"
        with self._words.open("w") as words:
            self._process = start_tied([sys.executable, "-m", "softtact", *press.arguments, "--out", str(self._file)],
                                       stdout=subprocess.DEVNULL, stderr=words, stdin=subprocess.DEVNULL)
        with contextlib.suppress(OSError, AttributeError):      # AttributeError: no POSIX
            os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)

    @property
    def running(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._start

    @property
    def progress(self) -> str:
        """The last line of its progress."""
        lines = self._words.read_text(errors="replace").replace("\r", "\n").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "starting")

    @property
    def stopped(self) -> str:
        """Why it ended before its last load step, in the command's sentence; empty where it was reached."""
        return self.progress.removeprefix("softtact press: ") if self._process.wait() else ""

    def result(self) -> PressResult:
        """The result after the end, of the load steps that were reached. Raises SofttactError, as `stopped`, where none was."""
        if (why := self.stopped) and not self._file.exists():
            raise SofttactError(why)
        return read_press(self._file)

    def close(self) -> None:
        """End the process if it runs, and delete its files."""
        if self.running:
            self._process.terminate()
            try:
                self._process.wait(_WAIT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._place.__exit__(None, None, None)
