"""Processes end with the one that started them, and what ends a program is a sentence and an exit status.

A process that outlives its parent says so through a pipe, which the test reads to its end, when the last holder has gone.
"""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from softtact.cli import main
from softtact.commands import mesh as mesh_command
from softtact.errors import WorkerError
from softtact.processes import call_apart, map_in_processes

OUTLIVED_S = 120     # after which a process that should be gone says so
PARENT = f"""
import os, sys, time
from softtact import processes

def work(item):
    os.write({{fd}}, b"began ")
    time.sleep({OUTLIVED_S})
    os.write({{fd}}, b"outlived")
    os._exit(1)

list(processes.map_in_processes(work, range(2), workers=2))
"""
TIED = f"""
import sys
from softtact.processes import run_tied
run_tied([sys.executable, "-c", "import os, time; os.write({{fd}}, b'began began '); time.sleep({OUTLIVED_S}); "
                                "os.write({{fd}}, b'outlived')"], pass_fds=[{{fd}}])
"""


STAGE = f"""
import os, subprocess, sys
stage = "import os, time; from softtact.studies import __main__ as runner; runner.run_stage = lambda options: [" \\
    "os.write({{fd}}, b'began began '), time.sleep({OUTLIVED_S}), os.write({{fd}}, b'outlived')]; runner.main(['any'])"
os.environ["SOFTTACT_WORKFLOW"] = str(os.getpid())
subprocess.run(["sh", "-c", '"$0" -c "$1"; true', sys.executable, stage], pass_fds=[{{fd}}], stderr=subprocess.DEVNULL)
"""


def read_to_the_end(reader):
    return b"".join(iter(lambda: os.read(reader, 100), b""))


@pytest.fixture
def pipe():
    """(reader, writer); a test that gives the writer away closes its own."""
    reader, writer = os.pipe()
    os.set_inheritable(writer, True)
    yield reader, writer
    os.close(reader)


def said_after(number, script, pipe):
    """What the processes of a script say after both have begun and the script has got a signal; and the script's end."""
    reader, writer = pipe
    script = subprocess.Popen([sys.executable, "-c", script.format(fd=writer)], pass_fds=[writer], stderr=subprocess.PIPE)
    os.close(writer)
    begun = b""
    while len(begun) < len(b"began began "):
        begun += os.read(reader, 1)
    script.send_signal(number)
    return read_to_the_end(reader), script.wait()


@pytest.mark.parametrize("script", [PARENT, PARENT.replace("def work", "sys.platform = 'elsewhere'\ndef work"), TIED,
                                    STAGE], ids=["workers", "workers without prctl", "another program", "stage of a workflow"])
def test_processes_end_with_a_parent_that_is_killed(script, pipe):
    assert said_after(signal.SIGKILL, script, pipe) == (b"", -signal.SIGKILL)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_to_the_parent_ends_its_processes_at_once_and_is_its_exit_status(number, status, pipe):
    listening = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"     # in the background it is ignored
    called = PARENT.replace("list(", "from softtact.exits import run_to_status\nsys.exit(run_to_status('all', lambda: list(")
    ended = listening + called
    assert said_after(number, ended.rstrip() + "))", pipe) == (b"", status)


def test_sigterm_is_an_interrupt_of_every_command_and_of_nothing_after_it(monkeypatch, capsys):
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    monkeypatch.setattr(mesh_command, "_complexity", lambda options: os.kill(os.getpid(), signal.SIGTERM))
    try:
        assert main(["complexity", "part.stl", "--unit", "mm"]) == 143
        assert capsys.readouterr().err.startswith("softtact complexity: ended by SIGTERM; what was reached is written")
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)


def test_who_stops_reading_ends_the_processes(pipe):
    def work(item):
        if item:
            time.sleep(OUTLIVED_S)
            os.write(pipe[1], b"outlived")
        return item

    results = map_in_processes(work, range(2), workers=2)
    assert next(results) == 0
    results.close()
    os.close(pipe[1])
    assert read_to_the_end(pipe[0]) == b""


def test_a_process_that_is_killed_is_a_sentence_with_the_remedy():
    with pytest.raises(WorkerError, match="was killed or crashed, most likely because memory ran out; run again with fewer"):
        list(map_in_processes(lambda item: os.kill(os.getpid(), signal.SIGKILL), range(4), workers=2))


def test_where_no_process_can_be_started_the_remedy_is_told(monkeypatch):
    def refused(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("_multiprocessing.SemLock", refused)
    with pytest.raises(WorkerError, match=r"^No process can be started .*Read-only file system.*/dev/shm .*; mount it for writing"):
        call_apart(abs, -1)


def test_what_a_process_raises_is_raised_here():
    with pytest.raises(ZeroDivisionError):
        call_apart(lambda a, b: a / b, 1, 0)
    assert call_apart(lambda a, b: a / b, 1, 2) == 0.5


def test_memory_that_does_not_suffice_is_a_sentence(monkeypatch, capsys):
    monkeypatch.setattr(mesh_command, "_complexity", lambda options: np.empty(1 << 50))
    assert main(["complexity", "part.stl", "--unit", "mm"]) == 4
    assert "softtact complexity: there is not enough memory (Unable to allocate 8.00 PiB" in capsys.readouterr().err


def test_a_process_works_after_this_one_has_used_threads_of_openmp():
    """GNU's OpenMP waits in a forked process for its parent's threads, without end."""
    pytest.importorskip("torch")
    script = ("import torch\n"
              "from softtact.processes import call_apart\n"
              "def summed():\n"
              "    return float(torch.nn.functional.max_pool2d(torch.ones(64, 80, 57, 33), 2, 1).sum())\n"
              "torch.set_num_threads(2)\n"
              "assert summed() == call_apart(summed)\n")
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
