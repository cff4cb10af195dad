"""Sensor files of `kind: layers`: what they say, what is refused, and a press through each model that takes them."""

import jsonschema
import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.errors import InputError
from softtact.materials.laws.registry import make_law
from softtact.readout.capacitance import EPSILON_0_PF_PER_MM, capacitance_per_area
from softtact.readout.virtual_sensor import make_specimen
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import LayersSpec, SensorSpec, read_spec, sensor_schema, spec_from_dict

SHIPPED = ("sheet", "pad4x4")


def values_of(name="pad4x4", **changes):
    """The keys of a shipped sensor, changed."""
    return yaml.safe_load(sensor_file(name).read_text()) | changes


def written(folder, values):
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_sensor_of_plain_layers_is_described(name):
    spec = read_spec(sensor_file(name))
    assert isinstance(spec, LayersSpec)
    assert spec.thickness_mm == pytest.approx({"sheet": 2.0, "pad4x4": 1.8}[name])
    assert list(softtact.load_sensor(name).laws) == {"sheet": ["dielectric"], "pad4x4": ["dielectric", "cover"]}[name]


@pytest.mark.parametrize("name", ["pad", *SHIPPED])
def test_the_schema_takes_each_kind_and_no_other(name):
    jsonschema.validate(values_of(name), sensor_schema())
    for wrong in ({"kind": "pillars"}, {"nam": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(values_of(name) | wrong, sensor_schema())


def test_a_file_without_a_kind_is_of_frusta():
    values = yaml.safe_load(sensor_file("coro").read_text())
    assert spec_from_dict(values) == spec_from_dict(values | {"kind": "frusta"}) == SensorSpec.from_yaml(sensor_file("coro"))


@pytest.mark.parametrize(("changes", "said"), [
    ({"kind": "pillars"}, "at 'kind': 'pillars' is unknown; use frusta, layers, solid or skin."),
    ({"suport": "base"}, "there is no key 'suport'; did you mean 'support'?"),
    ({"support": "glue"}, "field 'support' is not usable: Input should be 'base' or 'none'"),
    ({"layers": []}, "field 'layers' is not usable: Tuple should have at least 1 item"),
    ({"layers": [{"material": "silicone", "thickness_mm": -1.0}]}, "field 'layers.0.thickness_mm' is not usable"),
    ({"layers": [{"material": "silicone", "thicknes_mm": 1.0}]}, "there is no key 'thicknes_mm'; did you mean 'thickness_mm'?"),
    ({"friction": {"board": 0.3}}, "there is no key 'board'"),
    ({"readouts": {"left/right": {"kind": "capacitance"}}}, "at 'readouts': a file of results cannot hold the name 'left/right'"),
])
def test_a_wrong_file_is_refused_by_file_and_field(changes, said, tmp_path):
    path = written(tmp_path, values_of(**changes))
    with pytest.raises(InputError) as refused:
        softtact.load_sensor(path)
    assert str(path) in str(refused.value) and said in str(refused.value)


def test_the_linear_layer_follows_the_law_that_is_given_for_the_only_layer(tmp_path):
    """Ten times as stiff: a modulus ten times as large, where the file leaves it to the law."""
    values = values_of("sheet")
    del values["elastic_layer"]
    path = written(tmp_path, values)
    soft, stiff = (softtact.load_sensor(path, materials={"dielectric": make_law("neo_hooke", {"c10": c10}, bulk_over_shear=20)})
                   for c10 in (0.2, 2.0))
    assert stiff.spec.elastic_layer.young_mpa == pytest.approx(10 * soft.spec.elastic_layer.young_mpa)
    assert soft.spec.elastic_layer.young_mpa == pytest.approx(9 * 20 * 0.4 / (3 * 20 + 1))     # 9 K G / (3 K + G), G = 2 c10
    stated = softtact.load_sensor("sheet", materials={"dielectric": make_law("neo_hooke", {"c10": 2.0}, bulk_over_shear=20)})
    assert stated.spec.elastic_layer == softtact.load_sensor("sheet").spec.elastic_layer


def test_where_frusta_are_needed_a_sensor_without_is_refused():
    with pytest.raises(InputError, match="at 'kind': 'layers' is not the required kind; give a sensor of kind frusta"):
        SensorSpec.from_yaml(sensor_file("sheet"))
    part = trimesh.creation.icosphere(radius=3.0)
    with pytest.raises(InputError, match="sheet has no frusta, which the foundation model needs; press with elastic or hyper"):
        softtact.load_sensor("sheet").press(part, force_n=1.0, model="foundation")
    with pytest.raises(InputError, match="sheet has no frusta, which the virtual sensor needs"):
        make_specimen(read_spec(sensor_file("sheet")), seed=1)
    with pytest.raises(InputError, match="sheet has no layer 'cover'"):
        softtact.load_sensor("sheet", materials={"cover": softtact.load_sensor("coro").laws["cover"]})


def test_a_plain_dielectric_is_a_plate_capacitor():
    """C / A = eps0 eps_r / d: 8.854e-3 pF/mm x 2.7 / 2 mm, and twice as much where it is half as thick."""
    spec = read_spec(sensor_file("sheet"))
    assert capacitance_per_area(spec, np.array([0.0, 1.0])) == pytest.approx(EPSILON_0_PF_PER_MM * 2.7 / np.array([2.0, 1.0]))


@pytest.fixture(scope="module")
def presses(tmp_path_factory):
    """The pad with coarser elements, from a file of one's own, pressed by each model that takes it, and by each policy."""
    folder = tmp_path_factory.mktemp("layers")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        sensor = softtact.load_sensor(written(folder, values_of(element_mm=1.0, map_shape=[17, 11])))
        part = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
        ways = {"elastic": {"model": "elastic"}, "hyperelastic": {"model": "hyperelastic", "keep_body": True},
                "error": {"policy": "error"}}
        return {name: sensor.press(part, force_n=[0.5, 2.0], threads=1, **how) for name, how in ways.items()}


def test_both_models_press_a_users_own_file(presses):
    for model in ("elastic", "hyperelastic"):
        result = presses[model]
        assert result.deformation_map_mm.shape == (2, 17, 11) and result.tactile_map.shape == (2, 4, 4)
        middle = result.deformation_map_mm[:, 8, 5]
        assert (middle == result.deformation_map_mm.max(axis=(1, 2))).all() and 0 < middle[0] < middle[1] < 1.0
        assert (np.diff(result.indentation_mm) > 0).all() and result.converged.all()
        assert result.tactile_map[1].max() > result.tactile_map[0].max() > 0


def test_the_policy_error_presses_the_hyperelastic_model_without_frusta(presses):
    assert presses["error"].model == "hyperelastic" and "has no frusta" in presses["error"].selection_reason
    np.testing.assert_array_equal(presses["error"].deformation_map_mm, presses["hyperelastic"].deformation_map_mm)


def test_the_deformed_body_has_its_two_layers(presses, tmp_path):
    body = presses["hyperelastic"].pressed_body()
    assert {cells.region for cells in body.cells} == {"sheet", "cover"}
    presses["hyperelastic"].write_vtu(tmp_path / "pad.vtu")
    assert (tmp_path / "pad.vtu").stat().st_size > 0
