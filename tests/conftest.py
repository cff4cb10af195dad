"""The order of the tests where several processes share them (`make test`), and when slow ones may no longer begin."""

import itertools
import os
import time
from datetime import date

import pytest

# Seconds since 1970: slow tests that would begin later are skipped. For continuous integration.
DEADLINE = "SOFTTACT_SLOW_TESTS_UNTIL"


def pytest_collection_modifyitems(config, items):
    """Where processes share the tests, files with slow tests first, so that no long one begins when the others are done.

    Files of the workflow's tests take turns with the others: kernels that many tests need are compiled by one process, once, while
    the other runs commands. With a deadline each day begins with other slow files, so that each has its turn.
    A single process keeps the files' order.
    """
    if not hasattr(config, "workerinput"):
        return
    files = {path: list(group) for path, group in itertools.groupby(items, key=lambda item: item.path)}
    slow = [path for path, group in files.items() if any(item.get_closest_marker("slow") for item in group)]
    if os.environ.get(DEADLINE) and slow:
        first = date.today().toordinal() * len(slow) // 5 % len(slow)
        slow = slow[first:] + slow[:first]
    workflow = [path for path in files if path.parent.name == "workflow"]
    simulated = [path for path in slow if path not in workflow]
    simulated += [path for path in files if path not in workflow and path not in slow]
    turns = itertools.zip_longest(simulated, workflow)
    items[:] = [item for path in itertools.chain.from_iterable(turns) if path is not None for item in files[path]]


def pytest_runtest_setup(item):
    """Skip a slow test that would begin after the deadline."""
    if item.get_closest_marker("slow") and time.time() > float(os.environ.get(DEADLINE) or "inf"):
        pytest.skip("no time was left for this slow test; `make test-slow` runs all of them")
