"""Mesh of a model's sensor, for ParaView and for what follows.

outputs: mesh;  settings: sensor, model, mesh (edge_length_mm makes it the elastic layer's tetrahedra)
"""

import meshio

from softtact.files import atomic_path
from softtact.geometry.sensor_spec import SensorSpec
from softtact.mechanics.elastic import layer_mesh
from softtact.mechanics.layered_mesh import layered_mesh


def run(*, inputs, outputs, settings, threads=1):
    """Write the mesh as VTU."""
    spec, mesh = SensorSpec.from_dict(settings["sensor"]), settings["mesh"]
    if "edge_length_mm" in mesh:
        points, tets = layer_mesh(spec.footprint_mm, spec.thickness_mm, edge_length_mm=mesh["edge_length_mm"])
        out = meshio.Mesh(points, [("tetra", tets)])
    else:
        out = layered_mesh(spec, mesh)
    with atomic_path(outputs["mesh"]) as temporary:
        out.write(temporary, file_format="vtu")
