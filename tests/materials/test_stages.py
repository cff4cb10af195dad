"""The two stages on files, with the settings that the workflow gives them."""

import json

import pytest

from softtact.errors import InputError
from softtact.files import read_json
from softtact.materials.cards import law_from_card, load_card
from softtact.materials.config import load_material
from softtact.materials.readers import read_curve
from softtact.studies.hybrid.stages import draw, fit_material, make_curves


def as_passed(settings):
    """Settings as they arrive through the command line."""
    return json.loads(json.dumps(settings))


def make(config, folder):
    paths = [folder / f"{mode}.csv" for mode in config.modes]
    make_curves.run(inputs={}, outputs={"curves": paths}, settings=as_passed(config.curve_settings))
    return paths


@pytest.fixture
def polyurethane(material_yaml):
    return load_material(material_yaml("polyurethane"))


def test_synthetic_curves_say_in_the_file_that_they_are_and_how_they_were_made(polyurethane, tmp_path):
    path = make(polyurethane, tmp_path)[0]
    head = path.read_text().splitlines()[:4]
    assert head[1] == "# kind: synthetic"
    assert "mooney_rivlin (c10 0.1706, c01 0.004)" in head[2] and "noise of 0.01" in head[2] and "seed [1, " in head[2]
    assert head[3] == "stretch,nominal_stress_mpa"


def test_the_same_settings_give_the_same_bytes(polyurethane, tmp_path):
    first, second = make(polyurethane, tmp_path / "a"), make(polyurethane, tmp_path / "b")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_two_materials_have_different_noise_under_one_seed(polyurethane, tmp_path):
    other = polyurethane.model_copy(update={"material": "other"})
    one, two = make(polyurethane, tmp_path / "a")[0], make(other, tmp_path / "b")[0]
    assert one.read_text() != two.read_text()


@pytest.mark.slow
def test_the_default_materials_card_has_the_law_that_made_its_curves(polyurethane, tmp_path):
    """Three standard errors of 1 % noise: the fit must not only be near, it must know how near."""
    paths = make(polyurethane, tmp_path)
    settings = as_passed(polyurethane.fit_settings)
    fit_material.run(inputs={"curves": paths}, outputs={"card": tmp_path / "card.json"}, settings=settings)
    card = load_card(tmp_path / "card.json")
    entry = card["laws"]["mooney_rivlin"]
    errors = {name: entry["covariance"][i][i] ** 0.5 for i, name in enumerate(entry["parameter_names"])}
    assert (card["material"], card["kind"], card["chosen"]) == ("polyurethane", "synthetic", "mooney_rivlin")
    assert abs(entry["parameters"]["c10"] - 0.1706) < 3 * errors["c10"]
    assert abs(entry["parameters"]["c01"] - 0.0040) < 3 * errors["c01"]
    assert law_from_card(card).mu0 == pytest.approx(0.3492, rel=0.02)
    assert set(card["laws"]) >= {"neo_hooke", "yeoh", "ogden1", "ogden2", "ogden3", "linear"}
    assert any("-6.11 against -1.25 MPa" in sentence for sentence in card["warnings"])


def test_a_users_own_curves_become_a_measured_card(tmp_path, write_file):
    write_file("strain,kPa\n0,0\n10,60\n20,110\n30,150\n", "tension.csv")
    write_file("stretch,nominal_stress_mpa\n1.0,0\n0.9,-0.07\n0.8,-0.17\n", "compression.csv")
    yaml_path = write_file(
        """
        material: mine
        curves:
          kind: measured
          files:
            - file: tension.csv
              mode: uniaxial
              columns: {engineering_strain_percent: strain, nominal_stress_kpa: kPa}
            - {file: compression.csv, mode: uniaxial}
        fit: {laws: [neo_hooke, mooney_rivlin], choose: neo_hooke}
        """,
        "mine.yaml",
    )
    config = load_material(yaml_path)
    paths = make(config, tmp_path / "curves")
    fit_material.run(
        inputs={"curves": paths}, outputs={"card": tmp_path / "card.json"}, settings=as_passed(config.fit_settings)
    )
    card = read_json(tmp_path / "card.json")
    assert read_curve(paths[0]).window == (0.8, 1.3)
    assert (card["kind"], card["strain_window"]) == ("measured", {"uniaxial": [0.8, 1.3]})
    assert card["curves"][0]["source"] == "tension.csv; compression.csv"


def test_a_mode_without_a_curve_is_refused(polyurethane, tmp_path):
    settings = as_passed(polyurethane.curve_settings)
    with pytest.raises(
        InputError, match="material polyurethane has no shear curve, only uniaxial, equibiaxial, planar"
    ):
        make_curves.run(inputs={}, outputs={"curves": tmp_path / "shear.csv"}, settings=settings)


def test_an_unknown_setting_is_refused(polyurethane, tmp_path):
    settings = as_passed(polyurethane.fit_settings) | {"lawz": "all"}
    with pytest.raises(InputError, match="settings of fit_material: the key lawz is unknown"):
        fit_material.run(inputs={"curves": []}, outputs={"card": tmp_path / "card.json"}, settings=settings)


def test_settings_without_a_material_are_refused(polyurethane, tmp_path):
    curves, fit = polyurethane.curve_settings, polyurethane.fit_settings
    with pytest.raises(InputError, match="settings of make_curves: the key material is missing"):
        make_curves.run(inputs={}, outputs={"curves": tmp_path / "planar.csv"}, settings=without_material(curves))
    with pytest.raises(InputError, match="settings of fit_material: the key material is missing"):
        fit_material.run(inputs={"curves": []}, outputs={"card": tmp_path / "x.json"}, settings=without_material(fit))


def without_material(settings):
    return {key: value for key, value in as_passed(settings).items() if key != "material"}


def test_the_picture_of_a_card_is_drawn_from_its_files(tmp_path, write_file):
    write_file("stretch,nominal_stress_mpa\n0.7,-0.5\n0.9,-0.13\n1.1,0.11\n1.4,0.36\n", "uniaxial.csv")
    write_file("volume_ratio,pressure_mpa\n0.98,0.16\n1,0\n", "volumetric.csv")
    curves = [tmp_path / "uniaxial.csv", tmp_path / "volumetric.csv"]
    settings = {"material": "mine", "laws": ["neo_hooke", "yeoh"]}
    fit_material.run(inputs={"curves": curves}, outputs={"card": tmp_path / "card.json"}, settings=settings)
    pictures = {kind: tmp_path / f"card.{kind}" for kind in ("png", "svg")}
    draw.draw_material(inputs={"card": tmp_path / "card.json", "curves": curves}, outputs=pictures, settings={})
    assert all(path.stat().st_size > 10_000 for path in pictures.values())
    assert all(word in pictures["svg"].read_text() for word in ("<svg", "</svg>"))
