"""A band of readings over friction that is not known."""

import numpy as np
import pytest
import trimesh
from support.gels import SMALL_GEL

from softtact.errors import InputError
from softtact.press.friction_band import press_over_friction
from softtact.press.sensor import load_sensor


@pytest.fixture(scope="module")
def band(tmp_path_factory):
    path = tmp_path_factory.mktemp("gel") / "gel.yaml"
    path.write_text(SMALL_GEL)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=5.0)
    return press_over_friction(load_sensor(path), ball, [0.8, 0.1], motion="z -0.5; x 1.0 in 5")


def test_a_grippier_object_drags_markers_farther(band):
    markers = band.readings("markers")
    assert markers.dims == ("friction", "step", "marker", "axis") and list(markers.friction.values) == [0.1, 0.8]
    rest = markers["rest_x_px"]
    moved = np.abs(markers.sel(axis="x") - rest).isel(step=-1).max("marker").values
    assert moved[1] > 2 * moved[0]


def test_what_slides_carries_its_own_coefficient_times_the_load(band):
    carried = [np.linalg.norm(result.force_n[-1, :2]) / -result.force_n[-1, 2] for result in band.results]
    assert carried[0] == pytest.approx(0.1, rel=1e-3)     # all slides after 1 mm
    assert 0.1 < carried[1] <= 0.8 * (1 + 1e-6)


@pytest.mark.parametrize(("friction", "said"), [([0.5, 0.5], "a band needs at least two different coefficients"),
                                                ([-0.1, 0.5], "friction -0.1: give a number from 0 on")])
def test_coefficients_that_make_no_band_are_refused(friction, said):
    with pytest.raises(InputError, match=said):
        press_over_friction(load_sensor("pad4x4"), trimesh.creation.icosphere(radius=2.0), friction, force_n=1.0)


def test_a_readout_that_the_sensor_lacks_is_refused(band):
    with pytest.raises(InputError, match="small_gel has no readout 'taxels'; its readings are camera, markers"):
        band.readings("taxels")
