"""What is odd in a curve is told by what a rubber can be; a curve of rubber raises no remark."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.checks import checked, remarks
from softtact.materials.readers import order, read_curves

MU = 0.35
EXPONENT = {"uniaxial": -2, "planar": -3, "equibiaxial": -5}
STRAIN = np.linspace(0, 1, 51)


def rubber(stretch, mode="uniaxial", modulus=MU):
    """Nominal stress (n,) of a neo-Hookean rubber."""
    return modulus * (stretch - stretch ** EXPONENT[mode])


def told(strain, stress, mode="uniaxial", **options):
    """The remarks on a curve, in one text."""
    return "; ".join(remarks(1 + strain, stress, mode=mode, **{"compression": False} | options))


@pytest.mark.parametrize("mode", EXPONENT)
@pytest.mark.parametrize("largest", [2.0, 20.0])
def test_percent_that_was_called_a_ratio_is_told_in_steps_of_any_size(mode, largest):
    for steps in (21, 2001):
        percent = np.linspace(0, largest, steps)
        assert "if the column holds percent" in told(percent, rubber(1 + percent / 100, mode), mode), steps
    assert "if the column holds percent" in told(np.exp(np.linspace(0, 3, 50)) - 1, rubber(np.exp(np.linspace(0, 0.03, 50))))


def test_noise_hides_no_percent():
    percent = np.linspace(0, 24, 200)
    stress = rubber(1 + percent / 100)
    noise = 0.01 * stress.max() * np.random.default_rng(1).standard_normal(200)
    assert "if the column holds percent" in told(percent, stress + noise)


def test_a_ratio_of_a_rubber_that_stiffens_is_told_where_it_was_called_percent():
    for ratio in (np.linspace(0, 7, 60), np.linspace(0, 10, 60)):
        for stiffening, remark in ((0.0, "holds a ratio"), (0.01, "holds a ratio"), (0.05, "check the units of strain")):
            assert remark in told(ratio / 100, rubber(1 + ratio) * (1 + stiffening * ratio**2)), stiffening


@pytest.mark.parametrize("mode", EXPONENT)
def test_a_ratio_that_was_called_percent_is_told(mode):
    ratio = np.linspace(0, 3, 301)
    assert "if the column holds a ratio" in told(ratio / 100, rubber(1 + ratio, mode), mode)


@pytest.mark.parametrize("offset", [0.08, 0.02, -0.03])
@pytest.mark.parametrize("end", [1.0, 3.0, -0.5])
def test_stress_without_strain_is_told(offset, end):
    strain = np.linspace(0, end, 61)
    assert "MPa at no strain" in told(strain, rubber(1 + strain) + offset * np.sign(end))


def test_a_preload_is_told_where_no_row_is_without_strain():
    assert "MPa at no strain" in told(STRAIN[1:], rubber(1 + STRAIN[1:]) + 0.08)
    compression = np.linspace(0, -0.5, 61)[1:]
    assert "MPa at no strain" in told(compression, rubber(1 + compression) - 0.08)
    assert "MPa at no strain" not in told(compression, rubber(1 + compression) + 0.08)  # slack, if anything


@pytest.mark.parametrize("slack", [0.05, 0.15, 0.4])
@pytest.mark.parametrize("end", [1.0, 3.0, -0.6])
def test_strain_without_stress_is_told(slack, end):
    strain = np.linspace(0, end, 81)
    pulled = np.sign(end) * np.maximum(np.abs(strain) - slack, 0)
    assert "hardly rises over the first strains" in told(strain, rubber(1 + pulled))


def test_a_modulus_that_no_rubber_has_is_told():
    for factor in (1e-3, 1e3):
        assert "check the units" in told(STRAIN, rubber(1 + STRAIN) * factor), factor
    assert told(STRAIN, rubber(1 + STRAIN) * 0.01) == ""      # a soft silicone


def test_tension_that_was_said_to_be_compression_is_told():
    strain = np.linspace(0, 0.5, 21)
    assert "it softens from the start" in told(-strain, -rubber(1 + strain), compression=True)


@pytest.mark.parametrize("mode", EXPONENT)
@pytest.mark.parametrize("ends", [(0, 1), (0, 3), (0, 0.05), (-0.5, 0), (-0.5, 0.5), (0.05, 0.6)])
def test_a_rubbers_curve_with_noise_raises_no_remark(mode, ends):
    strain = np.linspace(*ends, 41)
    stress = rubber(1 + strain, mode)
    noise = 0.01 * np.abs(stress).max() * np.random.default_rng(3).standard_normal(41)
    assert told(strain, stress + noise, mode) == ""


def test_published_rubbers_raise_no_remark_over_any_range_and_one_where_a_ratio_is_called_percent(published):
    """But for the softest silicone over its first strains, which a load cell of 1 kN measured."""
    curves = read_curves(sorted((published / "soro_db").glob("*.csv")), layout="soro_db")
    for name in ("Treloar_1944", "Kawabata_1981"):
        curves += read_curves(published / "literature" / name, layout="literature")
    for curve in curves:
        assert told((curve.stretch - 1) / 100, curve.nominal_stress, curve.mode) != "", curve.source
        for end in np.arange(1.4, 10, 0.2):
            own = curve.within((1, end))
            if len(own.stretch) > 3:
                assert told(own.stretch - 1, own.nominal_stress, curve.mode) == "", (curve.source, end)


CYCLE = np.concatenate([STRAIN, STRAIN[-2::-1]])


@pytest.mark.parametrize("sort", [False, True])
@pytest.mark.parametrize("strain", [CYCLE, CYCLE[::16], np.tile(CYCLE, 3), np.concatenate([STRAIN, -STRAIN / 2, STRAIN / 2 - 0.5])],
                         ids=["a cycle", "few rows", "three cycles", "tension, compression and back"])
def test_loading_and_unloading_are_told_apart_by_the_order_of_the_rows(strain, sort):
    with pytest.raises(InputError, match="turns back at .* loading and unloading .* keep the rows of one branch"):
        order("file.csv", np.arange(2, 2 + len(strain)), 1 + strain, strain, mode="uniaxial", sort=sort)


@pytest.mark.parametrize("strain", [
    np.random.default_rng(1).permutation(STRAIN), np.concatenate([STRAIN, -STRAIN]), np.tile(STRAIN, 2), STRAIN[[0, 2, 1]],
    STRAIN + 0.01 * np.sin(9.0 * np.arange(51))],
    ids=["disorder", "tension and compression", "two specimens", "three rows", "jitter"])
def test_rows_that_are_no_cycle_are_sorted(strain):
    x, y = order("file.csv", np.arange(len(strain)), 1 + strain, 2 * strain, mode="uniaxial", sort=True)
    assert (np.diff(x) >= 0).all() and y == pytest.approx(2 * (x - 1))


def of_rows(stretch, stress):
    """The remarks on a curve with the numbers of its rows from 2 on."""
    return checked("c.csv", np.arange(2, 2 + len(stretch)), stretch, stress, mode="uniaxial", raw=np.stack([stretch, stress]),
                   compression=False)


@pytest.mark.parametrize("sign", [1, -1], ids=["tension", "compression"])
@pytest.mark.parametrize("factor", [10.0, 0.0])
def test_a_row_that_stands_alone_is_told_and_is_no_break(factor, sign):
    stretch = 1 + sign * 0.6 * STRAIN
    stress = rubber(stretch)
    stress[30] *= factor
    remark, = of_rows(stretch, stress)
    assert f"c.csv: row 32: the stress {stress[30]:.4g} MPa stands alone between rows of about" in remark


def test_a_stress_that_stands_at_its_largest_value_to_the_end_is_told():
    stress = rubber(1 + STRAIN)
    remark, = of_rows(1 + STRAIN, np.minimum(stress, stress[35]))
    assert f"c.csv: from row 37 on its stress stands at {stress[35]:.4g} MPa while the strain grows" in remark
    assert of_rows(1 + STRAIN, stress.round(2)) == of_rows(1 + STRAIN[::10], stress[::10]) == ()
    plateau = 0.4 * (1 - np.exp(-6 * STRAIN))
    assert not any("stands at" in one for one in of_rows(1 + STRAIN, plateau.round(2)))
