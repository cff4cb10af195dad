"""Fixtures of the learning tests."""

import pytest
from formula_study import Study


@pytest.fixture
def study():
    return Study()
