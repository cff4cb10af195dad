"""`softtact palpate` from a file to a report."""

from pathlib import Path

import pandas as pd
import pytest
import yaml
from support.pages import numbers_without_a_file

from softtact.cli import main
from softtact.files import read_dataset

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_the_command_writes_tables_pictures_fields_and_a_page(tmp_path, capsys):
    design = yaml.safe_load((ROOT / "config/tiny_probe.yaml").read_text())
    design |= {"load_n": {"to": 5, "by": 2.5}, "variants": {}, "hardness": None}
    (tmp_path / "design.yaml").write_text(yaml.safe_dump(design))
    assert main(["palpate", str(tmp_path / "design.yaml"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    # The tiny mesh is too coarse to decide: its error exceeds the tolerances.
    assert "ecoflex_00_30, load: trend line" in said and "undecided: F/d is a property" in said
    curves = pd.read_csv(tmp_path / "out/tables/curves.csv")
    assert len(curves) == 2 * (3 + 2) and (curves.film_left_n > 0).all()
    page = (tmp_path / "out/report.html").read_text()
    assert page.count("data:image/png") == 3 and "polystyrene has 3,000 to 3,600 MPa" in page
    assert numbers_without_a_file(page) == []
    films = read_dataset(tmp_path / "out/dragon_skin_20_load.nc").film_force_n
    assert films.dims == ("step", "film") and films.shape == (2, 4)
    assert (tmp_path / "out/fields_dragon_skin_20.vtu").stat().st_size > 0
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.*") if path.is_file()}
    design["load_n"] = {"to": 4, "by": 2}
    (tmp_path / "design.yaml").write_text(yaml.safe_dump(design))
    assert main(["palpate", str(tmp_path / "design.yaml"), "--out", str(tmp_path / "out")]) == 0
    again = {str(path.relative_to(tmp_path / "out")) for path, time in made.items() if path.stat().st_mtime_ns > time}
    assert {name for name in again if name.endswith(".nc")} == {f"{tissue}_load.nc" for tissue in design["tissues"]}
    assert "report.html" in again and "figures/films.png" not in again


def test_a_design_that_cannot_be_built_writes_nothing(tmp_path, capsys):
    design = yaml.safe_load((ROOT / "config/tiny_probe.yaml").read_text())
    design["geometry"]["beam_height"] = -1
    (tmp_path / "design.yaml").write_text(yaml.safe_dump(design))
    assert main(["palpate", str(tmp_path / "design.yaml"), "--out", str(tmp_path / "out")]) == 1
    assert "geometry.beam_height is -1" in capsys.readouterr().err and not (tmp_path / "out").exists()
