"""Data sets: what is joined, how it is split, and what is refused."""

import numpy as np
import pandas as pd
import pytest
from formula_study import MODELS

from softtact.errors import ConvergenceError, InputError
from softtact.learning.dataset import SPLITS, build_datasets, read_samples
from softtact.studies.hybrid.stages import build_dataset


def build(study, **changes):
    return build_datasets(study.presses, study.tactile, **{**study.settings, **changes})


def split_depths_of(data):
    """{(item, force)} of a split."""
    return set(zip(data["item"].values.tolist(), data.force_n.values.tolist(), strict=True))


def run_stage(study, folder, **changes):
    outputs = {split: [folder / f"dataset/{model}/{split}.nc" for model in MODELS] for split in SPLITS}
    outputs["manifest"] = folder / "dataset/manifest.csv"
    build_dataset.run(inputs=study.write(folder), outputs=outputs, settings={**study.settings, **changes})
    return outputs


def test_four_fifths_of_the_indenters_load_steps_train_and_the_rest_validates(study):
    datasets, _ = build(study)
    train, validation = split_depths_of(datasets["elastic", "train"]), split_depths_of(datasets["elastic", "validation"])
    assert len(train) == round(0.8 * 18) and len(train | validation) == 18 and not train & validation


def test_trials_of_one_load_step_stay_on_one_side(study):
    datasets, _ = build(study)
    maps = {split: {image.tobytes() for image in datasets["elastic", split].deformation_map_mm.values}
            for split in SPLITS}
    assert not maps["train"] & (maps["validation"] | maps["unseen"] | maps["grasps"])
    assert not maps["validation"] & (maps["unseen"] | maps["grasps"])


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_one_another_split(study, tmp_path):
    first, again, other = (run_stage(study, tmp_path / name, seed=seed)["train"][0].read_bytes()
                           for name, seed in (("first", 1), ("again", 1), ("other", 2)))
    assert first == again != other


def test_no_item_of_a_test_is_trained_on(study):
    datasets, _ = build(study)
    trained = set(datasets["elastic", "train"]["item"].values) | set(datasets["elastic", "validation"]["item"].values)
    assert trained == {f"form_{k}" for k in range(6)}
    assert set(datasets["elastic", "unseen"]["item"].values) == {"hexagon"}
    assert set(datasets["elastic", "grasps"]["item"].values) == {"object_1"}


def test_both_models_hold_the_same_samples_in_the_same_order(study):
    for split in SPLITS:
        datasets, _ = build(study)
        a, b = datasets["elastic", split], datasets["hyperelastic", split]
        for name in ("item", "trial", "force_n", "tactile_map"):
            assert np.array_equal(a[name].values, b[name].values), split
        assert b.deformation_map_mm.values == pytest.approx(0.8 * a.deformation_map_mm.values, rel=1e-6), split


def test_each_sample_is_its_own_press_and_reading(study):
    datasets, _ = build(study)
    data = datasets["elastic", "train"]
    for k in range(data.sizes["sample"]):
        key = ("indenters", data["item"].values[k])
        load_step = [10.0, 20.0, 30.0].index(data.force_n.values[k])
        assert np.array_equal(data.deformation_map_mm.values[k],
                              np.float32(study.presses["elastic", *key].deformation_map_mm.values[load_step]))
        assert np.array_equal(data.tactile_map.values[k],
                              np.float32(study.tactile[key].tactile_map.values[data.trial.values[k], load_step]))


def test_training_samples_are_shuffled(study):
    items = build(study)[0]["elastic", "train"]["item"].values.tolist()
    assert items != sorted(items)


def test_the_split_depends_on_the_seed_and_not_on_the_order_of_the_items(study):
    first = split_depths_of(build(study)[0]["elastic", "train"])
    assert split_depths_of(build(study, items=study.settings["items"][::-1])[0]["elastic", "train"]) == first
    assert split_depths_of(build(study, seed=4)[0]["elastic", "train"]) != first


def test_the_mean_over_the_trials_may_stand_for_them_in_training_only(study):
    datasets, _ = build(study, training_trials="mean")
    data = datasets["elastic", "train"]
    assert len(split_depths_of(data)) == data.sizes["sample"] and set(data.trial.values) == {-1}
    reading = study.tactile["indenters", data["item"].values[0]]
    load_step = [10.0, 20.0, 30.0].index(data.force_n.values[0])
    assert data.tactile_map.values[0] == pytest.approx(reading.tactile_map.values[:, load_step].mean(axis=0), rel=1e-5)
    assert set(datasets["elastic", "validation"].trial.values) == {0, 1, 2}


def test_a_load_step_outside_one_models_validity_is_left_out_for_all_and_stands_in_the_manifest(study):
    key = ("elastic", "indenters", "form_0")
    study.presses[key]["within_validity"].values[2] = 0
    datasets, manifest = build(study)
    for model in MODELS:
        used = split_depths_of(datasets[model, "train"]) | split_depths_of(datasets[model, "validation"])
        assert ("form_0", 30.0) not in used and ("form_0", 20.0) in used
    left_out = manifest[manifest.split == "out_of_range"]
    assert len(left_out) == 2 * 3
    assert left_out.groupby("model").within_validity.first().to_dict() == {"elastic": 0, "hyperelastic": 1}


def test_the_manifest_has_a_row_per_model_load_step_and_trial(study):
    manifest = build(study)[1]
    assert manifest.columns.tolist()[:7] == ["set", "item", "model", "force_n", "trial", "split", "converged"]
    assert len(manifest) == 2 * 8 * 3 * 3 and not manifest.duplicated(["set", "item", "model", "force_n", "trial"]).any()


def test_a_press_that_did_not_converge_stops_the_stage_with_its_name(study, tmp_path):
    study.presses["elastic", "indenters", "form_2"]["converged"].values[1] = 0
    with pytest.raises(ConvergenceError, match=r"form_2/elastic.nc: the press of form_2 .* elastic .* at 20 N"):
        run_stage(study, tmp_path)
    assert not (tmp_path / "dataset").exists()


def drop_press(study):
    del study.presses["hyperelastic", "unseen", "hexagon"]


def drop_reading(study):
    del study.tactile["grasps", "object_1"]


def repeat_item(study):
    study.settings["items"].append({"set": "unseen", "item": "form_1"})


def shift_forces(study):
    study.tactile["indenters", "form_1"]["force_n"].values[2] = 35.0


def spoil_map(study):
    study.presses["elastic", "unseen", "hexagon"]["deformation_map_mm"].values[0, 3, 3] = np.nan


def spoil_reading(study):
    study.tactile["unseen", "hexagon"]["tactile_map"].values[0, 0, 3, 3] = np.inf


def leak(study):
    seen, test = ("elastic", "indenters", "form_1"), ("elastic", "grasps", "object_1")
    study.presses[test] = study.presses[seen].assign_attrs(study.presses[test].attrs)


def leave_nothing(study):
    study.presses["elastic", "unseen", "hexagon"]["within_validity"].values[:] = 0


def mix_sources(study):
    study.tactile["unseen", "hexagon"].attrs["source"] = "published archive"


@pytest.mark.parametrize(("fault", "sentence"), [
    (drop_press, "unseen/hexagon: there is no press with the model hyperelastic"),
    (drop_reading, "grasps/object_1: there is no reading"),
    (repeat_item, "form_1: it is in the sets indenters and unseen"),
    (shift_forces, "indenters/form_1: the press with the model elastic is at 10, 20, 30 N and the reading at 10, 20, 35 N"),
    (spoil_map, "the press of unseen/hexagon with the model elastic: .* not finite"),
    (spoil_reading, "the reading of unseen/hexagon: .* not finite"),
    (leak, "grasps/object_1: its deformation map at 10 N equals one of the training indenter form_1"),
    (leave_nothing, "no load step is left for unseen"),
    (mix_sources, "published archive and virtual sensor; do not mix"),
])
def test_presses_and_readings_that_cannot_be_used_are_refused_in_one_sentence(study, fault, sentence):
    fault(study)
    with pytest.raises(InputError, match=sentence):
        build(study)


def test_maps_of_zeros_before_the_touch_are_no_leak(study):
    for press in study.presses.values():
        press.deformation_map_mm.values[0] = 0
    datasets, _ = build(study)
    assert len(datasets["elastic", "grasps"].sample) == 9


def test_a_wrong_setting_is_refused_with_its_name(study):
    for changes in [{"train_fraction": 1.0}, {"training_trials": "some"}]:
        with pytest.raises(InputError, match=f"{next(iter(changes))} is "):
            build(study, **changes)


@pytest.mark.slow
def test_the_stage_writes_splits_that_read_back_and_the_same_bytes_again(study, tmp_path):
    outputs = run_stage(study, tmp_path / "a")
    again = run_stage(study, tmp_path / "b")
    for name in (*SPLITS, "manifest"):
        first, second = ([paths] if name == "manifest" else paths for paths in (outputs[name], again[name]))
        assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    samples = read_samples(outputs["grasps"][1])
    assert (samples.model, samples.split, samples.source) == ("hyperelastic", "grasps", "virtual sensor")
    assert samples.maps_mm.shape == (9, 57, 33) and samples.counts.shape == (9, 7, 4)
    assert samples.labels["item"].tolist() == ["object_1"] * 9
    assert pd.read_csv(outputs["manifest"]).shape == (144, 8)
