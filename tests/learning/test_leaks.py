"""Nothing that a test calls unseen was trained on: over the items of the studies' own configurations."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from softtact.errors import InputError
from softtact.learning.dataset import assign_splits, check_items, list_load_steps, object_of
from softtact.studies.hybrid.config import load_study

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module", params=["config", "paper"])
def study(request):
    """The default and the paper's study, whole."""
    values, over = (yaml.safe_load((ROOT / f"config/{name}.yaml").read_text()) for name in ("config", request.param))
    for key, value in over.items():
        values[key] = values[key] | value if isinstance(value, dict) and key != "objects" else value
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        values["objects"].setdefault("catalogue", "config/objects/catalogue.yaml")
        yield load_study(values)


@pytest.fixture(scope="module")
def split_ways(study):
    """{way: all load steps of a study, split in this way} as if every press were valid."""
    items = [(item.set, item.id) for item in study.items()]
    check_items(items)
    forces = np.array(study.values.forces_n)
    press = SimpleNamespace(normal_force_n=SimpleNamespace(values=forces),
                            within_validity=SimpleNamespace(values=np.ones(len(forces))))
    presses = {("elastic", *key): press for key in items}
    ways = {}
    for way in ("map", "press", "object"):
        split = assign_splits(list_load_steps(items, presses, ["elastic"]), train_fraction=0.8, seed=study.values.seed,
                              split_by=way)
        ways[way] = split.assign(object=split["item"].map(object_of))
    return ways


def of(load_steps, *splits):
    return load_steps[load_steps.split.isin(splits)]


def shared(load_steps, column):
    """What of a column stands both in training and in validation."""
    return set(of(load_steps, "train")[column]) & set(of(load_steps, "validation")[column])


def test_no_object_press_or_mesh_of_a_test_was_trained_on_or_chosen_by(study, split_ways):
    for way, load_steps in split_ways.items():
        learnt, tests = of(load_steps, "train", "validation"), of(load_steps, "unseen", "grasps")
        assert len(learnt) + len(tests) == len(load_steps) and len(tests) > 0
        for column in ("object", "item"):
            assert not set(learnt[column]) & set(tests[column]), way
    meshes = {name: {Path(item.file).read_bytes() for item in items.values()} for name, items in study.items_of.items()}
    assert not meshes["indenters"] & (meshes["unseen"] | meshes["grasps"]) and not meshes["unseen"] & meshes["grasps"]


def test_training_and_validation_share_no_map_and_no_more_than_the_way_of_splitting_says(split_ways):
    for way, load_steps in split_ways.items():
        pairs = load_steps.assign(pair=load_steps["item"] + " " + load_steps.force_n.astype(str))
        assert not shared(pairs, "pair") and pairs.pair.is_unique, way
        assert bool(shared(load_steps, "item")) == (way == "map")
        assert bool(shared(load_steps, "object")) == (way != "object")
        assert abs(len(of(load_steps, "train")) / len(of(load_steps, "train", "validation")) - 0.8) < 0.05, way


def test_no_object_is_pressed_twice_in_one_place(study):
    places = [(item.object, None if item.pose is None else tuple(item.pose)) for item in study.items()]
    assert len(set(places)) == len(places)


def test_an_object_in_two_sets_is_refused_in_whatever_poses():
    with pytest.raises(InputError, match="square-2: it is in the sets indenters and grasps"):
        check_items([("indenters", "square"), ("indenters", "square-1"), ("grasps", "square-2")])
