"""The layered body's mesh as a file, and its settings from plain values."""

import meshio
import numpy as np

from softtact.errors import InputError
from softtact.mechanics.layered_body import MeshSettings, build_sensor_body

_SCATTER_KEYS = ("height_scatter", "tip_scatter", "specimen")


def mesh_settings(values):
    """`MeshSettings` from a mapping; the scatter's keys are passed over, an unknown key is refused."""
    own = {key: value for key, value in values.items() if key not in _SCATTER_KEYS}
    unknown = sorted(set(own) - set(MeshSettings.__dataclass_fields__))
    if unknown:
        raise InputError(f"mesh: key {unknown[0]!r} is unknown; use one of {', '.join(MeshSettings.__dataclass_fields__)}.")
    if "frustum_levels" in own:
        own["frustum_levels"] = tuple(own["frustum_levels"])
    return MeshSettings(**own)


def frustum_scatter(spec, values):
    """Factors (heights, tip diameters) of a specimen's frusta, each near 1; None where no scatter is asked for."""
    if not any(key in values for key in _SCATTER_KEYS):
        return None
    count = int(np.prod(spec.frusta_counts))
    rng = np.random.default_rng(int(values.get("specimen", 0)))
    heights, tips = rng.standard_normal((2, count)).clip(-2.5, 2.5)
    return 1 + values.get("height_scatter", 0.0) * heights, 1 + values.get("tip_scatter", 0.0) * tips


def layered_mesh(spec, values):
    """Slab and frusta as one meshio mesh of 20-node hexahedra; cell data `layer`: 0 frusta, 1 sheet, 2 cover."""
    settings = mesh_settings(values)
    body = build_sensor_body(spec, dielectric_law=None, cover_law=None, mesh=settings,   # a mesh has no material
                             scatter=frustum_scatter(spec, values))
    frusta = body.bed.coordinates
    offsets = len(body.slab.mesh.points) + np.arange(body.bed.count) * body.bed.nodes
    frustum_hexes = (body.bed.mesh.hexes[None] + offsets[:, None, None]).reshape(-1, 20)
    slab_layers = np.repeat(np.arange(body.slab.mesh.layers), len(body.slab.mesh.hexes) // body.slab.mesh.layers)
    layer = np.concatenate([np.where(slab_layers < settings.sheet_layers, 1, 2), np.zeros(len(frustum_hexes), dtype=int)])
    return meshio.Mesh(np.vstack([body.slab.mesh.points, frusta.reshape(-1, 3)]),
                       [("hexahedron20", np.vstack([body.slab.mesh.hexes, frustum_hexes]))], cell_data={"layer": [layer]})
