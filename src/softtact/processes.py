"""Processes that work for this one: they end with it, whatever ends it, and one that is killed is reported in a sentence."""

import contextlib
import ctypes
import multiprocessing
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from types import FrameType
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from softtact.errors import WorkerError

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_PR_SET_PDEATHSIG = 1     # of Linux' prctl: the signal that a process gets when the thread that started it ends
_LOOK_EVERY_S = 0.5       # for the parent, where there is no prctl
# Another program's process: asks for the signal, which survives exec, and becomes the program.
_TIED = (f"import ctypes, os, sys; sys.platform == 'linux' and ctypes.CDLL(None).prctl({_PR_SET_PDEATHSIG}, {signal.SIGKILL:d}); "
         "os.getppid() == int(sys.argv[1]) and os.execvp(sys.argv[2], sys.argv[2:])")


class Terminated(KeyboardInterrupt):
    """SIGTERM: whatever an interrupt (Ctrl-C) keeps, shows and tidies up, this does, too."""


@contextlib.contextmanager
def sigterm_interrupts() -> Iterator[None]:
    """Within the block SIGTERM raises `Terminated` in the main thread, as Ctrl-C raises KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():     # Python lets no other thread set a handler
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated


def end_with(parent: int) -> None:
    """Let the operating system kill this process when `parent`, the process that started it, ends, be it by SIGKILL."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_look_for, args=(parent,), daemon=True).start()     # also if it has ended before the line above


def _look_for(parent):
    while os.getppid() == parent:
        time.sleep(_LOOK_EVERY_S)
    os._exit(1)


def end_after(other: int) -> None:
    """Let this process get SIGTERM when another one, such as its parent's parent, has ended (on Linux)."""
    if hasattr(os, "pidfd_open"):
        with contextlib.suppress(OSError):     # its number is one of another container
            threading.Thread(target=_wait_for, args=(os.pidfd_open(other),), daemon=True).start()


def _wait_for(handle):
    select.select([handle], [], [])
    os.kill(os.getpid(), signal.SIGTERM)


def run_tied(command: Sequence[str], **options: Any) -> subprocess.CompletedProcess:
    """`subprocess.run` of a command that ends with this process (on Linux)."""
    return subprocess.run(_tied(command), **options)


def start_tied(command: Sequence[str], **options: Any) -> subprocess.Popen:
    """`subprocess.Popen` of a command that ends with this process (on Linux)."""
    return subprocess.Popen(_tied(command), **options)


def _tied(command):
    return [sys.executable, "-I", "-S", "-c", _TIED, str(os.getpid()), *command]


def call_apart(function: Callable[..., _Result], *arguments: Any) -> _Result:
    """function(*arguments), called in a process of its own: for code of other programs that crashes, cannot be interrupted, or
    writes into the working folder."""
    result, = map_in_processes(partial(_call, function), [arguments], workers=1)
    return result


def _call(function, arguments):
    return function(*arguments)


def map_in_processes(function: Callable[[_Item], _Result], items: Sequence[_Item], *, workers: int) -> Iterator[_Result]:
    """function(item) of each item, in their order, in processes that end at once if the caller stops or ends.

    A forked process shares the arrays that `function` holds; where there is no fork, each process gets a copy.
    Raises WorkerError if a process is killed, as Linux does where memory runs out, and where the system allows no processes.
    """
    context = multiprocessing.get_context("fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn")
    try:
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(function, os.getpid()))
    except OSError as error:     # of the semaphores, which Linux keeps in /dev/shm
        raise WorkerError(f"No process can be started for this work ({error.strerror or error}), most likely because /dev/shm is "
                          "missing, full or not writable; mount it for writing, or run with --workers 1 where there is this "
                          "option.") from None
    try:
        yield from pool.map(_work, items, chunksize=max(1, len(items) // (8 * workers)))
    except BrokenProcessPool:
        raise WorkerError("A process that worked for this one was killed or crashed, most likely because memory ran out; run again "
                          "with fewer processes (workers), or with smaller or coarser meshes.") from None
    except BaseException:
        for process in list((pool._processes or {}).values()):     # an executor would wait for them; Python 3.14: kill_workers()
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(function, parent):
    """Prepare a new process: the parent reacts to Ctrl-C, and ends it.

    GNU's OpenMP takes one thread alone: with more, a forked process waits without end for those that its parent had.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_with(parent)
    ThreadpoolController().select(prefix="libgomp").limit(limits=1)
    global _function     # the one that a process calls
    _function = function


def _work(item):
    return _function(item)
