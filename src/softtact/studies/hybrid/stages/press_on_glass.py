"""The dielectric pressed on glass: contact area of the model for each orientation and law, and of a virtual specimen with scatter.

inputs: card;  outputs: state, virtual
settings: sensor, forces_n, orientations, laws, constants (printed, fitted), orientation, law, virtual_law, height_scatter,
    tip_scatter, mesh, seed
"""

from typing import Any

import numpy as np
import xarray

from softtact.errors import InputError
from softtact.files import write_dataset
from softtact.materials.cards import law_from_card, load_card
from softtact.materials.laws.registry import make_law
from softtact.models.ftir.specimen import cell_family, glass_mesh, press_cell_on_glass, press_specimen, scattered_specimen
from softtact.progress import progress
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Solve one cell per orientation and law, then a specimen whose frusta have different heights and tip diameters."""
    spec, card = SensorSpec.from_dict(settings["sensor"]), load_card(inputs["card"])
    changes = {key: value for key, value in settings["mesh"].items() if value is not None}
    forces = np.asarray(settings["forces_n"], dtype=float)
    _write(outputs["state"], _models(spec, card, forces, settings, changes), settings)
    _write(outputs["virtual"], _virtual(spec.with_frustum_orientation(settings["orientation"]), card, forces, settings, changes),
           settings)


def _models(spec, card, forces, settings, changes):
    """Data set (orientation, law, force) of a cell that carries its share of the force."""
    shape = len(settings["orientations"]), len(settings["laws"]), len(forces)
    area, compression, each = np.zeros(shape), np.zeros(shape), forces / np.prod(spec.frusta_counts)
    for i, j in progress(list(np.ndindex(shape[:2])), label="frusta on glass"):
        read = spec.with_frustum_orientation(settings["orientations"][i])
        law = _law(card, settings["laws"][j], settings["constants"])
        curve = press_cell_on_glass(read, law, each, mesh=glass_mesh(read, **changes))
        area[i, j], compression[i, j] = curve.area_mm2, curve.compression_mm
    gap = spec.dielectric.frusta.pitch_mm - 2 * np.sqrt(area / np.pi)
    axes = ("orientation", "law", "force")
    data = {"area_per_frustum_mm2": area, "compression_mm": compression, "disc_gap_mm": gap}
    return xarray.Dataset({"force_n": ("force", forces, {"units": "N"}),
                           **{name: (axes, values, {"units": name.rsplit("_", 1)[1]}) for name, values in data.items()}},
                          coords={"orientation": settings["orientations"], "law": settings["laws"]},
                          attrs={"orientation_under_test": settings["orientation"], "law_under_test": settings["law"],
                                 "frusta": int(np.prod(spec.frusta_counts)), "pitch_mm": spec.dielectric.frusta.pitch_mm})


def _law(card, name, constants):
    """The law of a card with its fitted constants, or with the published ones at the same K / mu0."""
    fitted = law_from_card(card, name)
    if constants == "fitted":
        return fitted
    if name not in card.get("printed", {}):
        raise InputError(f"The card of material {card['material']} has no printed constants of law {name!r}; "
                         "set 'ftir.constants' to fitted.")
    return make_law(name, card["printed"][name]["parameters"], bulk_over_shear=fitted.bulk_modulus / fitted.mu0)


def _virtual(spec, card, forces, settings, changes):
    """Data set (force, frustum) of the specimen."""
    specimen = scattered_specimen(spec, height_scatter=settings["height_scatter"], tip_scatter=settings["tip_scatter"],
                                  seed=settings["seed"])
    law = _law(card, settings["virtual_law"], settings["constants"])
    family = cell_family(spec, law, specimen, largest_n=forces[-1], mesh=glass_mesh(spec, **changes))
    pressed = press_specimen(family, specimen, forces)
    both = ("force", "frustum")
    return xarray.Dataset({
        "force_n": ("force", forces, {"units": "N"}),
        "area_per_frustum_mm2": ("force", pressed.area_mm2.mean(axis=1), {"units": "mm2", "long_name": "mean of the frusta"}),
        "compression_mm": ("force", pressed.descent_mm, {"units": "mm", "long_name": "the plate's way from its first touch"}),
        "disc_area_mm2": (both, pressed.area_mm2, {"units": "mm2"}), "frustum_force_n": (both, pressed.force_n, {"units": "N"}),
        "x_mm": ("frustum", specimen.centres[:, 0]), "y_mm": ("frustum", specimen.centres[:, 1]),
        "height_factor": ("frustum", specimen.height_factor), "tip_factor": ("frustum", specimen.tip_factor)},
        attrs={"orientation": settings["orientation"], "law": settings["virtual_law"]})


def _write(path, data, settings):
    write_dataset(path, data, seed=settings["seed"], settings=settings)
