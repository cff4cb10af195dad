"""Curves and files that several tests of the materials share."""

import os
from pathlib import Path

import pytest

from softtact.materials.curves import synthetic_curve
from softtact.materials.laws.registry import make_law
from softtact.sensors.library import SHIPPED

MODES = {"uniaxial": (0.6, 1.6), "equibiaxial": (1.0, 1.4), "planar": (1.0, 1.6)}


@pytest.fixture
def curves_of():
    """Function: law and constants -> curves in the three modes, without noise unless told."""

    def make(law, parameters, *, noise=0.0, points=25, modes=MODES, seed=3):
        law = make_law(law, parameters)
        windows = modes.items()
        return [
            synthetic_curve(law, mode, w, points=points, noise=noise, seed=[seed, i])
            for i, (mode, w) in enumerate(windows)
        ]

    return make


@pytest.fixture
def write_file(tmp_path):
    """Function: text, name -> path of a file with that text."""

    def write(text, name="uniaxial.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def published():
    """Folder of published test data; the test is skipped where it is not at hand."""
    folder = os.environ.get("SOFTTACT_TEST_DATA")
    if not folder:
        pytest.skip("SOFTTACT_TEST_DATA is not set")
    return Path(folder) / "materials"


@pytest.fixture
def material_yaml():
    """Function: name -> path of a material that ships with the package, be it there or not."""
    return lambda name: SHIPPED / "materials" / f"{name}.yaml"
