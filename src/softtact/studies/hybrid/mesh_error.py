"""Error of the tested models' meshes, beside their scores.

A score of a network is one of its training maps, too: a mesh that is off by some per cent of a map is part of it.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import pandas as pd

COLUMN = "mesh_error"


class MeshError(NamedTuple):
    """How far a mesh puts its maps off, as shares of each map's largest value, in words."""

    rms: str
    """Root mean square."""
    largest: str
    """At single points."""


# By preset: benchmarks/results/mesh_error.json, under three objects (docs/explanation/discretisation.md).
MESH_ERRORS = {"draft": MeshError("2 to 5 %", "10 %"), "default": MeshError("up to 2 %", "5 %"),
               "fine": MeshError("up to 1 %", "2 %")}


def tested_meshes(config: Mapping[str, Any]) -> dict[str, str]:
    """{tested hyperelastic model: preset of its mesh} of a study's configuration, where the preset's error was measured."""
    presets = {name: model.get("mesh", {}).get("preset") or "default" for name, model in config.get("models", {}).items()
               if name in config.get("tested", ()) and model.get("kind", "hyperelastic") == "hyperelastic"}
    return {name: preset for name, preset in presets.items() if preset in MESH_ERRORS}


def mesh_sentences(config: Mapping[str, Any]) -> list[str]:
    """A sentence for each tested model whose mesh has a measured error."""
    return [f"Mesh: the {preset} one of the {name} model puts its map off by {MESH_ERRORS[preset].rms} of its largest value in the "
            f"root mean square and up to {MESH_ERRORS[preset].largest} at single points."
            for name, preset in tested_meshes(config).items()]


def with_mesh_error(table: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """A table that has scores by model, with the error of each model's mesh in a last column; any other as it is."""
    meshes = tested_meshes(config)
    scored = any(str(name).startswith(("ssim", "mae")) for name in table)
    if not (meshes and scored and "model" in table):
        return table
    words = {name: f"{preset}: {MESH_ERRORS[preset].rms}" for name, preset in meshes.items()}
    return table.assign(**{COLUMN: table.model.map(words).fillna("no such mesh")})
