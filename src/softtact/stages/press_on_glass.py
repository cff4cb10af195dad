"""The dielectric pressed on glass: the model's contact area, and a virtual specimen's with scatter.

inputs: card;  outputs: state, virtual;  settings: sensor, law, virtual_law, forces_n, seed
"""

import numpy as np
import xarray

from softtact.files import write_dataset
from softtact.geometry.sensor_spec import SensorSpec
from softtact.materials.cards import law_from_card, load_card
from softtact.mechanics.glass_press import press_cell_on_glass
from softtact.mechanics.layered_body import lattice

HEIGHT_SCATTER, TIP_SCATTER, READING_SCATTER = 0.01, 0.02, 0.01   # of a moulded specimen; assumed


def run(*, inputs, outputs, settings, threads=1):
    """Solve one cell per law; the specimen's frusta differ in height and tip diameter."""
    spec, card = SensorSpec.from_dict(settings["sensor"]), load_card(inputs["card"])
    forces = np.asarray(settings["forces_n"], dtype=float)
    centres, _ = lattice(spec.frusta_counts, spec.dielectric.frusta.pitch_mm)
    per_frustum = forces / len(centres)
    model = press_cell_on_glass(spec, law_from_card(card, settings["law"]), per_frustum)
    _write(outputs["state"], settings, forces, model, {})
    law = law_from_card(card, settings["virtual_law"])
    specimen = press_cell_on_glass(spec, law, per_frustum)
    areas = _scattered(specimen.area_mm2, len(centres), settings["seed"])
    _write(outputs["virtual"], settings, forces, specimen, {
        "disc_area_mm2": (("force", "frustum"), areas),
        "x_mm": ("frustum", centres[:, 0]), "y_mm": ("frustum", centres[:, 1])}, area=areas.mean(axis=1))


def _scattered(area, count, seed):
    """Disc areas (force, frustum): tip diameter and load share differ from frustum to frustum."""
    rng = np.random.default_rng([seed, 2])
    factor = (1 + TIP_SCATTER * rng.standard_normal(count)) ** 2 * (1 + HEIGHT_SCATTER * rng.standard_normal(count))
    return area[:, None] * factor * (1 + READING_SCATTER * rng.standard_normal((len(area), count)))


def _write(path, settings, forces, curve, extra, *, area=None):
    data = xarray.Dataset({
        "force_n": ("force", forces, {"units": "N"}),
        "area_per_frustum_mm2": ("force", curve.area_mm2 if area is None else area, {"units": "mm2"}),
        "compression_mm": ("force", curve.compression_mm, {"units": "mm"}), **extra})
    write_dataset(path, data, seed=settings["seed"], settings=settings)
