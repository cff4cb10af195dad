import pytest
import trimesh
from support.sensors import CORO

pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")


@pytest.fixture(scope="session")
def block():
    """20 x 30 mm on the pads, 24 mm along the closing."""
    return trimesh.creation.box((20, 30, 24))


@pytest.fixture(scope="session")
def coro():
    return CORO
