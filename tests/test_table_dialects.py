"""Tables in any dialect that the documentation lists read back as they were; one with a fault does so too, or is refused."""

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from support.table_files import dialects, faults

from softtact.errors import InputError
from softtact.learning.prediction import read_maps
from softtact.materials.readers import read_curve
from softtact.studies.hybrid.stages.validate_ftir import _measured_curve

quick = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
# Name in the header -> what is written there of a stretch, or of a nominal stress in MPa at a stretch; and its unit.
STRETCHES = {"stretch": (lambda x: x, "-"), "engineering_strain": (lambda x: x - 1, "mm/mm"),
             "engineering_strain_percent": (lambda x: 100 * (x - 1), "%"), "true_strain": (np.log, "")}
STRESSES = {"nominal_stress_mpa": (lambda y, x: y, "MPa"), "nominal_stress_kpa": (lambda y, x: 1e3 * y, "[kPa]"),
            "true_stress_mpa": (lambda y, x: y * x, "N/mm2"), "nominal_stress_pa": (lambda y, x: 1e6 * y, "(Pa)")}
OTHERS = {"time": "12.5", "note": "späte; Probe, neu", "": ""}


@st.composite
def curves(draw):
    """(header, rows as functions of a dialect's number, unit row, columns to map, expected stretch and stress)."""
    stretch_name, stress_name = draw(st.sampled_from(list(STRETCHES))), draw(st.sampled_from(list(STRESSES)))
    stretch = 1 + np.array(sorted(draw(st.sets(st.integers(10, 900), min_size=6, max_size=12)))) / 1000
    stress = draw(st.integers(5, 500)) / 100 * (stretch - stretch**-2)
    columns = {stretch_name: [STRETCHES[stretch_name][0](value) for value in stretch],
               stress_name: [STRESSES[stress_name][0](y, x) for y, x in zip(stress, stretch, strict=True)]}
    others = draw(st.lists(st.sampled_from(list(OTHERS)), max_size=2, unique=True))
    order = draw(st.permutations([*columns, *others]))
    own = {name: f"{name}, eigene Größe" for name in columns} if draw(st.booleans()) else {}
    units = [(STRETCHES | STRESSES)[name][1] if name in columns else "s" for name in order] if draw(st.booleans()) else None
    return order, columns, own, units, (stretch, stress)


def rows_of(order, columns, own, units, dialect):
    length = len(next(iter(columns.values())))
    body = [[dialect.number(columns[name][k], 6) if name in columns else OTHERS[name] for name in order] for k in range(length)]
    return [[own.get(name, name) for name in order], *([units] if units else []), *body]


@quick
@given(st.data())
def test_a_curve_in_any_dialect_reads_back(tmp_path, data):
    dialect, (order, columns, own, units, (stretch, stress)) = data.draw(dialects()), data.draw(curves())
    path = tmp_path / "uniaxial.csv"
    path.write_bytes(dialect.bytes(rows_of(order, columns, own, units, dialect)))
    curve = read_curve(path, columns=own, decimal=dialect.decimal)
    assert curve.stretch == pytest.approx(stretch, abs=2e-6) and curve.nominal_stress == pytest.approx(stress, rel=1e-4, abs=2e-6)


def same_or_refused(read, path, text, expected):
    """Whether a file is refused, or its columns are those expected, or the first or all but one of their rows."""
    path.write_text(text, encoding="utf-8", newline="")
    try:
        got = read(path)
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return
    known = {tuple(point) for point in np.round(np.transpose(expected), 5)}
    assert {tuple(point) for point in np.round(np.transpose(got), 5)} <= known, text


@settings(quick, max_examples=200)
@given(st.data())
def test_a_curve_with_a_fault_is_refused_or_reads_back(tmp_path, data):
    separator, line_end = data.draw(st.sampled_from(",;\t")), data.draw(st.sampled_from(["\n", "\r\n"]))
    order = data.draw(st.permutations(["time", "stretch", "nominal_stress_mpa", "temperature"]))
    stretch = 1 + np.arange(1, 9) / 10
    stress = 0.35 * (stretch - stretch**-2)
    values = {"stretch": stretch, "nominal_stress_mpa": stress, "time": np.arange(8.0), "temperature": 20 + stretch}
    rows = [order, *([f"{values[name][k]:.5f}" for name in order] for k in range(8))]
    text = line_end.join(separator.join(row) for row in rows) + line_end
    faulty = data.draw(faults(text, separator, line_end))
    assume(faulty != text)
    same_or_refused(lambda path: (lambda curve: (curve.stretch, curve.nominal_stress))(read_curve(path)), tmp_path / "uniaxial.csv",
                    faulty, (stretch, stress))


@settings(quick, max_examples=100)
@given(st.data())
def test_a_measured_area_with_a_fault_is_refused_or_reads_back(tmp_path, data):
    separator = data.draw(st.sampled_from(",;\t"))
    force, area = np.linspace(0, 50, 6), np.linspace(0, 0.5, 6) ** 2
    text = f"force_n{separator}area_mm2\n" + "".join(f"{f:.5f}{separator}{a:.5f}\n" for f, a in zip(force, area, strict=True))
    faulty = data.draw(faults(text, separator, "\n"))
    same_or_refused(_measured_curve, tmp_path / "area.csv", faulty, (force, area))


@settings(quick, max_examples=100)
@given(st.data())
def test_a_map_with_a_fault_is_refused_or_reads_back(tmp_path, data):
    values = np.arange(12.0).reshape(4, 3) / 7
    text = "".join(",".join(f"{value:.5f}" for value in row) + "\n" for row in values)
    path = tmp_path / "map.csv"
    path.write_text(data.draw(faults(text, ",", "\n")))
    try:
        maps = read_maps(path, shape=(4, 3)).maps_mm
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error)
    else:
        assert np.allclose(maps, values, atol=1e-5)


@quick
@given(dialects(decimals=(".",)))
def test_a_measured_area_in_any_dialect_reads_back(tmp_path, dialect):
    force, area = [0.0, 20.0, 50.0], [0.0, 0.1, 0.5]
    body = [["x", dialect.number(f, 2), dialect.number(a, 4)] for f, a in zip(force, area, strict=True)]
    path = tmp_path / "area.csv"
    path.write_bytes(dialect.bytes([["Größe", "force_n", "area_mm2"], *body]))
    assert np.array_equal(_measured_curve(path), [force, area])
