"""Data sets of all models under test, with one split for all.

inputs: presses (every model and item), tactile (every item); or folders of both with item_list (JSON), as `import_published` writes
outputs: train, validation, unseen, grasps (each a list, one file per model, in the order of `models`), manifest
settings: models, items [{set, item}] unless given as item_list, train_fraction, seed, training_trials (each | mean)
"""

from typing import Any

from softtact.files import files_below, read_json, write_csv, write_dataset
from softtact.learning.dataset import SPLITS, build_datasets, read_presses, read_tactile


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Join presses and readings, split them, write each model's splits and the manifest."""
    if "item_list" in inputs:
        settings = settings | {"items": read_json(inputs["item_list"])}
    presses, tactile = (read(files_below(inputs[name], suffix=".nc"))
                        for name, read in (("presses", read_presses), ("tactile", read_tactile)))
    datasets, manifest = build_datasets(presses, tactile, **settings)     # type: ignore[arg-type]
    for split in SPLITS:
        for model, path in zip(settings["models"], outputs[split], strict=True):
            write_dataset(path, datasets[model, split], seed=settings["seed"], settings=settings)
    write_csv(outputs["manifest"], manifest)
