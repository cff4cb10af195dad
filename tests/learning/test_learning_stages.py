"""Search, training and evaluation on files, with the settings that the workflow gives them."""

import json

import numpy as np
import pandas as pd
import pytest
from formula_study import MODELS, Study
from support.sensors import CORO

from softtact.errors import InputError
from softtact.evaluation.scoring import SSIM_COLUMNS
from softtact.files import read_dataset, read_json
from softtact.learning.dataset import SPLITS, read_samples
from softtact.learning.network import load_network, predict
from softtact.studies.hybrid.stages import (
    build_dataset,
    compare_networks,
    draw,
    evaluate,
    find_learning_rate,
    retraining,
    score_baselines,
    search_hyperparameters,
    train_cnn,
)

pytestmark = pytest.mark.slow      # a study's training; the tiny study runs each of these stages too

SPACE = {"filters": [[2, 4], [2, 4], [2, 4]], "dense": [8, 24], "learning_rate": [1e-3, 1e-2]}
SETTINGS = {"search": {"trials": 2, "max_epochs": 2, "batch": 8, "space": SPACE},
            "training": {"epochs": 3, "patience": 3, "batch": 8, "device": "cpu", "rates": [1e-3, 4e-3], "rate_epochs": 1},
            "network": {"architecture": "printed", "filters": [3, 4, 5], "dense": 16},
            "ssim": {"window": 3, "data_range": 2400}, "device": "cpu", "seed": 3}


def settings_of(*keys, **changes):
    """Settings as they arrive through the command line."""
    return json.loads(json.dumps({**{key: SETTINGS[key] for key in keys}, **changes}))


def run_search(folder, model):
    outputs = {"search": folder / f"learning/{model}/search.csv", "best": folder / f"learning/{model}/best.json"}
    search_hyperparameters.run(inputs=training_inputs(folder, model), outputs=outputs,
                               settings=settings_of("search", "network", "ssim", "device", "seed"))
    return outputs


def run_rates(folder, model):
    outputs = {"rates": folder / f"learning/{model}/rates.csv", "rate": folder / f"learning/{model}/rate.json"}
    find_learning_rate.run(inputs=training_inputs(folder, model), outputs=outputs,
                           settings=settings_of("training", "network", "ssim", "seed"))
    return outputs


def run_training(folder, model, *, into="learning", **changes):
    inputs = {**training_inputs(folder, model), **{name: folder / f"learning/{model}/{name}.json" for name in ("best", "rate")}}
    outputs = {name: folder / into / model / file for name, file in
               {"model": "model.pt", "history": "history.csv", "timing": "timing.csv"}.items()}
    train_cnn.run(inputs=inputs, outputs=outputs, settings=settings_of("training", "network", "ssim", "seed", **changes))
    return outputs


def training_inputs(folder, model):
    return {split: folder / f"dataset/{model}/{split}.nc" for split in ("train", "validation")}


def run_evaluation(folder, inputs):
    outputs = {name: folder / "evaluation" / file for name, file in
               {"ssim": "ssim.csv", "per_item": "items.csv", "summary": "summary.csv", "ceiling": "ceiling.csv",
                "timing": "timing.csv", "predictions": "predictions.nc"}.items()}
    evaluate.run(inputs=inputs, outputs=outputs, settings=settings_of("ssim", "seed"))
    return outputs


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder, inputs of the evaluation and its outputs, after all learning stages."""
    folder, study = tmp_path_factory.mktemp("study"), Study()
    inputs = study.write(folder)
    datasets = {split: [folder / f"dataset/{model}/{split}.nc" for model in MODELS] for split in SPLITS}
    build_dataset.run(inputs=inputs, outputs={**datasets, "manifest": folder / "dataset/manifest.csv"},
                      settings=study.settings)
    networks = []
    for model in MODELS:
        run_search(folder, model)
        run_rates(folder, model)
        networks.append(run_training(folder, model)["model"])
    tests = {split: datasets[split] for split in ("validation", "unseen", "grasps")}
    inputs = {"networks": networks, "presses": inputs["presses"], **tests}
    return folder, inputs, run_evaluation(folder, inputs)


@pytest.mark.slow
def test_the_history_has_a_row_per_epoch_and_no_wall_time(finished):
    history = pd.read_csv(finished[0] / "learning/elastic/history.csv")
    assert history.columns.tolist() == ["epoch", "train_loss", "validation_loss", "validation_ssim", "learning_rate"]
    assert history.epoch.tolist() == [1, 2, 3]
    assert pd.read_csv(finished[0] / "learning/elastic/timing.csv").columns.tolist() == ["epoch", "wall_time_s"]


@pytest.mark.slow
def test_the_model_file_holds_the_best_epochs_weights_and_the_printed_networks_own_learning_rate(finished):
    folder = finished[0]
    network, facts = load_network(folder / "learning/elastic/model.pt")
    history = pd.read_csv(folder / "learning/elastic/history.csv")
    assert facts["epoch"] == history.epoch[history.validation_loss.idxmin()] and facts["model"] == "elastic"
    validation = read_samples(folder / "dataset/elastic/validation.nc")
    loss = np.abs(predict(network, validation.maps_mm) - validation.counts).sum(axis=(1, 2)).mean()
    assert loss == pytest.approx(facts["validation_loss"], rel=1e-5)
    rates = pd.read_csv(folder / "learning/elastic/rates.csv").set_index("learning_rate").validation_loss
    found = read_json(folder / "learning/elastic/rate.json")
    assert history.learning_rate[0] == found["learning_rate"] == rates.idxmin() and found["architecture"] == "printed"


def test_no_checkpoint_stays_behind(finished):
    assert not list(finished[0].glob("learning/*/checkpoint.pt"))


def test_the_same_settings_give_the_same_bytes(finished):
    folder = finished[0]
    again = run_training(folder, "elastic", into="again")
    for name, file in (("model", "model.pt"), ("history", "history.csv")):
        assert again[name].read_bytes() == (folder / "learning/elastic" / file).read_bytes()


def test_the_printed_architecture_or_the_searched_one_is_trained(finished):
    folder = finished[0]
    best = read_json(folder / "learning/elastic/best.json")
    searched = run_training(folder, "elastic", into="searched", network={"architecture": "searched"})["model"]
    assert load_network(folder / "learning/elastic/model.pt")[0].options["filters"] == [3, 4, 5]
    options = load_network(searched)[0].options
    assert (options["filters"], options["dense"]) == (best["filters"], best["dense"])


def test_the_compact_network_is_trained_with_its_own_rate_and_epochs(finished):
    compact = {"architecture": "compact", "compact": {"filters": [2, 3, 4], "learning_rate": 0.004, "epochs": 2}}
    outputs = run_training(finished[0], "elastic", into="compact", network=compact)
    network, facts = load_network(outputs["model"])
    assert (network.architecture, network.options["filters"], facts["model"]) == ("compact", [2, 3, 4], "elastic")
    assert pd.read_csv(outputs["history"]).learning_rate.tolist() == [0.004, 0.002]


def test_the_model_file_tells_what_maps_it_was_trained_on(finished):
    _, facts = load_network(finished[0] / "learning/elastic/model.pt")
    train = read_samples(finished[0] / "dataset/elastic/train.nc")
    assert facts["range"]["force_n"] == [10.0, 30.0]
    assert facts["range"]["map_max_mm"] == pytest.approx([train.maps_mm.max(axis=(1, 2)).min(), train.maps_mm.max()])


@pytest.mark.slow
def test_both_architectures_stand_in_one_table_and_one_figure(finished):
    folder, inputs, _ = finished
    runs = [run_training(folder, model, into=f"beside/{kind}", network={**SETTINGS["network"], "architecture": kind})
            for kind in ("printed", "compact") for model in MODELS]
    files = {name: [run[one] for run in runs]
             for name, one in (("networks", "model"), ("timings", "timing"), ("histories", "history"))}
    tests = {name: inputs[name] for name in ("validation", "unseen", "grasps")}
    score_baselines.run(inputs={**tests, "train": [folder / f"dataset/{model}/train.nc" for model in MODELS]},
                        outputs={name: folder / f"evaluation/{name}.csv" for name in ("baselines", "taxels")},
                        settings=settings_of("ssim", sensor=CORO.model_dump(mode="json"), counts_per_relative_change=1000.0))
    files |= {"baselines": folder / "evaluation/baselines.csv", "ceiling": finished[2]["ceiling"]}
    table = folder / "tables/networks.csv"
    outputs = {"networks": table, "verdicts": folder / "evaluation/verdicts.json",
               **{name: folder / f"tables/{name}.csv" for name in ("scores", "levels")}}
    compare_networks.run(inputs={**files, **tests}, outputs=outputs, settings=settings_of("ssim", "seed", architecture="printed"))
    rows, scores = pd.read_csv(table), pd.read_csv(outputs["scores"])
    assert scores.groupby(["model", "set", "force"]).size().unique().tolist() == [2 + 8 + 1]     # networks, baselines, the sensor
    assert rows.mean_reading_ssim.notna().all() and set(rows.remains) <= {"noise", "optimiser", "data", "network"}
    assert len(pd.read_csv(outputs["levels"])) == len(scores) / 4 and read_json(outputs["verdicts"])["sentences"]
    assert len(rows) == 2 * 2 * 3 and rows.architecture.unique().tolist() == ["printed", "compact"]
    summary = pd.read_csv(finished[2]["summary"])
    own = rows[rows.architecture == "printed"]
    assert own.ssim.tolist() == pytest.approx(summary.ssim.tolist(), rel=1e-5)
    pictures = {kind: folder / f"figures/fig9.{kind}" for kind in ("png", "svg")}
    draw.draw_fig9_networks(inputs={"networks": table, "histories": [run["history"] for run in runs]}, outputs=pictures,
                           settings=settings_of("ssim"))
    assert all(path.stat().st_size > 10_000 for path in pictures.values())


def test_the_learning_curve_has_a_row_per_network_share_and_set_with_intervals_where_there_are_objects(finished):
    folder, inputs, _ = finished
    curve = {"shares": [0.5, 1.0], "steps": 4, "networks": ["printed", "compact"]}
    files = {split: folder / f"dataset/elastic/{split}.nc" for split in SPLITS} | {"rate": folder / "learning/elastic/rate.json"}
    outputs = {"curve": folder / "learning/elastic/learning_curve.csv"}
    retraining.learning_curve(inputs=files, outputs=outputs,
                              settings=settings_of("training", "network", "ssim", "seed", learning_curve=curve))
    rows = pd.read_csv(outputs["curve"])
    train = len(read_samples(files["train"]))
    assert len(rows) == 2 * 2 * 3 and rows.maps.unique().tolist() == [train // 2, train]
    assert rows.architecture.unique().tolist() == ["printed", "compact"] and (rows.model == "elastic").all()
    validation = rows[rows["set"] == "validation"]
    assert (validation.ssim_low < validation.ssim).all() and (validation.ssim < validation.ssim_high).all()
    assert rows[rows["set"] == "unseen"].ssim_low.isna().all()      # one object: no interval


def test_a_given_learning_rate_is_used_instead_of_the_searchs(finished):
    outputs = run_training(finished[0], "elastic", into="given",
                           training={**SETTINGS["training"], "learning_rate": 0.004})
    assert pd.read_csv(outputs["history"]).learning_rate[0] == 0.004


def test_every_map_of_the_three_tests_is_scored_for_each_model(finished):
    folder, inputs, outputs = finished
    scores = pd.read_csv(outputs["ssim"])
    assert scores.columns.tolist() == SSIM_COLUMNS
    for k, model in enumerate(MODELS):
        for split in ("validation", "unseen", "grasps"):
            rows = scores[(scores.model == model) & (scores["set"] == split)]
            assert len(rows) == len(read_samples(inputs[split][k])) > 0
    assert scores.ssim.between(-1, 1).all() and (scores.mae_counts > 0).all()


def test_the_ceiling_lies_above_the_networks(finished):
    ceiling, scores = (pd.read_csv(finished[2][name]) for name in ("ceiling", "ssim"))
    assert set(ceiling["set"]) == {"validation", "unseen", "grasps"}
    assert ceiling.ssim.mean() > scores.ssim.mean()


def test_times_and_predictions_cover_the_presses_and_the_grasps(finished):
    timing = pd.read_csv(finished[2]["timing"])
    assert timing.columns.tolist() == ["model", "item", "set", "force_n", "solver_s", "network_s"]
    assert len(timing) == 2 * 8 * 3 and (timing.solver_s == 1.5 * timing.force_n).all() and (timing.network_s > 0).all()
    predictions = read_dataset(finished[2]["predictions"])
    assert predictions.tactile_map.shape == (2, 1, 3, 7, 4) and predictions["model"].values.tolist() == MODELS


def test_scores_and_predictions_are_the_same_bytes_again(finished):
    folder, inputs, outputs = finished
    again = run_evaluation(folder / "again", inputs)
    for name in ("ssim", "per_item", "summary", "ceiling", "predictions"):
        assert again[name].read_bytes() == outputs[name].read_bytes()


def test_a_file_that_is_no_data_set_is_refused(finished):
    with pytest.raises(InputError, match="not a split of a data set"):
        read_samples(finished[0] / "presses/unseen/hexagon/elastic.nc")


def test_the_same_training_from_several_seeds_shows_how_much_of_a_score_is_chance(finished):
    folder, inputs, _ = finished
    files = {split: folder / f"dataset/elastic/{split}.nc" for split in SPLITS} | {"rate": folder / "learning/elastic/rate.json"}
    retraining.repeat_learning(inputs=files, outputs={"seeds": folder / "seeds.csv"},
                               settings=settings_of("training", "network", "ssim", "seed",
                                                    repeats={"seeds": 3, "networks": ["printed"]}))
    rows = pd.read_csv(folder / "seeds.csv")
    assert sorted(rows.seed.unique()) == [3, 4, 5] and len(rows) == 3 * 3 and rows[rows["set"] == "grasps"].ssim.nunique() == 3
    own = pd.read_csv(finished[2]["summary"]).query("model == 'elastic'").set_index("set").ssim
    first = rows[rows.seed == 3].set_index("set").ssim
    assert first.to_dict() == pytest.approx(own[first.index].to_dict(), rel=1e-4)     # the study's own training is the first
    retraining.gather_seeds(inputs={"seeds": [folder / "seeds.csv"]}, outputs={"table": folder / "spread.csv"}, settings={})
    spread = pd.read_csv(folder / "spread.csv").set_index("set")
    assert spread.ssim_sd["grasps"] == pytest.approx(rows[rows["set"] == "grasps"].ssim.std(), rel=1e-3)
    assert (spread.seeds == 3).all()
