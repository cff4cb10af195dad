"""The stages of the dielectric on glass hand each other what the next one reads."""

from pathlib import Path

import pandas as pd
import pytest
from support.sensors import CORO

from softtact.errors import InputError
from softtact.files import read_dataset, read_json, write_json
from softtact.studies.hybrid.stages import draw, press_on_glass, validate_ftir

ROOT = Path(__file__).parents[2]
SENSOR = CORO.model_dump(mode="json")
PRINTED = {"mooney_rivlin": {"parameters": {"c10": 0.1706, "c01": 0.0040}},
           "ogden2": {"parameters": {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910}}}
FITTED = {"mooney_rivlin": {"parameters": {"c10": 0.3412, "c01": 0.0080}, "bulk_modulus_mpa": 40 * 0.3492}}
SETTINGS = {"sensor": SENSOR, "forces_n": [0.0, 4.0, 60.0, 110.0], "orientations": ["default", "as_printed"],
            "laws": ["mooney_rivlin"],
            "constants": "printed", "orientation": "default", "law": "mooney_rivlin", "virtual_law": "mooney_rivlin",
            "height_scatter": 0.01, "tip_scatter": 0.02, "seed": 4,
            "mesh": {"frustum_heights": [0.0, 0.1, 0.2, 0.35, 1.0], "frustum_rings": 1, "refinement": None}}


def pressed_into(folder, **changes):
    """The two files that `press_on_glass` writes."""
    card = {"material": "polyurethane", "kind": "synthetic", "chosen": "mooney_rivlin", "laws": FITTED, "printed": PRINTED}
    write_json(folder / "card.json", card | changes.pop("card", {}))
    outputs = {"state": folder / "state.nc", "virtual": folder / "virtual.nc"}
    press_on_glass.run(inputs={"card": folder / "card.json"}, outputs=outputs, settings=SETTINGS | changes)
    return outputs


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    return pressed_into(tmp_path_factory.mktemp("pressed"))


def validated_into(folder, pressed):
    """contact_area.csv, orientations.csv and summary.json as `validate_ftir` writes them, the discs being those of the specimen."""
    virtual = read_dataset(pressed["virtual"])
    discs = virtual[["disc_area_mm2", "force_n"]].to_dataframe().reset_index().rename(columns={"disc_area_mm2": "area_mm2"})
    discs[discs.area_mm2 > 0].to_csv(folder / "discs.csv", index=False)
    outputs = {"area": folder / "area.csv", "orientations": folder / "orientations.csv", "summary": folder / "summary.json"}
    validate_ftir.run(inputs=pressed | {"discs": [folder / "discs.csv"]}, outputs=outputs, settings={"pixel_mm": 0.02})
    return outputs


@pytest.mark.slow
def test_each_orientation_and_law_has_its_curve_and_no_force_is_no_contact(pressed):
    state = read_dataset(pressed["state"])
    assert state.area_per_frustum_mm2.dims == ("orientation", "law", "force")
    assert not state.area_per_frustum_mm2[..., 0].any() and not state.compression_mm[..., 0].any()
    assert float(state.disc_gap_mm[0, 0, 0]) == pytest.approx(1.2)
    assert (state.area_per_frustum_mm2.sel(orientation="as_printed")[:, 1:] > 1.1).all()


@pytest.mark.slow
def test_the_virtual_dielectric_tells_of_every_frustum(pressed):
    virtual = read_dataset(pressed["virtual"])
    assert virtual.disc_area_mm2.dims == ("force", "frustum") and virtual.sizes["frustum"] == 540
    assert virtual.frustum_force_n.sum("frustum").values == pytest.approx(virtual.force_n.values, rel=1e-6, abs=1e-9)
    assert not virtual.disc_area_mm2[0].any()
    assert 0 < int((virtual.disc_area_mm2[1] > 0).sum()) < 540
    assert {"x_mm", "y_mm"} <= set(virtual.data_vars)


@pytest.mark.slow
def test_the_summary_judges_both_orientations_and_tells_what_was_measured(pressed, tmp_path):
    outputs = validated_into(tmp_path, pressed)
    summary, area, orientations = read_json(outputs["summary"]), pd.read_csv(outputs["area"]), pd.read_csv(outputs["orientations"])
    assert summary["source"].startswith("virtual dielectric")
    assert "hardly allow the orientation as_printed" in summary["verdict"]
    allowed = {record["orientation"]: record["allowed"] for record in summary["orientations"]}
    assert allowed == {"default": True, "as_printed": False}
    assert area.area_total_mm2.to_numpy() == pytest.approx(540 * area.area_per_frustum_mm2.to_numpy(), rel=1e-5)
    assert area.area_image_mm2.to_numpy() == pytest.approx(area.area_measured_mm2.to_numpy(), rel=1e-4)
    assert list(orientations.columns[:3]) == ["orientation", "law", "force_n"] and len(orientations) == 2 * 4
    draw.draw_fig5_ftir(inputs=outputs, outputs={kind: tmp_path / f"fig5.{kind}" for kind in ("png", "svg")}, settings={})
    assert "virtual dielectric (no measured curve was given)" in (tmp_path / "fig5.svg").read_text()


def test_without_scatter_the_specimen_of_the_same_law_is_the_model(tmp_path):
    changes = {"height_scatter": 0.0, "tip_scatter": 0.0, "forces_n": [60.0], "orientations": ["default"]}
    outputs = pressed_into(tmp_path, **changes)
    state, virtual = read_dataset(outputs["state"]), read_dataset(outputs["virtual"])
    assert float(virtual.area_per_frustum_mm2[0]) == pytest.approx(float(state.area_per_frustum_mm2[0, 0, 0]), rel=0.01)
    assert float(virtual.compression_mm[0]) == pytest.approx(float(state.compression_mm[0, 0, 0]), rel=1e-3)


def test_fitted_constants_are_the_card_s_own(tmp_path):
    """Twice as stiff: half the compression, but for a side that has begun to fold and the penalty that is not doubled."""
    changes = {"forces_n": [20.0], "orientations": ["default"], "height_scatter": 0.0, "tip_scatter": 0.0}
    printed, fitted = (read_dataset(pressed_into(tmp_path, constants=name, **changes)["state"]) for name in ("printed", "fitted"))
    assert float(fitted.compression_mm[0, 0, 0]) == pytest.approx(0.5 * float(printed.compression_mm[0, 0, 0]), rel=0.05)


def test_a_card_without_printed_constants_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(InputError, match="no printed constants of law 'mooney_rivlin'; set 'ftir.constants' to fitted"):
        pressed_into(tmp_path, card={"printed": {}})
