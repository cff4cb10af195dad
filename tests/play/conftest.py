"""A ball and small sensors, of which the whole package's tests take one copy."""

from dataclasses import replace

import pytest
import trimesh
from support.small_sensors import small_block, small_coro, small_gel, small_skin

from softtact.play.solver import Solver
from softtact.play.state import Object, State


@pytest.fixture(scope="package")
def folder(tmp_path_factory):
    """A folder with ball.stl, small.yaml, gel.yaml, block.yaml with its mesh, and skin.yaml."""
    folder = tmp_path_factory.mktemp("play")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    ball.apply_translation([3.0, -2.0, 5.0])     # the origin is not its middle
    ball.export(folder / "ball.stl")
    small_coro(folder)
    small_gel(folder)
    small_block(folder)
    small_skin(folder)
    return folder


@pytest.fixture(scope="package")
def state(folder):
    """The ball on the small sensor."""
    return State(str(folder / "small.yaml"), Object(folder / "ball.stl", "mm"))


@pytest.fixture(scope="package")
def on_skin(state, folder):
    """The ball on a skin, with a solver."""
    return replace(state, sensor=str(folder / "skin.yaml"), force_n=0.3), Solver()


@pytest.fixture
def on_block(state, folder):
    """The ball on a solid, by 0.5 mm, with a solver of its own."""
    return replace(state, sensor=str(folder / "block.yaml"), load_by="depth", depth_mm=0.5), Solver()


@pytest.fixture(scope="package")
def pressed_block(state, folder):
    """The result of that press by the Python lines that the page shows."""
    on_block, names = replace(state, sensor=str(folder / "block.yaml"), load_by="depth", depth_mm=0.5), {}
    exec(Solver().solve(on_block).press.python, names)
    return names["result"]


@pytest.fixture(scope="package")
def solver():
    """One that has prepared the small sensor."""
    return Solver()
