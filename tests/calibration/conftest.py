"""The small sensor that the tests of this folder calibrate."""

import pytest
from support.calibration import Bench


@pytest.fixture(scope="session")
def bench(tmp_path_factory):
    return Bench.made(tmp_path_factory.mktemp("bench"))
