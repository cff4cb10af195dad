"""A ball and small sensors, of which the whole package's tests take one copy."""

import pytest
import trimesh
from support.small_sensors import small_coro, small_gel

from softtact.play.solver import Solver
from softtact.play.state import Object, State


@pytest.fixture(scope="package")
def folder(tmp_path_factory):
    """A folder with ball.stl, small.yaml and gel.yaml."""
    folder = tmp_path_factory.mktemp("play")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    ball.apply_translation([3.0, -2.0, 5.0])     # the origin is not its middle
    ball.export(folder / "ball.stl")
    small_coro(folder)
    small_gel(folder)
    return folder


@pytest.fixture(scope="package")
def state(folder):
    """The ball on the small sensor."""
    return State(str(folder / "small.yaml"), Object(folder / "ball.stl", "mm"))


@pytest.fixture(scope="package")
def solver():
    """One that has prepared the small sensor."""
    return Solver()
