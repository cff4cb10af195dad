"""Fixtures of the tests on the published archive's layout."""

import pytest
from small_archive import Archive


@pytest.fixture
def archive():
    return Archive()
