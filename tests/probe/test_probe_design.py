"""A design that cannot be built is refused in one sentence that names the key."""

from pathlib import Path

import pytest
import yaml
from support.probes import small_design

from softtact.errors import InputError
from softtact.probe.design import Material, check_design, load_design
from softtact.probe.structure import structure_mesh

TISSUE = {"law": "yeoh", "bulk_mpa": 1.0, "source": "a test's"}


@pytest.mark.parametrize(("changes", "said"), [
    ({"films": {"left": {"end": 16}}}, "film left from 0 to 16 mm does not lie on the left support"),
    ({"tissue_on_beam": 0.3, "beam_on_base": 0.3}, "loose on both sides"),
    ({"tissue_on_beam": -0.3}, "tissue_on_beam"),
    ({"displacement_mm": {"to": 15.0}}, "more than the tissue's height"),
    ({"lump": {"x": 2.0, "depth": 5, "width": 5, "height": 5, "stiffness_ratio": 9}}, "leaves the tissue"),
    ({"beam": {"poisson": 0.5}}, "less than 0.5"),
    ({"beam": {"bulk_mpa": 5.0}}, "young_mpa and poisson"),
    ({"tissues": {"rubber": TISSUE}}, "yeoh needs its parameters"),
    ({"filler": {"stretch_window": (1.5, 0.8)}}, "stretch_window is from 1.5 to 0.8; give the lowest .*, below 1"),
    ({"filler": {"stretch_window": (1.0, 1.5)}}, "stretch_window is from 1 to 1.5; give the lowest .*, below 1"),
    ({"tissue": {}}, "did you mean 'tissues'"),
    ({"mesh": {"beam_layers": 3}}, "multiple of 2"),
    ({"mesh": {"tissue": 1e-4}}, "the mesh would have .* elements, more than 200,000; make its sides longer"),
    ({"mesh": {"edge": 10.0}}, "mesh.edge is 10 mm, .* outside of the supports of 15 mm; give a third of that, 5 mm, or less"),
    ({"geometry": {"support_length": 0.015}}, "geometry.support_length is 0.015"),
    ({"load_n": {"to": 5000.0}}, "load_n.to is 5000.0"),
    ({"displacement_mm": {"by": 1e-6}}, "more than 1000; make them larger"),
])
def test_a_value_that_does_not_fit_is_named(changes, said):
    with pytest.raises(InputError, match=said):
        small_design(**changes)


def test_a_files_fault_names_the_file_and_the_variant(tmp_path):
    path = tmp_path / "design.yaml"
    values = small_design().model_dump(exclude_none=True) | {"variants": {"odd": {"jaw": "loose"}}}
    path.write_text(yaml.safe_dump(values | {"mesh": {}}))
    with pytest.raises(InputError, match=r"design\.yaml: variants\.odd: .*jaw is 'loose'"):
        load_design(path)


def test_the_longest_elements_beside_the_supports_edges_leave_the_mesh_as_long_as_the_sensor():
    mesh = structure_mesh(small_design(mesh={"edge": 5.0}))
    assert (mesh.points[:, 0].min(), mesh.points[:, 0].max()) == pytest.approx((0.0, 67.0), abs=1e-9)


@pytest.mark.parametrize("constants", [
    {"young_mpa": 0.1, "poisson": 0.4}, {"shear_mpa": 0.03, "bulk_mpa": 0.3},
    {"law": "ogden1", "parameters": {"mu1": 0.03, "alpha1": 2.0}, "bulk_mpa": 0.3}])
def test_a_law_has_the_stretch_window_of_its_data_however_its_constants_are_given(constants):
    assert Material(**constants, stretch_window=(0.8, 1.6), source="a test's").make().stretch_window == (0.8, 1.6)


@pytest.mark.parametrize(("part", "young_mpa", "sentence"), [
    ("rubber", 28600.0, r"tissues.rubber: Young's modulus is 2.86e\+04 MPa, stiffer than the .* MPa\); is it in Pa or kPa\? Then "
                        r"write 0.0286 or 28.6"),
    ("rubber", 286.0, "stiffer than any soft tissue or rubber .20 MPa.; is it in Pa or kPa. Then write 0.000286 or 0.286"),
    ("filler", 2743.0, "filler: Young's modulus is 2743 MPa, stiffer than any soft tissue or rubber"),
    ("beam", 3.5e9, r"beam: Young's modulus is 3.5e\+09 MPa, stiffer than diamond")])
def test_a_modulus_in_pascal_is_asked_for(part, young_mpa, sentence, tmp_path):
    material = {"young_mpa": young_mpa, "poisson": 0.45, "source": "a test's"}
    changed = {"tissues": {part: material}} if part == "rubber" else {part: material}
    values = small_design().model_dump(exclude_none=True) | changed
    with pytest.raises(InputError, match=rf"design.yaml: .*{sentence}"):
        check_design(values, "design.yaml")


SEARCH = {"tissue": "rubber", "width": 6, "height": 5, "x": [5, 14.5, 24, 33.5], "depth": [3.5, 6, 9, 12],
          "stiffness_ratio": [2, 4, 8], "jaw_mm": [0.5, 2], "noise_n": 0.01, "source": "a test's"}


@pytest.mark.parametrize(("changes", "said"), [
    ({"load_n": {"to": 5, "by": 5}}, "load_n: steps of 5 up to 5 are one, .* two or more; make load_n.by 2.5 or less"),
    ({"displacement_mm": {"to": 2, "by": 4}}, "displacement_mm: steps of 4 up to 2 are one, .* make displacement_mm.by 1 or less"),
    ({"hardness": {"tissue_heights": [15, 2], "shares": [0.75, 1]}},
     "hardness.tissue_heights of 2 mm: .*jaw's displacement of 2 mm is more than the tissue's height"),
    ({"search": SEARCH | {"width": 10}}, "search.x is from 5 to 33.5 mm, where a lump with a search.width of 10 mm leaves"),
    ({"search": SEARCH | {"height": 6}}, "search.depth is from 3.5 to 12 mm, where a lump with a search.height of 6 mm leaves"),
    ({"search": SEARCH | {"jaw_mm": [2, 15]}}, "search.jaw_mm reaches 15 mm, and the tissue is 15 mm high"),
    ({"search": SEARCH | {"x": [5, 14.5, 24, 34]}}, "search.x reaches 34 mm, beyond the beam's middle at 33.5 mm"),
    ({"search": SEARCH | {"moves": [-30, 30]}}, "search.moves reach 60 mm"),
    ({"search": SEARCH | {"stiffness_ratio": [2, 4, 1e5]}}, "search.stiffness_ratio"),
    ({"search": SEARCH, "films": {"left": {"on": "left support", "side": "top", "start": 0, "end": 9, "source": "a test's"}}},
     "the film on the left support from 0 to 9 mm has no mirror image"),
])
def test_a_study_that_would_fail_after_the_sweeps_is_refused_before_them(changes, said):
    values = small_design().model_dump(exclude_none=True)
    assert check_design(values | {"search": SEARCH, "hardness": {"tissue_heights": [10, 15], "shares": [0.75, 1]}}, "design.yaml")
    with pytest.raises(InputError, match=rf"design.yaml: .*{said}"):
        check_design(values | changes, "design.yaml")


def test_an_unknown_tissue_is_refused_with_those_there_are():
    with pytest.raises(InputError, match="there are rubber"):
        small_design().tissue("liver")


def test_the_shipped_designs_are_read():
    for name in ("probe", "tiny_probe"):
        design = load_design(Path(__file__).resolve().parents[2] / f"config/{name}.yaml")
        for tissue in ("ecoflex_00_30", "dragon_skin_20"):     # table II: kappa = mu/(1 - 2 x 0.455), within 0.01 %
            own = design.tissue(tissue)
            assert own.bulk_mpa == pytest.approx(own.shear_mpa / (1 - 2 * 0.455), rel=1.1e-4)
