"""How a program ends: one sentence on stderr for what a user can act upon, and an exit status."""

import atexit
import errno
import gc
import os
import sys
from collections.abc import Callable

from softtact.errors import SofttactError, missing_extra
from softtact.outputs import place_for_kernels
from softtact.processes import Terminated, sigterm_interrupts

EXIT_STATUS = {0: "done",
               1: "refused: a file, a value or a combination of options is not usable; one sentence says why and what to do",
               2: "wrong command line: an option or an argument is missing, unknown or not of its kind",
               3: "a press stopped before its last force; the forces before it were printed and written",
               4: "a file could not be read or written, or a process not run: no space, no permission, not enough memory",
               130: "interrupted (Ctrl-C); no half-written file is left",
               143: "ended by SIGTERM; no half-written file is left, as after an interrupt"}
_INTERRUPTED = "what was reached is written and shown, no half-written file is left."
_NO_MEMORY = "there is not enough memory{}; use a coarser mesh, fewer presses at once, fewer processes, or a larger machine."


def run_to_status(name: str, action: Callable[[], None]) -> int:
    """Run `action` with SIGTERM as an interrupt; return its exit status after its sentence, which begins with `name`."""
    atexit.register(gc.freeze)     # else Python looks for cycles among all modules' objects as it ends, a third of a second
    try:
        with sigterm_interrupts(), place_for_kernels():
            action()
        return 0
    except BrokenPipeError:     # `| head` has closed the pipe; the rest of the buffer must not raise at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        ending = _ending(error)
        if ending is None:
            raise
        status, sentence = ending
    print(f"{name}: {sentence}", file=sys.stderr)
    return status


def _ending(error):
    """Exit status and sentence of an error; None for one that no user can act upon."""
    if isinstance(error, SofttactError):
        return error.status, error
    if isinstance(error, ModuleNotFoundError) and (sentence := missing_extra(error)):
        return 1, sentence
    if _is_of_memory(error):
        return 4, _NO_MEMORY.format(f" ({error})" if str(error) else "")
    if isinstance(error, OSError):
        return 4, f"{error.filename or 'a file'}: {error.strerror or error}; make room or choose another place."
    if isinstance(error, KeyboardInterrupt):
        status, how = (143, "ended by SIGTERM") if isinstance(error, Terminated) else (130, "interrupted")
        return status, f"{how}; {_INTERRUPTED}"
    return None


def _is_of_memory(error):
    """Whether memory ran out, in Python, in the system or in torch, which has no error of its own for it on a processor."""
    return (isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
            or (isinstance(error, RuntimeError) and ("allocate memory" in str(error) or "out of memory" in str(error))))
