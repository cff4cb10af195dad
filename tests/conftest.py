"""The order of the tests where several processes share them (`make test`), and when slow ones may no longer begin."""

import itertools
import os
import time
from datetime import date

import pytest

# Seconds since 1970: slow tests that would begin later are skipped. For continuous integration.
DEADLINE = "SOFTTACT_SLOW_TESTS_UNTIL"


# Its presses compile most kernels. Meanwhile the others run tests of these folders, which need hardly any.
COMPILES = ("press", "test_one_sensor.py")
NO_KERNELS = ("evaluation", "learning", "published", "reporting", "study", "workflow")


@pytest.hookimpl(trylast=True)      # when tests that were not asked for have gone
def pytest_collection_modifyitems(config, items):
    """Where processes share the tests, one compiles kernels that many tests need while the others run tests without kernels.

    Where there are slow tests, files with them come first, so that no long one begins when the others are done, and files of the
    workflow's tests take turns with them. With a deadline each day begins with other slow files, so that each has its turn.
    A single process keeps the files' order.
    """
    if not hasattr(config, "workerinput"):
        return
    files = {path: list(group) for path, group in itertools.groupby(items, key=lambda item: item.path)}
    slow = [path for path, group in files.items() if any(item.get_closest_marker("slow") for item in group)]
    order = _slow_first(list(files), slow) if slow else sorted(files, key=_rank)
    items[:] = [item for path in order for item in files[path]]


def _rank(path):
    return 0 if path.parts[-2:] == COMPILES else 1 if path.parent.name in NO_KERNELS else 2


def _slow_first(files, slow):
    if os.environ.get(DEADLINE):
        first = date.today().toordinal() * len(slow) // 5 % len(slow)
        slow = slow[first:] + slow[:first]
    workflow = [path for path in files if path.parent.name == "workflow"]
    simulated = [path for path in slow if path not in workflow]
    simulated += [path for path in files if path not in workflow and path not in slow]
    turns = itertools.zip_longest(simulated, workflow)
    return [path for path in itertools.chain.from_iterable(turns) if path is not None]


def pytest_runtest_setup(item):
    """Skip a slow test that would begin after the deadline."""
    if item.get_closest_marker("slow") and time.time() > float(os.environ.get(DEADLINE) or "inf"):
        pytest.skip("no time was left for this slow test; `make test-slow` runs all of them")
