"""A press that was written is read back as it was, and what is no press is refused by name."""

from dataclasses import fields, replace

import numpy as np
import pytest
import xarray

import softtact
from softtact.errors import InputError
from softtact.files import read_dataset, write_dataset
from softtact.press.result import PressResult, read_press, wall_time_s
from softtact.readout.registry import labelled
from softtact.readout.taxels import counts_of


def made_up_press():
    """A result of two forces on a map of 5 x 3 points, with other numbers everywhere, and nan where a model does not tell."""
    rng = np.random.default_rng(4)
    numbers = {name: rng.random(2) for name in ("indentation_mm", "contact_area_mm2", "penetration_mm", "frustum_compression_mm",
                                                "wall_time_s", "extrapolated_volume_fraction", "expected_error_mm")}
    return PressResult(deformation_map_mm=rng.random((2, 5, 3)), thinning_map_mm=rng.random((2, 5, 3)),
                       readings={"taxels": labelled(rng.random((2, 7, 4)), ("step", "row", "column"), units="counts")},
                       normal_force_n=np.array([5.0, 20.0]),
                       residual_n=np.full(2, np.nan), iterations=np.array([3, 4]), converged=np.ones(2, dtype=np.int8),
                       within_validity=np.array([1, 0], dtype=np.int8), validity_reason=np.array(["", "too deep"]),
                       x_mm=np.linspace(-11, 11, 3),
                       y_mm=np.linspace(-18.5, 18.5, 5), model="hyperelastic", sensor="coro", solver="dense",
                       selection_reason="two words", least_volume_ratio=np.array([0.8, -0.1]),
                       edge_radius_mm=np.array([0.0, 0.05]), time_s=np.array([0.5, 10.5]),
                       largest_counts=3000.0, **numbers,
                       attributes={"thickness_mm": 2.5, "tips_bonded": 1, "mesh_repairs": "", "friction": "none"})


def assert_same(read, written):
    for one in (one for one in fields(PressResult) if one.compare):
        was, now = getattr(written, one.name), getattr(read, one.name)
        if isinstance(was, np.ndarray):
            assert now.dtype == was.dtype and now.shape == was.shape and now.tobytes() == was.tobytes(), one.name
        elif one.name == "readings":
            assert now.keys() == was.keys() and all(now[name].identical(was[name]) for name in was)
        else:
            assert type(now) is type(was) and now == was, one.name


def test_a_press_is_read_back_to_the_bit(tmp_path):
    written = made_up_press()
    written.write(tmp_path / "press.nc", settings={"a": 1}, seed=7)
    assert_same(read_press(tmp_path / "press.nc"), written)


def test_two_runs_of_a_press_differ_in_an_attribute_of_their_files_alone(tmp_path):
    one = made_up_press()
    for name, result in (("one", one), ("other", replace(one, wall_time_s=2 * one.wall_time_s))):
        result.write(tmp_path / f"{name}.nc")
    one, other = (read_dataset(tmp_path / f"{name}.nc") for name in ("one", "other"))
    assert (other.attrs.pop("wall_time_s") == 2 * one.attrs.pop("wall_time_s")).all() and one.identical(other)


def test_wall_times_of_older_files_and_of_a_single_step_are_read(tmp_path):
    data = made_up_press().to_dataset()
    times = data.attrs.pop("wall_time_s")
    assert (wall_time_s(data.assign(wall_time_s=("step", times))) == times).all()
    assert np.isnan(wall_time_s(data)).all() and len(wall_time_s(data)) == 2
    write_dataset(tmp_path / "one.nc", data.isel(step=[1]).assign_attrs(wall_time_s=times[1:]), seed=1, settings={})
    assert (wall_time_s(read_dataset(tmp_path / "one.nc")) == times[1:]).all()


def test_a_press_of_the_elastic_model_is_read_back_and_written_again_with_the_same_bytes(tmp_path):
    import trimesh

    bar = trimesh.creation.box((1.2, 10.0, 3.0))
    sensor = softtact.load_sensor("coro")
    result = sensor.press(bar, force_n=[5, 20], model="elastic", threads=1)
    result.write(tmp_path / "press.nc")
    read = softtact.read_press(tmp_path / "press.nc")
    assert_same(read, result)
    assert (counts_of(sensor.spec, read.thinning_map_mm) == result.tactile_map).all(), "the counts of the press, from its file"
    assert counts_of(sensor.spec, read.deformation_map_mm)[0].sum() < 0.95 * result.tactile_map[0].sum(), "its points read less"
    read.write(tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "press.nc").read_bytes()


def test_every_field_is_written_but_the_bodies_and_every_array_has_units(tmp_path):
    made_up_press().write(tmp_path / "press.nc")
    with xarray.open_dataset(tmp_path / "press.nc", engine="h5netcdf") as data:
        names = {one.name for one in fields(PressResult)} - {"bodies", "placed_object", "attributes", "x_mm", "y_mm",
                                                           "readings", "solid", "origin"}
        assert names | {"x", "y", "tactile_map"} <= {*data.variables, *data.attrs}
        assert all(variable.attrs.get("units") for variable in data.variables.values())
        assert data.force_n.attrs["units"] == "N" and data.tactile_map.dims == ("step", "row", "column")


def test_the_chosen_models_error_is_nan_where_no_policy_tells(tmp_path):
    replace(made_up_press(), expected_error_mm=None).write(tmp_path / "press.nc")
    assert np.isnan(read_press(tmp_path / "press.nc").expected_error_mm).all()


@pytest.mark.parametrize(("change", "said"), [
    (lambda data: data.drop_vars("force_n"), "it holds no whole press ('force_n' is missing)"),
    (lambda data: data.assign_attrs(solver=None), "it holds no whole press ('solver' is missing)"),
    (lambda data: data.transpose(..., "y", "step"), "'deformation_map_mm' has the dimensions"),
])
def test_a_file_without_a_whole_press_is_refused_by_its_name_and_what_is_missing(change, said, tmp_path):
    data = change(made_up_press().to_dataset())
    data.attrs = {name: value for name, value in data.attrs.items() if value is not None}
    data.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(InputError) as caught:
        read_press(tmp_path / "other.nc")
    assert str(tmp_path / "other.nc") in str(caught.value) and said in str(caught.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_press(tmp_path / "none.nc")
