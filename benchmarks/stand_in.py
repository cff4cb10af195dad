"""A data set from the pipeline in minutes, where the hyperelastic presses of a study take hours: a stand-in, and named so.

Deformation maps are the elastic model's. The readings are the virtual sensor's on the *foundation* model's maps, in place of the
hyperelastic reference's: another law and another contact than the network's input, but not the study's reference.
"""

import itertools

import numpy as np
import xarray

import softtact
from softtact.files import read_yaml, write_dataset
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose
from softtact.learning.dataset import SPLITS, build_datasets, read_samples
from softtact.readout.virtual_sensor import read_virtual_sensor

SOURCE = "virtual sensor on foundation presses"
FORCES = np.linspace(5, 50, 10)
POSES = {"indenters": ["0,0", "-4,0", "4,0", "0,-8", "0,8"], "unseen": ["0,0", "-4,0", "0,8"], "grasps": ["0,0"]}   # x,y in mm
OBJECTS = {"indenters": 24, "unseen": 6, "grasps": 6}     # the first so many of the catalogue
SEED, TRIALS = 20250, 3


def stand_in(folder, *, items=None):
    """{split: Samples}, made in `folder` if they are not there yet; `items`: of each set's presses only so many, for a trial."""
    paths = {split: folder / f"{split}.nc" for split in SPLITS}
    if not all(path.exists() for path in paths.values()):
        make(paths, items)
    return {split: read_samples(path) for split, path in paths.items()}


def make(paths, items):
    """Press, read and split; the mean over the trials trains, single trials test."""
    sensor, presses, tactile = softtact.load_sensor("coro"), {}, {}
    for set_name, item, mesh, pose in list_presses(items):
        maps = {model: sensor.press(mesh, pose=pose, force_n=FORCES, model=model, threads=1, label="")
                for model in ("elastic", "foundation")}
        valid = maps["elastic"].within_validity & maps["foundation"].within_validity
        presses["elastic", set_name, item] = maps["elastic"].to_dataset().assign(within_validity=("step", valid))
        counts = read_virtual_sensor(sensor.spec, maps["foundation"].deformation_map_mm, force_n=FORCES, trials=TRIALS, seed=SEED,
                                     item=f"{set_name}/{item}")
        tactile[set_name, item] = xarray.Dataset({"tactile_map": (("trial", "force", "row", "column"), counts),
                                                  "force_n": ("force", FORCES)}, attrs={"source": SOURCE})
    items = [{"set": set_name, "item": item} for set_name, item in tactile]
    datasets, _ = build_datasets(presses, tactile, models=["elastic"], items=items, train_fraction=0.8, seed=SEED,
                                 training_trials="mean")
    for split, path in paths.items():
        write_dataset(path, datasets["elastic", split], seed=SEED, settings={"poses": POSES, "trials": TRIALS})


def list_presses(items):
    """(set, item, mesh, pose) of the catalogue's objects in all poses of their set."""
    catalogue = read_yaml("config/objects/catalogue.yaml", missing="there is no such catalogue.")
    for set_name, poses in POSES.items():
        entries = [entry for entry in catalogue if entry["set"] == set_name][:OBJECTS[set_name]]
        for entry, (k, place) in itertools.islice(itertools.product(entries, enumerate(poses)), items):
            mesh = read_mesh(f"config/objects/{entry['file']}", unit=entry["unit"])
            pose = Pose.parse(f"{place},0,0,0,0") if k else None         # None: centred over the sensor
            yield set_name, f"{entry['name']}-{k}", mesh, pose
