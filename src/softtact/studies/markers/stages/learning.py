"""The training of one network from one seed."""

from pathlib import Path
from typing import Any

import pandas as pd

from softtact.files import write_csv


def train_network(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train a generator on the longest sequences of the training split; an interrupted training goes on where it was.

    inputs: sequences (list);  outputs: generator (pt), history (CSV)
    settings: network, seed, size, training (values of `ImageTraining`), device
    """
    from softtact.devices import find_device
    from softtact.learning.image_data import open_sequences
    from softtact.learning.image_networks import count_weights, make_networks, save_generator
    from softtact.learning.image_training import ImageTraining, check_memory, start_image_run, train_images
    from softtact.learning.training import prepare_torch

    name, seed = settings["network"], settings["seed"]
    device = prepare_torch(threads=threads, device=find_device(settings["device"]))
    options = ImageTraining.from_dict(settings["training"] | {"shuffle_frames": name == "pix2pix"}, where="networks.training")
    data = open_sequences(inputs["sequences"], split="train", longest_only=name != "pix2pix")
    generator, discriminator = make_networks(name, size=settings["size"])
    check_memory(generator, discriminator, frames=int(max(data.length)), device=device)
    run = start_image_run(generator, discriminator, options, seed=seed, device=device)
    checkpoint = Path(outputs["generator"]).with_suffix(".checkpoint.pt")
    for _ in train_images(run, data, options=options, seed=seed, checkpoint=checkpoint, label=f"{name}, seed {seed}"):
        pass
    save_generator(
        outputs["generator"],
        generator,
        facts={"name": name, "seed": seed, "steps": run.steps, "sequences": len(data), "weights": count_weights(generator)},
    )
    write_csv(outputs["history"], pd.DataFrame(run.history).assign(network=name, seed=seed))
    checkpoint.unlink(missing_ok=True)
