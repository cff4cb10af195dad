"""The layered body's meshes by name, with what counts as solved on them, from plain values."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from softtact.errors import InputError
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.specimen import SCATTER_KEYS
from softtact.unknown_names import unknown

_SOLVER_KEYS = ("largest_penetration_mm",)
# Meshes by name, and what counts as solved on them.
PRESETS = {"default": (MeshSettings, NewtonSettings), "draft": (MeshSettings.draft, NewtonSettings.draft),
           "stable": (MeshSettings.stable, NewtonSettings), "fine": (MeshSettings.fine, NewtonSettings)}


def mesh_settings(values: Mapping[str, Any]) -> MeshSettings:
    """`MeshSettings` from a mapping: those of its `preset`, changed by what else it says.

    The scatter's and the solver's keys are passed over, an unknown key is refused.
    """
    own = {key: value for key, value in values.items() if key not in ("preset", *SCATTER_KEYS, *_SOLVER_KEYS)}
    unknown = sorted(set(own) - set(MeshSettings.__dataclass_fields__))
    if unknown:
        raise InputError(f"mesh: key {unknown[0]!r} is unknown; use one of {', '.join(MeshSettings.__dataclass_fields__)}.")
    try:
        changes = {key: tuple(value) if isinstance(value, list) else value for key, value in own.items()}
        return replace(_preset(values)[0](), **changes)
    except ValueError as problem:
        raise InputError(f"mesh: {problem}.") from None


def newton_settings(values: Mapping[str, Any]) -> NewtonSettings:
    """`NewtonSettings` from the same mapping."""
    return replace(_preset(values)[1](), **{key: values[key] for key in _SOLVER_KEYS if key in values})


def _preset(values):
    name = values.get("preset", "default")
    if name not in PRESETS:
        raise InputError(f"mesh: {unknown(name, PRESETS, kind='preset')}")
    return PRESETS[name]
