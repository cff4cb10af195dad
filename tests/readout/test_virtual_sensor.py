"""The whole chain: every effect alone against its closed form, its switch, what trials share and what a seed repeats."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from support.sensors import CORO

from softtact.errors import InputError
from softtact.files import read_dataset, write_dataset
from softtact.readout.capacitance import EPSILON_0_PF_PER_MM, equivalent_air_gap, ideal_counts
from softtact.readout.electrodes import coupled, edge_excess
from softtact.readout.virtual_sensor import (
    VirtualSensorSettings,
    _at_force,
    make_specimen,
    read_branches,
    read_virtual_sensor,
    taxel_capacitance,
)
from softtact.studies.hybrid.stages import read_virtual_sensor as stage

FORCES = np.array([10.0, 20.0, 40.0])
X, Y = np.meshgrid(CORO.map_x_mm, CORO.map_y_mm)
BUMP = np.exp(-((X / 6) ** 2) - ((Y / 9) ** 2))                        # a smooth press, 1 mm in its middle
PRESS = np.array([0.1, 0.18, 0.3])[:, None, None] * BUMP
AREA = 5.5 * 37 / 7
IDEAL = VirtualSensorSettings.ideal()

SPECIMEN = {"electrode_spacing_mm": 0.3, "outer_fringe": 1.0, "inner_fringe": 0.1, "coupling": 0.05, "sheet_scatter": 0.02,
            "relaxation": 0.1, "gain_scatter": 0.03, "offset_counts": 5.0, "dead_taxels": [9], "step_counts": 8.0,
            "largest_counts": 100.0}
TRIAL = {"placement_mm": 0.1, "force_scatter": 0.01, "drift": 0.01, "drift_counts": 2.0, "noise_counts": 6.0}


def branches(maps=PRESS, *, trials=2, seed=1, item="a", force_n=FORCES, **effects):
    """Readings with no effect but those given."""
    if "relaxation" in effects:
        effects = {"relaxation_s": 2.0} | effects
    return read_branches(CORO, maps, force_n=force_n, trials=trials, seed=seed, item=item,
                         settings=VirtualSensorSettings.ideal(**effects))


def default(maps=PRESS, **changes):
    rules = {"force_n": FORCES, "trials": 3, "seed": 1, "item": "a"} | changes
    return read_virtual_sensor(CORO, maps, **rules)


def test_with_every_effect_off_it_reads_the_ideal_counts_in_every_trial_up_and_down():
    readings = branches()
    assert readings.loading[0] == pytest.approx(ideal_counts(CORO, PRESS)) and (readings.loading[0] == readings.loading[1]).all()
    assert readings.unloading == pytest.approx(readings.loading)


def test_an_effect_of_the_specimen_changes_readings_and_all_trials_alike():
    for effect in SPECIMEN:
        loading = branches(**{effect: SPECIMEN[effect]}).loading
        assert np.abs(loading[0] - ideal_counts(CORO, PRESS)).max() > 0.1 and (loading[0] == loading[1]).all(), effect


def test_an_effect_of_the_trial_makes_repeated_trials_scatter():
    for effect in TRIAL:
        loading = branches(**{effect: TRIAL[effect]}).loading
        assert np.abs(loading[0] - loading[1]).max() > 0.1, effect


def test_zeros_in_a_configuration_switch_every_effect_off():
    values = {name: 0.0 for name in VirtualSensorSettings.__dataclass_fields__ if name not in ("relaxation_s", "dead_taxels")}
    values |= {"rate_n_per_s": 10.0, "load_step_s": 1.0, "counts_per_relative_change": 1000.0, "largest_counts": np.inf}
    assert VirtualSensorSettings.from_dict(values) == IDEAL


def test_every_effect_has_its_place_in_the_tests_above():
    others = {"relaxation_s", "rate_n_per_s", "load_step_s", "cycles_before", "rest_s", "counts_per_relative_change", "dead_share"}
    assert set(VirtualSensorSettings.__dataclass_fields__) == set(SPECIMEN) | set(TRIAL) | others


def test_a_uniform_gap_is_a_plate_capacitor():
    gap = equivalent_air_gap(CORO, 0.2)
    assert taxel_capacitance(CORO, np.full(BUMP.shape, 0.2), settings=IDEAL) == pytest.approx(
        np.full((7, 4), EPSILON_0_PF_PER_MM * AREA / gap))


def test_a_thicker_sheet_is_one_more_capacitor_in_series():
    excess = np.linspace(-0.02, 0.02, 28).reshape(7, 4)
    expected = EPSILON_0_PF_PER_MM * AREA / (equivalent_air_gap(CORO, 0.1) + excess / 3.5)
    assert taxel_capacitance(CORO, np.full(BUMP.shape, 0.1), sheet_excess_mm=excess, settings=IDEAL) == pytest.approx(expected)


def test_electrodes_apart_with_free_edges_are_plates_with_edges():
    alone = VirtualSensorSettings.ideal(electrode_spacing_mm=0.5, outer_fringe=1.0, inner_fringe=1.0)
    sides, gap = (5.0, 37 / 7 - 0.5), CORO.dielectric_thickness_mm - 0.1
    edges = 1 + sum(edge_excess(side, gap) for side in sides)
    expected = EPSILON_0_PF_PER_MM * np.prod(sides) * edges / equivalent_air_gap(CORO, 0.1)
    assert taxel_capacitance(CORO, np.full(BUMP.shape, 0.1), settings=alone) == pytest.approx(np.full((7, 4), expected))


def test_coupling_shares_capacitance_and_loses_none():
    plain, shared = (taxel_capacitance(CORO, 0.3 * BUMP, settings=VirtualSensorSettings.ideal(coupling=c)) for c in (0, 0.05))
    assert shared == pytest.approx(coupled(plain, 0.05)) and shared.sum() == pytest.approx(plain.sum())


def test_a_step_of_force_creeps_as_its_prony_series():
    shares, taus, hold = (0.2, 0.1), (0.5, 4.0), 1.5
    read = branches(np.full((1, *BUMP.shape), 0.2), force_n=[30.0], trials=1, rate_n_per_s=np.inf, load_step_s=hold,
                    relaxation=shares, relaxation_s=taus).loading[0, 0]
    arrived = 1 - sum(g * np.exp(-hold / tau) for g, tau in zip(shares, taus, strict=True))
    assert read == pytest.approx(ideal_counts(CORO, np.full(BUMP.shape, 0.2 * arrived)))


def test_on_the_way_down_more_is_read_than_on_the_way_up():
    readings = branches(relaxation=0.15)
    middle = np.s_[:, :2, 3, 1:3]
    assert (readings.unloading[middle] > readings.loading[middle] + 1).all()


def test_faster_loading_lags_more():
    slow, fast = (branches(relaxation=0.15, rate_n_per_s=rate, load_step_s=0.1).loading[0, -1, 3, 1] for rate in (1.0, 100.0))
    assert fast < slow < branches().loading[0, -1, 3, 1]


def test_a_wrong_force_reads_what_the_press_gives_at_that_force():
    proportional = FORCES[:, None, None] / 400 * BUMP
    read = branches(proportional, force_scatter=0.05, trials=1).loading[0]
    error = np.random.default_rng([1, 1, 0, *b"a"]).standard_normal(3)[2]
    assert read == pytest.approx(ideal_counts(CORO, (1 + 0.05 * error) * proportional))


def test_a_misplaced_object_is_read_as_an_object_elsewhere():
    read = branches(0.1 * np.stack([X + 11, 2 * X + 22, 3 * X + 33]) / 33, placement_mm=0.05, trials=1).loading[0]
    shift = 0.05 * np.random.default_rng([1, 1, 0, *b"a"]).standard_normal(3)[0]
    moved = ideal_counts(CORO, 0.1 * np.stack([X + 11 - shift, 2 * (X + 11 - shift), 3 * (X + 11 - shift)]) / 33)
    assert read[:, :, 1:3] == pytest.approx(moved[:, :, 1:3], abs=0.02)     # inner taxels; counts are linear between map points


def test_gain_and_zero_are_the_specimens_in_every_press():
    of = VirtualSensorSettings.ideal(gain_scatter=0.03, offset_counts=5.0)
    specimen, first = make_specimen(CORO, seed=1, settings=of), branches(gain_scatter=0.03, offset_counts=5.0).loading[0]
    expected = np.maximum(specimen.gain * ideal_counts(CORO, PRESS) + specimen.offset_counts, 0)
    assert first == pytest.approx(expected)
    assert branches(gain_scatter=0.03, offset_counts=5.0, item="b").loading[0] == pytest.approx(expected)


def test_dead_taxels_read_zero_and_the_others_do_not_notice():
    read, whole = branches(dead_taxels=[0, 13], offset_counts=5.0, noise_counts=2.0).loading, branches(offset_counts=5.0,
                                                                                                      noise_counts=2.0).loading
    flat = read.reshape(-1, 28)
    assert (flat[:, [0, 13]] == 0).all() and (np.delete(flat, [0, 13], 1) == np.delete(whole.reshape(-1, 28), [0, 13], 1)).all()


def test_a_share_of_dead_taxels_is_met_over_many_specimens():
    tenth = VirtualSensorSettings(dead_share=0.1)
    assert np.mean([make_specimen(CORO, seed=k, settings=tenth).dead for k in range(200)]) == pytest.approx(0.1, abs=0.012)  # 3 se


def test_repeated_trials_scatter_though_the_models_input_is_one_map():
    readings = default()
    assert (readings[0] != readings[1]).any() and (readings[1] != readings[2]).any()


def test_a_seed_and_a_press_repeat_every_byte_and_others_do_not():
    assert default().tobytes() == default().tobytes()
    assert (default() != default(seed=2)).any() and (default() != default(item="b")).any()


def test_more_trials_leave_the_first_ones_as_they_were():
    assert (default(trials=5)[:3] == default()).all()


def test_one_effect_switched_off_leaves_the_other_draws_as_they_were():
    with_sheet, without = (make_specimen(CORO, seed=4, settings=VirtualSensorSettings(sheet_scatter=s)) for s in (0.02, 0.0))
    assert (with_sheet.gain == without.gain).all() and (with_sheet.offset_counts == without.offset_counts).all()


def test_sheets_scatter_about_their_thickness_as_stated():
    """40 specimens of 28 taxels: the mean of 1,120 draws is good to 0.03 standard deviations, the deviation to 2 %."""
    made = [make_specimen(CORO, seed=seed, settings=VirtualSensorSettings(sheet_scatter=0.02)) for seed in range(40)]
    share = np.array([one.sheet_excess_mm for one in made]) / CORO.dielectric.sheet_thickness_mm / 0.02
    assert abs(share.mean()) < 0.12 and share.std() == pytest.approx(1.0, abs=0.1)


def test_by_default_readings_are_whole_counts_in_the_range_and_near_the_ideal_ones():
    readings, ideal = default(), ideal_counts(CORO, PRESS)
    assert (readings == np.round(readings)).all() and readings.min() >= 0 and readings.max() <= 2400
    strong = ideal > 100
    assert np.abs(readings[:, strong] / ideal[strong] - 1).mean() < 0.15
    assert (default(PRESS + 2.0) == 2400).any()


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.2))
@settings(max_examples=10, deadline=None)
def test_a_deeper_press_never_reads_less_but_for_the_zero_of_the_converter(seed, size):
    rng = np.random.default_rng(seed)
    maps = rng.uniform(0, 0.2, PRESS.shape)
    effects = {name: value for name, value in SPECIMEN.items() if name != "dead_taxels"}
    assert (branches(maps + size * rng.random(PRESS.shape), **effects).loading >= branches(maps, **effects).loading).all()


def test_unusable_settings_are_refused_by_name():
    for values, said in [
        ({"nose_counts": 1}, "key 'nose_counts' is unknown; use one of electrode_spacing_mm"),
        ({"drift": -0.1}, "drift is -0.1; give one number of 0 or more"),
        ({"cycles_before": 1.7}, "cycles_before is 1.7; give a whole number"),
        ({"rate_n_per_s": 0}, "rate_n_per_s and largest_counts must be above 0"),
        ({"coupling": 0.3}, "coupling is 0.3; with four neighbours it is 0.25 at most"),
        ({"sheet_scatter": 0.4}, "sheet_scatter is 0.4; from 0.4 on a sheet could vanish"),
        ({"relaxation": 0.1}, "relaxation has 1 terms and relaxation_s 2; give as many"),
        ({"relaxation": [0.6, 0.4]}, "shares of 0 or more that sum to less than 1"),
        ({"relaxation": 0.1, "relaxation_s": 0}, "times above 0 s"),
    ]:
        with pytest.raises(InputError) as refusal:
            VirtualSensorSettings.from_dict(values)
        assert said in str(refusal.value), values


def test_settings_that_the_sensor_cannot_have_are_refused():
    for values, said in [({"dead_taxels": [28]}, "dead_taxels has 28; the taxels are numbered 0 to 27"),
                         ({"electrode_spacing_mm": 5.4}, "electrode_spacing_mm is 5.4, and a taxel 5.28571 mm wide")]:
        with pytest.raises(InputError) as refusal:
            make_specimen(CORO, seed=0, settings=VirtualSensorSettings.from_dict(values))
        assert said in str(refusal.value), values


def test_the_stage_writes_readings_of_the_way_up_and_the_way_down(tmp_path):
    press = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), PRESS), "normal_force_n": ("step", FORCES)},
                           attrs={"set": "indenters", "item": "a"})
    write_dataset(tmp_path / "press.nc", press, seed=0, settings={})
    rules = {"sensor": CORO.model_dump(mode="json"), "virtual_sensor": {"relaxation": [0.1], "relaxation_s": [2.0]}, "trials": 2,
             "seed": 1}
    stage.run(inputs={"press": tmp_path / "press.nc"}, outputs={"tactile": tmp_path / "tactile.nc"}, settings=rules)
    written = read_dataset(tmp_path / "tactile.nc")
    expected = read_branches(CORO, PRESS, force_n=FORCES, trials=2, seed=1, item="indenters/a",
                             settings=VirtualSensorSettings.from_dict(rules["virtual_sensor"]))
    assert (written.tactile_map.values == expected.loading).all()
    assert (written.unloading_tactile_map.values == expected.unloading).all()


def test_the_guide_names_every_setting_with_its_default():
    guide = (Path(__file__).parents[2] / "docs/explanation/virtual_sensor.md").read_text(encoding="utf-8")
    for name in VirtualSensorSettings.__dataclass_fields__:
        value = getattr(VirtualSensorSettings(), name)
        shown = f"[{', '.join(f'{v:g}' for v in value)}]" if isinstance(value, tuple) else str(value)
        shown = f"{value:g}" if isinstance(value, float) else shown
        assert f"`{name}: {shown}`" in guide, name


@pytest.mark.parametrize(("factor", "expected"), [(0.9, [0.9, 3.4, 4.8]), (1.1, [1.3, 4.1, 5.2]), (0.4, [0.4, 0.8, 2.8])])
def test_a_trial_at_other_forces_lies_between_the_load_steps_around_each_force(factor, expected):
    # 1, 4, 5 mm at 10, 20, 40 N, and none at rest; beyond the last load step on along the last line
    maps = np.array([1.0, 4.0, 5.0])[:, None, None] * np.ones((1, 2, 2))
    np.testing.assert_allclose(_at_force(maps, FORCES, factor)[:, 0, 0], expected, rtol=1e-12)
