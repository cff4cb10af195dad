"""The models' meshes of a sensor as meshio meshes."""

from collections.abc import Mapping
from typing import Any

import meshio
import numpy as np

from softtact.fem.elements import HEX27
from softtact.materials.laws.neo_hooke import NeoHooke
from softtact.models.elastic.compliance import elastic_slab, map_cells
from softtact.models.foundation.compliance import foundation_slab
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.deformed_mesh import pressed_body
from softtact.models.hyperelastic.mesh_settings import frustum_scatter, mesh_settings, specimen_of
from softtact.sensors.frusta import SensorSpec


def layered_mesh(spec: SensorSpec, values: Mapping[str, Any]) -> meshio.Mesh:
    """Sheet, cover and frusta as one meshio mesh; cell data `layer`: 0 frusta, 1 sheet, 2 cover."""
    settings = mesh_settings(values)
    spec = specimen_of(spec, values)
    body = build_sensor_body(spec, dielectric_law=None, cover_law=None, mesh=settings,   # a mesh has no material
                             scatter=frustum_scatter(spec, values))
    return pressed_body(body).to_meshio()


def slab_mesh(spec: SensorSpec, kind: str) -> meshio.Mesh:
    """Layer of the elastic model, or sheet and cover of the foundation model, as meshio meshes; `layer` counts from below."""
    double = spec.model_copy(update={"footprint_mm": tuple(2 * side for side in spec.footprint_mm)})     # its quarter is the whole
    cells = tuple(2 * count for count in map_cells(spec))
    slab = elastic_slab(double, cells=cells) if kind == "elastic" else foundation_slab(double, _NO_LAW, _NO_LAW, cells=cells)
    points = slab.points - [*(0.5 * side for side in spec.footprint_mm), 0.0]
    layer = np.repeat(np.arange(len(slab.hexes)), slab.hexes.shape[1])
    hexes = slab.hexes.reshape(-1, 27)[:, HEX27.vtk_order]
    return meshio.Mesh(points, [(HEX27.meshio_name, hexes)], cell_data={"layer": [layer]})


_NO_LAW = NeoHooke({"c10": 1.0}, bulk_modulus=1.0)     # a mesh has no material
MESHES = {"elastic": lambda spec, mesh: slab_mesh(spec, "elastic"), "foundation": lambda spec, mesh: slab_mesh(spec, "foundation"),
          "hyperelastic": layered_mesh}
