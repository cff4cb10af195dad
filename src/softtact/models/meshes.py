"""The layered body's mesh as a file, and its settings from plain values."""

from dataclasses import replace

import meshio
import numpy as np

from softtact.errors import InputError
from softtact.materials.laws.neo_hooke import NeoHooke
from softtact.models.elastic.compliance import elastic_slab, map_cells
from softtact.models.foundation.compliance import foundation_slab
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.deformed_mesh import VTK_HEX27, pressed_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.unknown_names import unknown

_SCATTER_KEYS = ("height_scatter", "tip_scatter", "thickness_scatter", "specimen")
_LARGEST_DEVIATION = 2.5     # standard deviations: a specimen beyond would not have passed inspection
_SOLVER_KEYS = ("largest_penetration_mm",)
# Meshes by name, and what counts as solved on them.
PRESETS = {"default": (MeshSettings, NewtonSettings), "draft": (MeshSettings.draft, NewtonSettings.draft),
           "stable": (MeshSettings.stable, NewtonSettings), "fine": (MeshSettings.fine, NewtonSettings)}


def mesh_settings(values):
    """`MeshSettings` from a mapping: those of its `preset`, changed by what else it says.

    The scatter's and the solver's keys are passed over, an unknown key is refused.
    """
    own = {key: value for key, value in values.items() if key not in ("preset", *_SCATTER_KEYS, *_SOLVER_KEYS)}
    unknown = sorted(set(own) - set(MeshSettings.__dataclass_fields__))
    if unknown:
        raise InputError(f"mesh: key {unknown[0]!r} is unknown; use one of {', '.join(MeshSettings.__dataclass_fields__)}.")
    try:
        changes = {key: tuple(value) if isinstance(value, list) else value for key, value in own.items()}
        return replace(_preset(values)[0](), **changes)
    except ValueError as problem:
        raise InputError(f"mesh: {problem}.") from None


def newton_settings(values):
    """`NewtonSettings` from the same mapping."""
    return replace(_preset(values)[1](), **{key: values[key] for key in _SOLVER_KEYS if key in values})


def _preset(values):
    name = values.get("preset", "default")
    if name not in PRESETS:
        raise InputError(f"mesh: {unknown(name, PRESETS, kind='preset')}")
    return PRESETS[name]


def frustum_scatter(spec, values):
    """Factors (heights, tip diameters) of a specimen's frusta, each near 1; None where no scatter is asked for."""
    if not any(key in values for key in _SCATTER_KEYS):
        return None
    count = int(np.prod(spec.frusta_counts))
    rng = np.random.default_rng(int(values.get("specimen", 0)))
    heights, tips = rng.standard_normal((2, count)).clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    return 1 + values.get("height_scatter", 0.0) * heights, 1 + values.get("tip_scatter", 0.0) * tips


def specimen_of(spec, values):
    """The sensor with the thickness of sheet and cover of one specimen; the frusta's scatter is `frustum_scatter`'s."""
    scatter = values.get("thickness_scatter", 0.0)
    if not scatter:
        return spec
    sheet, cover = 1 + scatter * np.random.default_rng([int(values.get("specimen", 0)), 1]).standard_normal(2).clip(
        -_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    dielectric = spec.dielectric.model_copy(update={"sheet_thickness_mm": spec.dielectric.sheet_thickness_mm * sheet})
    return spec.model_copy(update={
        "dielectric": dielectric, "cover": spec.cover.model_copy(update={"thickness_mm": spec.cover.thickness_mm * cover})})


def layered_mesh(spec, values):
    """Sheet, cover and frusta as one meshio mesh; cell data `layer`: 0 frusta, 1 sheet, 2 cover."""
    settings = mesh_settings(values)
    spec = specimen_of(spec, values)
    body = build_sensor_body(spec, dielectric_law=None, cover_law=None, mesh=settings,   # a mesh has no material
                             scatter=frustum_scatter(spec, values))
    return pressed_body(body).to_meshio()


def slab_mesh(spec, kind):
    """Layer of the elastic model, or sheet and cover of the foundation model, as meshio meshes; `layer` counts from below."""
    double = spec.model_copy(update={"footprint_mm": tuple(2 * side for side in spec.footprint_mm)})     # its quarter is the whole
    cells = tuple(2 * count for count in map_cells(spec))
    slab = elastic_slab(double, cells=cells) if kind == "elastic" else foundation_slab(double, _NO_LAW, _NO_LAW, cells=cells)
    points = slab.points - [*(0.5 * side for side in spec.footprint_mm), 0.0]
    layer = np.repeat(np.arange(len(slab.hexes)), slab.hexes.shape[1])
    return meshio.Mesh(points, [("hexahedron27", slab.hexes.reshape(-1, 27)[:, VTK_HEX27])], cell_data={"layer": [layer]})


_NO_LAW = NeoHooke({"c10": 1.0}, bulk_modulus=1.0)     # a mesh has no material
MESHES = {"elastic": lambda spec, mesh: slab_mesh(spec, "elastic"), "foundation": lambda spec, mesh: slab_mesh(spec, "foundation"),
          "hyperelastic": layered_mesh}
