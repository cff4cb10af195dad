"""The frustum's law, the compliance and the whole slab of the small sensor: computed once for all tests of the model."""


import pytest
from foundation_study import SMALL
from support.laws import LAWS
from whole_foundation import WholeFoundation

from softtact.models.foundation.compliance import foundation_compliance
from softtact.models.foundation.frustum_spring import frustum_law


@pytest.fixture(scope="session")
def law():
    return frustum_law(SMALL, LAWS["dielectric"])


@pytest.fixture(scope="session")
def compliance(law):
    return foundation_compliance(SMALL, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], frustum=law)


@pytest.fixture(scope="session")
def whole(law):
    return WholeFoundation(SMALL, LAWS, law)
