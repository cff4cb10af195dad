"""Examples that the command prints are files that it reads."""

import pytest
import yaml

import softtact
from softtact.cli import main
from softtact.commands.config_example import FILES
from softtact.errors import InputError
from softtact.sensors.specification import read_any_spec


@pytest.mark.parametrize("kind", FILES["sensor"])
def test_an_example_of_a_sensor_is_one_outside_of_the_source(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["config-example", "sensor", "--kind", kind]) == 0
    (tmp_path / "my.yaml").write_text(capsys.readouterr().out)
    if kind != "gel":     # whose shading is a file of the package
        assert read_any_spec(tmp_path / "my.yaml").name


@pytest.mark.parametrize(("what", "kind"), [(what, kind) for what in ("study", "material") for kind in FILES[what]])
def test_every_other_example_is_yaml(what, kind, capsys):
    assert main(["config-example", what, "--kind", kind]) == 0
    assert isinstance(yaml.safe_load(capsys.readouterr().out), dict)


def test_an_example_never_replaces_a_file(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text("mine")
    assert main(["config-example", "sensor", "--out", str(tmp_path / "mine.yaml")]) == 1
    assert "the file is there" in capsys.readouterr().err and (tmp_path / "mine.yaml").read_text() == "mine"
    assert main(["config-example", "sensor", "--kind", "cube"]) == 1
    assert "use one of frusta, layers, gel, solid" in capsys.readouterr().err


def test_the_linear_layer_of_a_single_layer_follows_from_its_law(tmp_path, capsys):
    main(["config-example", "sensor", "--kind", "layers"])
    values = yaml.safe_load(capsys.readouterr().out)
    stated = values.pop("elastic_layer")
    (tmp_path / "my.yaml").write_text(yaml.safe_dump(values))
    found = softtact.load_sensor(tmp_path / "my.yaml").spec.elastic_layer
    assert found.young_mpa == pytest.approx(stated["young_mpa"], rel=1e-3)
    assert found.poisson == pytest.approx(stated["poisson"], abs=1e-4)
    values["layers"].append({"material": "silicone", "thickness_mm": 0.5})
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(values))
    with pytest.raises(InputError, match="at 'elastic_layer': it is missing"):
        softtact.load_sensor(tmp_path / "two.yaml")
