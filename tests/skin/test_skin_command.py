"""`softtact skin`: from a design to a folder of results, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh
import yaml
from PIL import Image
from support.pages import numbers_without_a_file

from softtact.cli import main
from softtact.files import read_dataset
from softtact.skin.design import read_design

ROOT = Path(__file__).resolve().parents[2]
SMALL = {
    "skin": "small",
    "mesh": {"spacing_mm": 3.0, "layers": 2, "field_spacing_mm": 3.0, "field_layers": 1},
    "loads": [{"name": "a", "diameter_mm": 6, "at_taxel": 7, "pressure_kpa": 20}],
}

BALL = {"name": "m", "mesh": "ball.stl", "at_taxel": 7, "force_n": 1.0}


def written(folder, **changes):
    path = folder / "design.yaml"
    path.write_text(yaml.safe_dump(SMALL | changes))
    return path


@pytest.mark.slow
def test_a_design_becomes_readings_figures_exports_and_a_report(tmp_path, capsys):
    Image.fromarray(np.pad(np.zeros((20, 10), dtype=np.uint8), 5, constant_values=255)).save(tmp_path / "print.png")
    loads = [*SMALL["loads"], {"name": "ink", "mask": "print.png", "pixel_mm": 0.2, "at_mm": [15, 9], "pressure_kpa": 10}]
    assert main(["skin", str(written(tmp_path, loads=loads)), "--out", str(tmp_path / "out"), "--threads", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["load"] for row in told["loads"]] == ["a", "ink"] and told["loads"][1]["force_n"] == pytest.approx(
        0.01 * 200 * 0.04
    )
    readings = read_dataset(tmp_path / "out/readings.nc")
    assert readings.counts.dims == ("load", "taxel") and int(readings.counts.sel(load="a").values.argmax()) == 6
    assert readings.delta_ff.values == pytest.approx(readings.capacitance_ff.values - readings.at_rest_ff.values)
    assert readings.displacement_mm.sel(axis="z").min() < -0.1
    page = (tmp_path / "out/report.html").read_text()
    assert page.count("data:image/png") == 2 and "exports/skin.urdf" in page and numbers_without_a_file(page) == []
    assert (tmp_path / "out/exports/skin.txt").read_text().count("\n") == 16


@pytest.mark.slow
def test_an_object_presses_at_finite_strains_where_the_design_says_so(tmp_path, capsys):
    trimesh.creation.icosphere(subdivisions=4, radius=8.0).export(tmp_path / "ball.stl")
    ball = {"mesh": "ball.stl", "at_taxel": 7, "force_n": 0.1}
    loads = [{"name": "small", **ball}, {"name": "finite", "strains": "finite", **ball}]
    assert main(["skin", str(written(tmp_path, loads=loads)), "--out", str(tmp_path / "out"), "--threads", "1", "--json"]) == 0
    small, finite = json.loads(capsys.readouterr().out)["loads"]
    assert "finite strains by a law off the curve by" in finite["what"] and "finite strains" not in small["what"]
    assert finite["taxel"] == small["taxel"] == 7 and finite["force_n"] == pytest.approx(0.1)
    assert finite["delta_ff"] == pytest.approx(small["delta_ff"], rel=0.3)  # two models on elements 3 mm wide
    assert finite["delta_ff"] != small["delta_ff"]


@pytest.mark.slow
def test_the_tiny_design_computes_every_section(tmp_path, capsys):
    assert main(["skin", str(ROOT / "config/tiny_skin.yaml"), "--out", str(tmp_path), "--threads", "1"]) == 0
    said = capsys.readouterr()
    assert all(words in said.out for words in ("chosen:", "worst batch", "is felt from"))
    assert "its curve is extrapolated" in said.err
    tables = {path.stem: pd.read_csv(path) for path in (tmp_path / "tables").glob("*.csv")}
    assert {
        "loads",
        "probes",
        "choice",
        "choice_printed",
        "front_confidence",
        "thickness",
        "detection",
        "crosstalk",
        "search",
        "main_effects",
    } == set(tables)
    stiff, soft = (
        tables["probes"].query(f"modulus_share == {share} and pressure_kpa == 40").delta_ff.to_numpy() for share in (0.1, -0.1)
    )
    assert (soft > stiff).all()
    kept = [path for path in tmp_path.rglob("*.*") if path.is_file()]
    before = [path.stat().st_mtime_ns for path in kept]
    assert main(["skin", str(ROOT / "config/tiny_skin.yaml"), "--out", str(tmp_path), "--threads", "1"]) == 0
    assert [path.stat().st_mtime_ns for path in kept] == before     # a second run does nothing


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"loads": [SMALL["loads"][0] | {"at_taxel": 13}]}, "load 'a': there is no taxel 13; give one of 1 to 12."),
        ({"loads": [SMALL["loads"][0] | {"at_taxel": None, "at_mm": [1.0, 1.0]}]}, "lies beside the elastomer; move it inwards"),
        ({"loads": [SMALL["loads"][0] | {"area_mm2": 5.0}]}, "diameter_mm and area_mm2; give one of"),
        ({"loads": [SMALL["loads"][0] | {"pressure_kpa": 90}]}, "90 kPa is beyond twice that"),
        ({"loads": [SMALL["loads"][0], SMALL["loads"][0]]}, "two loads are called 'a'"),
        ({"loads": []}, "at 'loads': a study needs a load or more, and there is none"),
        ({"loads": [SMALL["loads"][0] | {"force_n": 1.0}]}, "load 'a': a load by diameter_mm has no force_n; leave it out"),
        ({"loads": [SMALL["loads"][0] | {"turned_deg": [0, 9, 0], "ratio": 2.0, "pixel_mm": 0.1}]},
         "load 'a': a load by diameter_mm has no pixel_mm or ratio or turned_deg; leave it out"),
        ({"loads": [BALL | {"pressure_kpa": 10}]}, "load 'm': a load by mesh has no pressure_kpa; leave it out"),
        ({"loads": [BALL | {"angle_deg": 10}]}, "load 'm': a load by mesh has no angle_deg; leave it out"),
        ({"module": {"centres_mm": []}}, "at 'module.centres_mm'"),
        ({"probes": {"modulus_shares": [-0.1, -1.5]}}, "'probes.modulus_shares.1' (it is -1.5): Input should be greater than -1"),
        ({"choice": {"range_kpa": [50, 10]}}, "50 to 10 kPa does not rise"),
    ({"choice": {"target_kpa": 300}}, "at 'choice.target_kpa': no elastomer's curve reaches 300 kPa"),
    ({"choice": {"range_kpa": [10, 90]}, "search": {"elastomers": ["Ecoflex 00-30", "SomaFoama"]}},
     "at 'search.elastomers' and 'choice.range_kpa': elastomer SomaFoama: its curve was tested up to 42.2 kPa, and 90 kPa is"),
    ({"elastomer": "SomaFoam"}, "there is no elastomer 'SomaFoam' (did you mean 'SomaFoama'?)"),
        ({"converter": {"name": "papr"}}, "there is no converter 'papr'; did you mean 'paper'?"),
        ({"module": {"pitch": 5}}, "at 'module': there is no key 'pitch'; did you mean 'pitch_mm'?"),
        ({"module": {"pitch_mm": 4.2}}, "mm apart and need more than 4.4 mm"),
        ({"module": {"pitch_mm": 5, "centres_mm": [[15, 9]]}}, "at 'module.pitch_mm': it has no effect beside centres_mm"),
        ({"module": {"centres_mm": [[15, 9]]}, "loads": [SMALL["loads"][0] | {"at_taxel": 1}], "search": {}},
         "at 'search': it builds the published module at other pitches, and module.centres_mm has places of its own"),
        ({"maps": {"finger_mm2": 260}}, "at 'maps.finger_mm2': at none of the places 1 mm apart does a finger of 260 mm2 lie on"),
        ({"maps": {"pitches_mm": [5, 4.4]}}, "at 'maps.pitches_mm': taxels at a pitch of 4.4 mm need more than 4.4 mm"),
        ({"module": {"guard_radius_mm": {"value": 2.2, "assumed": True}}}, "an assumed value needs a reason"),
        (
            {"loads": [{"name": "m", "mask": "no.png", "pixel_mm": 0.1, "at_mm": [15, 9], "pressure_kpa": 10}]},
            "there is no such picture",
        ),
    ],
)
def test_what_is_wrong_with_a_design_is_said_in_one_sentence_and_nothing_is_written(changes, said, tmp_path, capsys):
    assert main(["skin", str(written(tmp_path, **changes)), "--out", str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    assert said in captured.err and captured.err.count("\n") == 1 and captured.out == "", captured.err
    assert not (tmp_path / "out").exists()


def test_the_shipped_designs_are_valid():
    for name in ("skin", "tiny_skin"):
        assert read_design(ROOT / f"config/{name}.yaml").layout().centres_mm.shape[0] in (12, 72)
