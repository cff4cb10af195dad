"""The study that decides: its objects, its choice of what is tested, and verdicts that follow from simulated scores."""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import trimesh
import xarray

from softtact.contact.height_field import HeightField
from softtact.errors import InputError
from softtact.evaluation.curve_shape import lower_shares
from softtact.evaluation.decisions import NOT, REPRODUCED, UNDECIDED
from softtact.files import write_dataset
from softtact.geometry.generated import draw_objects
from softtact.press.sensor import Sensor
from softtact.studies.configuration import found_sensor
from softtact.studies.decide.claims import claims_of_decision
from softtact.studies.decide.config import COMPACT, CONTROLS, MODELS, PRINTED, load_study, read_values
from softtact.studies.decide.hypotheses import FAMILIES, Tables, hypothesis_table, shown_objects
from softtact.studies.decide.jobs import jobs
from softtact.studies.decide.policies import policy_scores
from softtact.studies.decide.pressing import press_item, sensor_of
from softtact.studies.decide.scoring import COLUMNS, SCORES, Case, fit_gain, mean_reading, read_case
from softtact.studies.decide.stages import presses as stages
from softtact.studies.decide.stages.judging import baseline_of_readouts, state_power, with_flatness
from softtact.studies.decide.stages.maps import map_robustness

STEPPED = draw_objects(0, 4, steps_mm=(0.1, 0.8), side_mm=22.0, seed=5)
STATISTICS = read_values("config/decide.yaml")["statistics"]
SEEDS = range(3)
SMALL = "config/small/few_frusta.yaml"


@pytest.mark.parametrize("made", STEPPED, ids=lambda made: made.name)
def test_the_lower_feature_stands_back_by_the_stated_step(made):
    """The object's underside has two levels, apart by the step to the rounding of single precision."""
    mesh = made.mesh()
    grid = np.linspace(-12, 12, 241)
    heights = HeightField(mesh).on_grid(grid, grid)
    below = np.sort(heights[heights < 0.9])
    levels, counts = np.unique(below.round(3), return_counts=True)
    low, high = sorted(levels[np.argsort(counts)[-2:]])
    assert (low, high) == pytest.approx((0.0, made.step_mm), abs=1e-3)
    assert mesh.is_watertight and mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-6)


def test_every_training_of_the_printed_network_is_a_job_and_all_scores_are_gathered(tmp_path):
    values = read_values("config/decide.yaml")
    values["learning"]["printed"]["seeds"] = 3
    made = jobs(load_study(values), tmp_path)
    learned = [job for job in made if job.stage == "learn"]
    seeds = {name: sorted(seed for job in learned if job.settings["architecture"] == name and job.settings["truth"] == "a"
                          and job.settings["model"] == "elastic" for seed in job.settings["seeds"]) for name in (COMPACT, PRINTED)}
    assert seeds == {COMPACT: [0, 1, 2, 3, 4], PRINTED: [0, 1, 2]} and len(learned) == (2 * len(MODELS) + 2 * 3) * (1 + 3)
    gathered = next(job for job in made if job.stage == "gather_scores")
    scores = [job.made()["scores"] for job in learned]
    assert sorted(gathered.inputs["networks"]) == sorted(scores) and len(set(scores)) == len(scores)


def test_only_a_network_that_asks_for_them_is_trained_on_the_controls(tmp_path):
    values = read_values("config/decide.yaml")
    values["learning"]["printed"]["controls"] = False
    made = jobs(load_study(values), tmp_path)
    truths = {name: {job.settings["truth"] for job in made if job.stage == "learn" and job.settings["architecture"] == name}
              for name in (COMPACT, PRINTED)}
    assert truths == {COMPACT: {"a", "b", *CONTROLS}, PRINTED: {"a", "b"}}


def test_controls_are_trained_for_the_models_that_they_compare_and_have_no_learning_curve(tmp_path):
    made = jobs(load_study(read_values("config/decide.yaml")), tmp_path)
    learned = [job.settings for job in made if job.stage == "learn"]
    assert {one["model"] for one in learned if one["truth"] in CONTROLS} == {"elastic", "matched", "hyperelastic"}
    assert {one["model"] for one in learned if one["truth"] not in CONTROLS} == set(MODELS)
    assert {job.settings["truth"] for job in made if job.stage == "trace_curve"} == {"a", "b"}


def test_a_learning_curve_ends_with_the_first_training_of_its_network(tmp_path):
    made = jobs(load_study(read_values("config/decide.yaml")), tmp_path)
    curves = [job for job in made if job.stage == "trace_curve"]
    assert {job.settings["architecture"] for job in curves} == {COMPACT, PRINTED} and len(curves) == 2 * 2 * len(MODELS)
    for job in curves:
        last = next(one for one in made if str(one.made().get("scores")) == job.inputs["whole"])
        alike = ("architecture", "truth", "model", "trained", "seed")
        assert last.settings["seeds"][0] == 0 and [last.settings[name] for name in alike] == [job.settings[name] for name in alike]


def test_a_policy_is_scored_where_all_models_that_it_chooses_are():
    """The policy by expected error takes the foundation model for one object, which was not read under the control."""
    names = ["elastic", "hyperelastic", "foundation"]
    rows = [(truth, model, "compact", 0, name, *[0.1] * 4) for truth, models in {"a": names, "ceiling": names[:2]}.items()
            for model in models for name in ("cap", "step")]
    scores = pd.DataFrame(rows, columns=["truth", "model", "readout", "seed", "object", "error_share", "ssim_own_range",
                                         "ssim_paper", "ssim_paper_whole"]).assign(kind="smooth", maps=1, largest_force_n=50.0)
    choices = pd.DataFrame({"object": ["cap", "step"], "rule": names[:2], "by_error": names[1:]})
    found = policy_scores(scores, choices)
    assert set(found.model[found.truth == "a"]) == {"hybrid", "random", "error", "oracle"}
    assert set(found.model[found.truth == "ceiling"]) == {"hybrid", "random", "oracle"}


def test_the_steps_are_spread_over_their_range():
    assert [made.step_mm for made in STEPPED] == pytest.approx([0.1, 0.333, 0.567, 0.8])


def test_another_mesh_of_an_object_has_more_points_and_the_same_surface():
    """Facets are split and not moved: heights agree to the rounding of single precision."""
    made, grid = STEPPED[1], np.linspace(-6, 6, 41)
    coarse, fine = made.mesh(), made.mesh(edge_length_mm=1.0)
    assert len(fine.faces) > 3 * len(coarse.faces)
    assert HeightField(fine).on_grid(grid, grid) == pytest.approx(HeightField(coarse).on_grid(grid, grid), abs=1e-4, nan_ok=True)


def test_the_same_seed_draws_the_same_objects_and_another_one_others():
    draw = {seed: draw_objects(2, 2, steps_mm=(0.1, 0.8), side_mm=22.0, seed=seed) for seed in (1, 2)}
    assert draw[1] == draw_objects(2, 2, steps_mm=(0.1, 0.8), side_mm=22.0, seed=1) != draw[2]


def test_the_share_of_a_lower_feature_is_the_ratio_of_the_means():
    """By hand: 0.2 mm under the feature that is 0.4 mm higher, 0.5 mm under the other; nan beside the object does not count."""
    heights = np.array([[0.0, 0.4, np.nan]])
    assert lower_shares(np.array([[[0.5, 0.2, 0.1]]]), heights, lower_mm=0.4) == pytest.approx([0.4])
    assert np.isnan(lower_shares(np.array([[[0.5, 0.2, 0.1]]]), heights, lower_mm=0.2)).all()


def test_one_gain_is_that_of_least_squares():
    assert fit_gain(np.array([1.0, 2.0]), np.array([2.0, 4.0])) == pytest.approx(2.0)


def test_the_mean_reading_is_that_of_the_indenters_at_each_force_and_takes_no_object():
    """Indenters read 10 and 30 at 1 N, 20 and 40 at 2 N; by hand 20 and 30, whatever the object reads."""
    counts = np.array([[10.0, 20.0], [30.0, 40.0], [700.0, 900.0]])[:, :, None, None] * np.ones((1, 1, 7, 4))
    case = Case(None, "a", ["ball", "bar", "cube"], ["indenters", "indenters", "stepped"], np.array([1.0, 2.0]), counts,
                {"elastic": np.zeros((3, 2, 33, 57))}, np.ones((3, 2), dtype=bool))
    samples, predicted = mean_reading(case)
    assert samples.labels.item.tolist() == ["cube", "cube"]
    assert predicted == pytest.approx(np.array([20.0, 30.0])[:, None, None] * np.ones((2, 7, 4)))


def test_the_mean_reading_stands_beside_every_readout_of_its_truth():
    scores = pd.DataFrame([("a", "elastic", "gap", 0.1), ("a", "elastic", "compact", 0.2), ("a", "mean_reading", "none", 0.8),
                           ("b", "elastic", "gap", 0.1), ("b", "mean_reading", "none", 0.7)],
                          columns=["truth", "model", "readout", "error_share"])
    found = baseline_of_readouts(scores)[["truth", "readout", "error_share"]].values.tolist()
    assert found == [["a", "gap", 0.8], ["a", "compact", 0.8], ["b", "gap", 0.7]]


@pytest.mark.parametrize(("scored", "expected"), [("truth", [True, True, False, False]), ("all", [True, False, False, False])])
def test_a_load_step_counts_where_the_truth_holds_and_all_models_have_a_map(tmp_path, scored, expected):
    """At 2 N the foundation model flags its map, at 3 N the elastic layer has none, at 4 N the truth does not hold."""
    models, forces = [*MODELS, "a"], [1.0, 2.0, 3.0, 4.0]
    maps, valid = np.zeros((len(models), 1, 4, 33, 57), np.float32), np.ones((len(models), 1, 4), np.int8)
    valid[models.index("foundation"), 0, 1] = valid[models.index("a"), 0, 3] = 0
    maps[models.index("elastic"), 0, 2] = np.nan
    axes = ("model", "item", "force")
    files = {"maps": xarray.Dataset({"deformation_map_mm": ((*axes, "y", "x"), maps), "valid": (axes, valid)},
                                    coords={"model": models, "item": ["ball"], "set": ("item", ["smooth"])}),
             "readings": xarray.Dataset({"tactile_map": (("item", "force", "row", "column"), np.zeros((1, 4, 7, 4)))},
                                        coords={"force_n": ("force", forces)}, attrs={"truth": "a", "model": "a"})}
    for name, data in files.items():
        write_dataset(tmp_path / f"{name}.nc", data, seed=None, settings={})
    case = read_case({name: tmp_path / f"{name}.nc" for name in files} | {"sensor": found_sensor("coro")}, scored)
    assert case.valid.tolist() == [expected]


def simulated(gain, *, objects=12, scatter=0.01, seed=0):
    """Scores of both models on stepped and smooth objects; the hyperelastic one errs by `gain` less on stepped ones."""
    rng = np.random.default_rng(seed)
    rows = []
    for kind, number in itertools.product(("smooth", "stepped"), range(objects)):
        hard = 0.02 * rng.standard_normal()
        for model in MODELS:
            better = gain * (kind == "stepped") * (model == "hyperelastic") + scatter * rng.standard_normal()
            for seed_of_training in SEEDS:
                error = 0.2 + hard - better + 0.001 * rng.standard_normal()
                names = ["a", model, "compact", seed_of_training, f"{kind}_{number:02d}", kind, 8, 50.0]
                rows.append(dict(zip(COLUMNS, [*names, error, *[1 - error] * 3], strict=True)))
    return pd.DataFrame(rows)


def tables_of(scores, *, shown=0.9):
    """The tables for a rule that gives stepped objects to the hyperelastic model, which takes 100 s, and the elastic one 1 s."""
    names = sorted(scores.object.unique())
    rule = ["hyperelastic" if name.startswith("stepped") else "elastic" for name in names]
    choices = pd.DataFrame({"object": names, "step_mm": 0.3, "rule": rule, "rules": [f"{one} {one}" for one in rule],
                            "by_error": rule, "share_hyperelastic": [float(one == "hyperelastic") for one in rule],
                            "time_elastic_s": 1.0, "time_foundation_s": 2.0, "load_per_core": 1.0,
                            "time_hyperelastic_s": 100.0 + np.arange(len(names))})
    curves = (("elastic", "elastic", 0.2), ("hyperelastic", "a", shown))
    collapse = pd.DataFrame([{"family": family, "model": model, "object": name, "force_n": 50.0, "ratio": ratio,
                              "lower_share": share} for name in names for family, model, share in curves for ratio in (0.5, 1.0)])
    power = pd.DataFrame({"claim": ["detail"], "readout": ["compact"], "power": [0.9], "power_of_claim": [0.6]})
    return Tables(pd.concat([scores, policy_scores(scores, choices)]), choices, collapse, power)


def points(shares, errors, *, indenters=40):
    """A learning curve of the compact network from the elastic model's maps."""
    return pd.DataFrame({"truth": "a", "model": "elastic", "readout": "compact", "share": shares, "indenters": indenters,
                         "error_share": errors})


def claim_of(name, tables, table):
    """The verdict on a claim by its tests."""
    curve = with_flatness(points([1.0], [0.2], indenters=[40]))
    claims = claims_of_decision(vars(tables) | {"hypotheses": table, "learning_curve": curve}, statistics=STATISTICS, truths=["a"],
                                printed=False)
    return claims.verdict.iloc[list(FAMILIES).index(name)]


def verdicts(tables):
    table = hypothesis_table(tables, statistics=STATISTICS, truths=["a"], seed=0)
    return {claim: set(own.verdict) for claim, own in table.groupby("claim")}


def test_a_clear_effect_holds_and_its_flipped_sign_fails():
    found, flipped = (verdicts(tables_of(simulated(gain))) for gain in (0.05, -0.05))
    assert found["detail"] == found["detail_more"] == found["not_stiffness"] == found["choice"] == {"holds"}
    assert flipped["detail"] == {"fails"} and flipped["choice"] == {"fails"}


def test_a_matched_layer_that_scores_less_than_the_printed_one_is_no_control_of_stiffness():
    scores = simulated(0.05)
    scores.loc[scores.model == "matched", list(SCORES)] += [0.1, -0.1, -0.1, -0.1]
    found = verdicts(tables_of(scores))
    assert found["detail"] == {"holds"} and found["not_stiffness"] == {"undecided"}


def test_no_effect_is_undecided():
    found = verdicts(tables_of(simulated(0.0)))
    assert found["detail"] == found["choice"] == {"undecided"}


def test_a_truth_without_the_detail_decides_nothing_on_details():
    found = verdicts(tables_of(simulated(0.05), shown=0.1))
    assert found["detail"] == {"undecided"} and found["choice"] == {"holds"}


def test_a_truth_that_shows_the_detail_only_at_forces_that_are_not_scored_decides_nothing_on_details():
    scores = simulated(0.05)
    found = verdicts(tables_of(scores.assign(largest_force_n=np.where(scores.object == "stepped_00", np.nan, 20.0))))
    assert found["detail"] == {"undecided"} and found["choice"] == {"holds"}


def test_a_test_that_holds_alone_may_be_undecided_beside_the_others_of_its_claim():
    """Holm's rule asks a tenth of the level of the first of ten tests; here of all of them, as they are alike."""
    tables = tables_of(simulated(0.011))
    many = replace(tables, scores=pd.concat([tables.scores.assign(readout=f"network {k}") for k in range(5)]))
    table = hypothesis_table(many, statistics=STATISTICS, truths=["a"], seed=0)
    own = table[(table.claim == "detail")]
    assert len(own) == 10 and set(own.alone) == {"holds"} and set(own.verdict) == {"undecided"}
    assert claim_of("detail", many, table) == REPRODUCED


def test_the_stated_power_is_that_of_each_readouts_trainings_and_of_the_distance_that_its_test_has(tmp_path):
    """A hybrid as good as the hyperelastic model is by the margin above the bound; five seeds tell more than three."""
    values = read_values("config/decide.yaml")
    values["learning"]["printed"]["seeds"] = 3
    made = next(job for job in jobs(load_study(values), tmp_path) if job.stage == "state_power")
    state_power(inputs={}, outputs={"power": tmp_path / "power.csv"}, settings=made.settings)
    table = pd.read_csv(tmp_path / "power.csv").set_index(["claim", "readout"])
    assert table.loc["balance"].effect.unique() == [STATISTICS["margin"]] and table.loc["detail"].effect.unique() == [0.03]
    assert table.seeds["detail"].to_dict() == {"gap": 1, "quadratic": 1, "compact": 5, "printed": 3}
    assert table.power["detail", "gap"] > table.power["detail", "compact"] > table.power["detail", "printed"]
    assert table.power_of_claim["detail", "gap"] == pytest.approx(table.power["detail"].prod() ** 4, rel=1e-4)


def test_a_network_of_a_single_training_is_undecided_and_has_no_power(tmp_path):
    scores = simulated(0.05)
    found = verdicts(tables_of(scores[scores.seed == 0]))
    assert found["detail"] == found["choice"] == {"undecided"}
    assert verdicts(tables_of(scores[scores.seed == 0].assign(readout="gap")))["detail"] == {"holds"}
    values = read_values("config/decide.yaml")
    values["learning"]["printed"]["seeds"] = 1
    made = next(job for job in jobs(load_study(values), tmp_path) if job.stage == "state_power")
    state_power(inputs={}, outputs={"power": tmp_path / "power.csv"}, settings=made.settings)
    table = pd.read_csv(tmp_path / "power.csv")
    assert (table.power[table.readout == "printed"] == 0).all() and (table.power[table.readout != "printed"] > 0).all()


def test_few_objects_are_undecided():
    assert all(words == {"undecided"} for words in verdicts(tables_of(simulated(0.05, objects=4))).values())


def test_a_hybrid_that_is_as_good_as_the_hyperelastic_model_is_within_the_margin():
    """No gain and a scatter of a fifth of the margin: the mean is 0, and above minus the margin with certainty."""
    assert verdicts(tables_of(simulated(0.0, scatter=0.002)))["balance"] == {"holds"}
    worse = simulated(0.0, scatter=0.002)
    worse.loc[worse.model == "elastic", list(SCORES)] += [2 * STATISTICS["margin"] * sign for sign in (2, -2, -2, -2)]
    assert verdicts(tables_of(worse))["balance"] == {"fails"}


def test_the_collapse_counts_what_a_model_shows_more_than_the_elastic_layer_at_equal_ratios():
    table = hypothesis_table(tables_of(simulated(0.0), shown=0.9), statistics=STATISTICS, truths=["a"], seed=0)
    assert table[table.claim == "collapse"]["mean"].tolist() == pytest.approx([0.7])      # .9 and .2 in `tables_of`


def test_where_the_lower_feature_is_not_reached_the_collapse_does_not_count_how_the_cover_rises():
    tables = tables_of(simulated(0.0), shown=0.9)
    tables.collapse.loc[(tables.collapse.model == "a") & (tables.collapse.ratio == 1.0), "lower_share"] = -0.5
    table = hypothesis_table(tables, statistics=STATISTICS, truths=["a"], seed=0)
    assert table[table.claim == "collapse"]["mean"].tolist() == pytest.approx([0.7])


def bump(x_mm, width_mm):
    """A map (21, 17) in mm of the small sensor: a round bump 0.1 mm deep."""
    y, x = np.meshgrid(np.linspace(-6, 6, 21), np.linspace(-4.8, 4.8, 17), indexing="ij")
    return 0.1 * np.exp(-((x - x_mm)**2 + y**2) / width_mm**2)


def map_of(tmp_path, maps, forces_n, *, invalid=(), scored="truth"):
    """Rows of the map of robustness of one truth; maps: {input: maps (step, y, x) of each object};  invalid: inputs' last steps."""
    paths = {name: [tmp_path / f"{name}_{number}.nc" for number in range(len(each))] for name, each in maps.items()}
    for name, each in maps.items():
        for path, steps in zip(paths[name], each, strict=True):
            data = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), np.array(steps)),
                                   "normal_force_n": ("step", forces_n),
                                   "within_validity": ("step", [1] * (len(forces_n) - 1) + [int(name not in invalid)])})
            write_dataset(path, data, seed=None, settings={})
    map_robustness(inputs=paths | {"sensor": SMALL}, outputs={"robustness": tmp_path / "robustness.csv"},
                   settings={"variants": [{"law": "made_up"}], "objects": list(range(len(paths["variants"]))), "forces_n": forces_n,
                             "seed": 0, "statistics": STATISTICS, "scored": scored})
    return pd.read_csv(tmp_path / "robustness.csv")


def test_the_model_whose_maps_are_the_truths_is_nearer_in_the_map_of_robustness_but_few_objects_decide_nothing(tmp_path):
    widths = {"variants": 2.0, "presses_hyperelastic": 2.0, "presses_elastic": 3.5, "presses_matched": 3.0}
    table = map_of(tmp_path, {name: [[bump(place, width)] for place in (-2.0, 0.0, 2.0)] for name, width in widths.items()}, [2.5])
    row = table.iloc[0]
    assert len(table) == 1 and row.force_n == "all"
    assert row.error_hyperelastic == pytest.approx(0, abs=1e-9) and row.gain_over_elastic > row.gain_over_matched > 0.05
    assert row.verdict_over_elastic == row.verdict_over_matched == UNDECIDED


def test_a_layer_right_at_each_force_but_for_a_factor_is_wrong_at_all_together_in_the_map_of_robustness(tmp_path):
    """The best gain turns readings of 1 and 2 into .8 and 1.6 in place of 1 and 1.5: an error of .3 over 2.5."""
    growth = {"variants": 1.5, "presses_hyperelastic": 1.5, "presses_elastic": 2.0, "presses_matched": 2.0}
    small = {place: 1e-3 * bump(place, 2.0) for place in (-2.0, 0.0, 2.0)}      # readings are nearly linear in such deformations
    table = map_of(tmp_path, {name: [[one, factor * one] for one in small.values()] for name, factor in growth.items()}, [1.0, 2.0])
    assert list(table.force_n) == ["all", "1", "2"]
    np.testing.assert_allclose(table.error_elastic, [0.12, 0.0, 0.0], atol=0.01)
    np.testing.assert_allclose(table.error_hyperelastic, 0.0, atol=1e-9)


@pytest.mark.parametrize(("scored", "invalid", "count"), [("all", "presses_elastic", 0), ("truth", "presses_elastic", 3),
                                                          ("truth", "variants", 0)])
def test_all_models_of_the_map_of_robustness_are_scored_at_the_same_load_steps(tmp_path, scored, invalid, count):
    """What the truth flags at 2 N does not count; where the elastic layer does, all count or none does, as the study asks."""
    names = ("variants", "presses_hyperelastic", "presses_elastic", "presses_matched")
    maps = {name: [[bump(place, 2.0), (1.0 + 0.5 * number) * bump(place, 2.0)] for place in (-2.0, 0.0, 2.0)]
            for number, name in enumerate(names)}
    table = map_of(tmp_path, maps, [1.0, 2.0], invalid=[invalid], scored=scored).set_index("force_n")
    assert table.objects.to_dict() == {"all": 3, "1": 3, "2": count}
    errors = table.filter(like="error_").loc["all"].to_numpy()
    assert (errors == pytest.approx(0.0, abs=1e-9)) == (count == 0)


def test_an_elastic_layer_twice_as_stiff_needs_twice_the_force_for_the_same_map(tmp_path):
    trimesh.creation.icosphere(subdivisions=3, radius=4.0).export(tmp_path / "ball.stl")
    model = {"kind": "elastic", "plane": "surface", "young_mpa": "printed"}
    printed = sensor_of(SMALL, model).spec.elastic_layer.young_mpa
    one, twice = (press_item(sensor_of(SMALL, model, young_mpa=factor * printed), model, tmp_path / "ball.stl", unit="mm",
                             forces_n=[factor]) for factor in (1.0, 2.0))
    np.testing.assert_allclose(twice.deformation_map_mm, one.deformation_map_mm, atol=1e-6)


def test_a_press_takes_the_threads_of_its_job(tmp_path, monkeypatch):
    """Beside another job, a press on all cores would wait for it at every step."""
    trimesh.creation.icosphere(subdivisions=2, radius=4.0).export(tmp_path / "ball.stl")
    model = {"kind": "elastic", "plane": "surface", "young_mpa": "printed"}
    taken, press = [], Sensor.press
    monkeypatch.setattr(Sensor, "press", lambda *args, **options: taken.append(options["threads"]) or press(*args, **options))
    settings = {"name": "elastic", "model": model, "item": "ball", "unit": "mm", "forces_n": [1.0],
                "items": [{"item": "ball", "unit": "mm"}]}
    ball, one, many = (tmp_path / name for name in ("ball.stl", "one.nc", "many.nc"))
    stages.press(inputs={"object": ball, "sensor": SMALL}, outputs={"press": one}, settings=settings, threads=3)
    stages.press_fast(inputs={"objects": [ball], "sensor": SMALL}, outputs={"presses": [many]}, settings=settings, threads=2)
    assert taken == [3, 2]


def test_half_of_the_objects_at_a_hundredth_of_the_time_costs_half_and_is_not_told_from_it():
    """The hybrid takes 50.5 % of the time where half of the objects are elastic: no more than the scatter above one half."""
    assert verdicts(tables_of(simulated(0.05)))["cost"] == {"undecided"}


def test_shown_objects_are_counted_at_the_largest_force():
    table = pd.DataFrame({"model": "a", "object": ["one", "one", "two", "two"], "force_n": [10.0, 50.0, 10.0, 50.0],
                          "lower_share": [0.1, 0.4, 0.5, 0.2]})
    assert shown_objects(table, share=0.3) == {"a": 1}


def test_chance_scores_between_the_models_and_the_oracle_at_least_as_well_as_each():
    scores = simulated(0.05)
    table = tables_of(scores).scores.groupby("model").error_share.mean()
    assert table["random"] == pytest.approx(0.5 * (table["elastic"] + table["hyperelastic"]))
    assert table["oracle"] <= min(table["elastic"], table["hyperelastic"], table["hybrid"])


@pytest.mark.parametrize(("gain", "verdict"), [(0.05, REPRODUCED), (-0.05, NOT), (0.0, UNDECIDED)])
def test_the_claims_follow_the_tests(gain, verdict):
    tables = tables_of(simulated(gain))
    table = hypothesis_table(tables, statistics=STATISTICS, truths=["a"], seed=0)
    curve = with_flatness(points([0.5, 1.0], [0.2, 0.199], indenters=[20, 40]))
    claims = claims_of_decision(vars(tables) | {"hypotheses": table, "learning_curve": curve}, statistics=STATISTICS,
                                truths=["a"], printed=False)
    assert claims.verdict.iloc[0] == verdict
    assert claims.verdict.iloc[-1] == REPRODUCED      # the curve falls by 0.5 % where indenters are doubled


@pytest.mark.parametrize(("shown", "verdict"), [(0.9, REPRODUCED), (0.1, NOT), (0.2, UNDECIDED)])
def test_the_claim_of_two_curves_fails_where_one_of_its_tests_does(shown, verdict):
    """Elastic layers show 0.2; the truth is one test of two, the other one holds."""
    tables = tables_of(simulated(0.0), shown=shown)
    table = hypothesis_table(tables, statistics=STATISTICS, truths=["a"], seed=0)
    rows = pd.concat([table, table[table.claim == "collapse"].assign(truth="b", alone="holds", verdict="holds")])
    curve = with_flatness(points([1.0], [0.2], indenters=[40]))
    claims = claims_of_decision(vars(tables) | {"hypotheses": rows, "learning_curve": curve}, statistics=STATISTICS,
                                truths=["a"], printed=False)
    assert claims.verdict.iloc[-2] == verdict


def test_a_learning_curve_is_flat_by_what_twice_as_many_indenters_would_gain():
    """By hand: 4 % from three quarters on are 1 - .96^(ln 2 / ln (4 / 3)) = 9.4 % for twice as many."""
    curve = points([0.75, 1.0], [0.2, 0.192])
    found = with_flatness(curve)
    assert found.last_fall.to_list() == pytest.approx([0.0937, 0.0937], abs=1e-4) and not found.flat.any()


def test_a_learning_curve_that_still_falls_is_not_flat():
    curve = points([0.5, 1.0], [0.2, 0.15])
    assert not with_flatness(curve).flat.any()


def test_models_that_the_hypotheses_need_must_be_there():
    values = read_values("config/decide.yaml")
    del values["models"]["matched"]
    with pytest.raises(InputError, match="models has no 'matched'"):
        load_study(values, "mine.yaml")


def test_the_truths_of_the_default_study_differ_from_the_tested_model_in_law_and_mesh():
    study = load_study(read_values("config/decide.yaml"), "config/decide.yaml")
    tested = study.values.models["hyperelastic"]
    for truth in study.values.truths.values():
        assert (truth.law, truth.bulk_over_shear) != (tested.law, tested.bulk_over_shear) and truth.mesh != tested.mesh
    assert len(study.objects) >= 24 and len(study.indenters) >= 49
