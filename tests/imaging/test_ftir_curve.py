"""A measured FTIR curve takes the place of the virtual dielectric, or is refused with the remedy."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.studies.hybrid.stages.validate_ftir import _measured

FORCES = np.array([10.0, 50.0])


def test_a_measured_curve_is_read_at_the_study_s_forces(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("area_mm2,force_n\n0.5,100\n0.1,0\n")
    area, source = _measured(path, FORCES, virtual=None)
    assert area == pytest.approx([0.14, 0.30])
    assert source.startswith("measured")


def test_an_unusable_curve_is_refused(tmp_path):
    for text, message in [
        ("force_n,area\n0,0\n100,1\n", "needs the columns force_n and area_mm2"),
        ("force_n,area_mm2\n0,zero\n100,1\n", "needs the columns force_n and area_mm2 in numbers"),
        ("force_n,area_mm2\n0,0,0,0\n20,0,0,1\n100,0,0,5\n", "row 2: it has 4 fields where 2 are named"),
        ("force_n;area_mm2\n0;0\n20;0,1\n100;0,5\n", "row 3: '0,1' is not a number; write it with a decimal point"),
        ("force_n,area_mm2\n0,0\n20,\n100,0.5\n", "row 3: '' is not a number"),
        ("force_n,area_mm2\n0,0\n20,inf\n100,0.5\n", "row 3: the value 'inf' is not finite"),
        ("force_n,area_mm2\n0,0\n100,0.5\n20,0.2\n", "row 4: force_n goes back to 20; keep one loading branch"),
        ("force_n,area_mm2\n0,0\n20,0.1\n20,0.2\n100,0.5\n", "row 4: force_n goes back to 20"),
        ("force_n,area_mm2\n0,0\n20,-0.1\n100,0.5\n", "row 3: area_mm2 is -0.1; an area is no less than 0"),
        ("force_n,area_mm2\n0,0\n", r"1 point\(s\) make no curve"),
        ("force_n,area_mm2\n20,0.1\n100,1\n", "measured from 20 to 100 N, but 'ftir.forces_n' asks for 10 N"),
    ]:
        path = tmp_path / "curve.csv"
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            _measured(path, FORCES, virtual=None)


def test_a_missing_curve_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        _measured(tmp_path / "none.csv", FORCES, virtual=None)
