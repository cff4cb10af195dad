"""The YAML of a material: the paper's constants, and refusals in one sentence."""

import pytest
import yaml
from table1 import TABLE_1

from softtact.errors import InputError
from softtact.materials.config import law_from_printed, load_material
from softtact.materials.consistency import printed_warnings
from softtact.materials.making import curves_of


def test_the_printed_laws_have_the_papers_constants(material_yaml):
    for (material, law), constants in TABLE_1.items():
        made = law_from_printed(material_yaml(material), law)
        assert made.parameters == constants
        assert made.bulk_modulus == pytest.approx(20 * made.mu0)


def test_default_curves_are_synthetic_and_follow_a_printed_law(material_yaml):
    for material in ("neoprene", "polyurethane"):
        config = load_material(material_yaml(material))
        assert config.curve_settings["kind"] == "synthetic"
        assert config.curve_settings["parameters"] == TABLE_1[material, config.curve_settings["law"]]
        assert config.modes == ["uniaxial", "equibiaxial", "planar"]
        assert config.printed["linear"].parameters == {"young_mpa": 1.289, "poisson": 0.1729}


def test_neoprenes_printed_laws_disagree_six_fold_and_a_warning_says_so(material_yaml):
    sentences = printed_warnings(load_material(material_yaml("neoprene")).fit_settings["printed"])
    assert sentences[0] == (
        "Printed constants: mooney_rivlin and ogden2 disagree 6.3-fold in the initial shear modulus:"
        " 0.362 against 0.0578 MPa."
    )


def test_polyurethanes_printed_laws_disagree_in_compression_only_and_a_warning_says_so(material_yaml):
    sentences = printed_warnings(load_material(material_yaml("polyurethane")).fit_settings["printed"])
    assert not any("initial shear modulus" in sentence for sentence in sentences)
    assert any("uniaxial stretch 0.5: -6.11 against -1.25 MPa" in sentence for sentence in sentences)


def test_the_printed_linear_constants_fit_neither_law_and_a_warning_says_so(material_yaml):
    sentences = printed_warnings(load_material(material_yaml("neoprene")).fit_settings["printed"])
    assert (
        "mean the shear modulus 0.549 MPa, which none of ogden2, mooney_rivlin has" in sentences[-1]
    )


def test_a_law_that_is_not_printed_is_refused_with_those_that_are(material_yaml):
    with pytest.raises(
        InputError, match="neoprene has no printed constants of law 'yeoh'; it has ogden2, mooney_rivlin"
    ):
        law_from_printed(material_yaml("neoprene"), "yeoh")


def test_an_unknown_material_is_refused_with_those_that_are_known(material_yaml):
    with pytest.raises(InputError, match="no such material; known beside it: gel_silicone, neoprene, polyurethane, silicone"):
        load_material(material_yaml("rubber"))


def test_a_users_own_files_are_found_beside_the_yaml(tmp_path):
    files = [{"file": "a.csv", "mode": "uniaxial"}, {"file": "b.csv", "mode": "uniaxial"}]
    text = yaml.safe_dump({"material": "mine", "curves": {"kind": "measured", "files": files}})
    (tmp_path / "mine.yaml").write_text(text)
    config = load_material(tmp_path / "mine.yaml")
    assert config.measured_files == [str(tmp_path / "a.csv"), str(tmp_path / "b.csv")]
    assert config.modes == ["uniaxial"]


def test_a_users_rows_in_disorder_are_refused_unless_the_yaml_says_sort(tmp_path):
    (tmp_path / "a.csv").write_text("stretch,nominal_stress_mpa\n1.0,0\n0.8,-0.3\n1.2,0.2\n")

    def stretches(**options):
        curves = {"kind": "measured", "files": [{"file": "a.csv", "mode": "uniaxial"} | options]}
        (tmp_path / "mine.yaml").write_text(yaml.safe_dump({"material": "mine", "curves": curves}))
        return curves_of(load_material(tmp_path / "mine.yaml").curve_settings)[0].stretch.tolist()

    with pytest.raises(InputError, match="turns back to 0.8"):
        stretches()
    assert stretches(sort=True) == [0.8, 1.0, 1.2]


def test_a_wrong_key_or_value_is_refused_in_one_sentence(tmp_path, material_yaml):
    for path, value, sentence in [
        (["curves", "nois"], 0.1, "the key curves.nois is unknown"),
        (["curves", "noise"], -1, "curves.noise is -1; input should be greater than or equal to 0"),
        (["curves", "kind"], "guessed", "curves is .*guessed"),
        (["curves", "law"], "gent", "no printed constants of law 'gent'; it has ogden2, mooney_rivlin"),
        (
            ["curves", "modes"],
            {"uniaxial": [1.6, 0.6]},
            r"curves.modes.uniaxial is \[1.6, 0.6\]; a window is \[from, to\]",
        ),
        (["fit", "laws"], ["gents"], "Law 'gents' is unknown"),
        (["fit", "laws"], [], r"fit.laws is \[\]; name one law at least, or all of them"),
        (["fit", "weights"], {"planar": float("inf")}, "fit.weights.planar is inf; input should be a finite number"),
        (["fit", "laws"], ["blatz_ko"], "Law 'blatz_ko' describes compressible foams, but a fit assumes"),
        (["fit", "choose"], "blatz_ko", "Law 'blatz_ko' describes compressible foams, but a fit assumes"),
        (["fit", "poisson"], 0.6, "fit.poisson is 0.6; input should be less than 0.5"),
        (
            ["printed", "mooney_rivlin"],
            {"parameters": {"c10": "soft"}},
            "printed.mooney_rivlin.parameters.c10 is 'soft'",
        ),
    ]:
        config = yaml.safe_load(material_yaml("neoprene").read_text())
        section = config
        for key in path[:-1]:
            section = section[key]
        section[path[-1]] = value
        (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
        with pytest.raises(InputError, match=sentence) as refusal:
            load_material(tmp_path / "wrong.yaml")
        assert "\n" not in str(refusal.value), path


def test_a_missing_key_is_named(tmp_path):
    (tmp_path / "short.yaml").write_text("{material: mine}")
    with pytest.raises(InputError, match="short.yaml: the key curves is missing; add it"):
        load_material(tmp_path / "short.yaml")


def test_text_that_is_no_yaml_is_refused(tmp_path):
    (tmp_path / "broken.yaml").write_text("material: [")
    with pytest.raises(InputError, match="broken.yaml: not valid YAML"):
        load_material(tmp_path / "broken.yaml")
