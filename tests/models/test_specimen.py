"""One specimen of the sensor: frusta and layers that differ from the nominal ones, the same for the same seed."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from support.sensors import CORO

from softtact.errors import InputError
from softtact.models.hyperelastic.mesh_settings import MeshSettings, frustum_scatter, mesh_settings, newton_settings, specimen_of
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.meshes import layered_mesh
from softtact.studies.hybrid.keys import Mesh

SCATTER = {"height_scatter": 0.01, "tip_scatter": 0.02, "thickness_scatter": 0.02, "specimen": 7}


def thicknesses(spec):
    return spec.dielectric.sheet_thickness_mm, spec.cover.thickness_mm


def test_a_specimen_has_its_own_thicknesses_and_comes_back_with_its_seed():
    one, again = (specimen_of(CORO, SCATTER) for _ in range(2))
    assert thicknesses(one) == thicknesses(again) != thicknesses(specimen_of(CORO, SCATTER | {"specimen": 8}))


def test_thicknesses_scatter_as_asked_for_over_many_specimens():
    drawn = np.array([thicknesses(specimen_of(CORO, SCATTER | {"specimen": seed})) for seed in range(2000)])
    relative = drawn / thicknesses(CORO) - 1
    # Standard error of a standard deviation from 2000 draws: 1.6 %; cut at 2.5 deviations it is 2.2 % less than asked for.
    np.testing.assert_allclose(relative.std(axis=0), 0.02 * 0.978, rtol=0.05)
    assert np.abs(relative.mean(axis=0)).max() < 0.002 and np.abs(relative).max() <= 0.0501
    assert abs(np.corrcoef(relative.T)[0, 1]) < 0.08


def test_without_scatter_of_thickness_the_sensor_stays_as_it_is():
    assert specimen_of(CORO, {"height_scatter": 0.01}) is CORO and mesh_settings(SCATTER) == mesh_settings({})


def test_a_preset_is_a_mesh_by_name_that_other_keys_change():
    assert mesh_settings({"preset": "draft"}) == MeshSettings.draft() and mesh_settings({"preset": "fine"}) == MeshSettings.fine()
    assert mesh_settings({"preset": "light"}) == MeshSettings.light()
    assert mesh_settings({"preset": "draft", "cover_splits": [1, 1]}) == replace(MeshSettings.draft(), cover_splits=(1, 1))
    assert newton_settings({"preset": "draft"}) == NewtonSettings.draft() and newton_settings({}) == NewtonSettings()
    looser = newton_settings({"preset": "draft", "largest_penetration_mm": 0.02})
    assert looser == replace(NewtonSettings.draft(), largest_penetration_mm=0.02)
    with pytest.raises(InputError, match="mesh: there is no preset 'drft'; did you mean 'draft'"):
        mesh_settings({"preset": "drft"})


def test_the_scatter_of_layers_leaves_that_of_the_frusta_as_it_was():
    with_layers, without = (frustum_scatter(CORO, values) for values in (SCATTER, {**SCATTER, "thickness_scatter": 0.0}))
    assert all((a == b).all() for a, b in zip(with_layers, without, strict=True))


def test_the_mesh_of_a_specimen_has_its_thickness():
    small = CORO.model_copy(update={"footprint_mm": (2.4, 2.4), "map_shape": (5, 5)})
    nominal, specimen = (layered_mesh(small, values).points[:, 2] for values in ({}, SCATTER | {"height_scatter": 0.0}))
    wanted = sum(thicknesses(specimen_of(small, SCATTER))) - sum(thicknesses(small))
    assert abs(wanted) > 1e-3 and np.ptp(specimen) - np.ptp(nominal) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize(("values", "said"), [
    ({"cover_heights": [0, 0.5, 0.9]}, r"cover_heights is \(0, 0\.5, 0\.9\); give shares of the height that rise from 0 to 1"),
    ({"cover_heights": [0, 0.6, 0.5, 1]}, "cover_heights is .* that rise from 0 to 1"),
    ({"frustum_heights": [0.2, 0.6, 1]}, "frustum_heights is .* that rise from 0 to 1"),
    ({"frustum_heights": [0, float("nan"), 1]}, "frustum_heights is .* that rise from 0 to 1"),
    ({"cover_heights": 5}, "cover_heights is 5; give shares"), ({"cover_splits": 1}, "cover_splits is 1; give a list"),
    ({"far_pitches": 3}, "far_pitches is 3; use 1, 2 or 4")])
def test_a_mesh_that_would_be_another_sensor_is_refused(values, said):
    with pytest.raises(InputError, match=f"mesh: {said}"):
        mesh_settings(values)


@pytest.mark.parametrize("key", ["height_scatter", "tip_scatter", "thickness_scatter"])
@pytest.mark.parametrize("value", [0.4, -0.1, "much"])
def test_a_scatter_that_turns_sizes_over_is_refused(key, value):
    with pytest.raises(InputError, match=f"mesh: {key} is .*; give a standard deviation .* from 0 to below 0.4"):
        layered_mesh(CORO, {key: value})


@pytest.mark.parametrize("values", [{"cover_heights": [0, 0.5, 0.9]}, {"frustum_heights": [1.0]}, {"height_scatter": 0.4}])
def test_the_key_of_a_study_refuses_the_same(values):
    assert Mesh(cover_heights=[0, 0.5, 1], height_scatter=0.1).height_scatter == 0.1
    with pytest.raises(ValidationError):
        Mesh(**values)
