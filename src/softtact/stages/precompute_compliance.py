"""Surface flexibility of the elastic layer, once per sensor.

inputs: mesh;  outputs: compliance;  settings: sensor
"""

import meshio

from softtact.files import atomic_path
from softtact.geometry.sensor_spec import SensorSpec
from softtact.mechanics.elastic import surface_compliance


def run(*, inputs, outputs, settings, threads=1):
    """Factor the layer and solve for a unit load at each surface node."""
    spec = SensorSpec.from_dict(settings["sensor"])
    mesh = meshio.read(inputs["mesh"])
    layer = spec.elastic_layer
    compliance = surface_compliance(mesh.points, mesh.cells_dict["tetra"].astype("int64"), young_mpa=layer.young_mpa,
                                    poisson=layer.poisson, map_x_mm=spec.map_x_mm, map_y_mm=spec.map_y_mm)
    with atomic_path(outputs["compliance"]) as temporary:
        compliance.save(temporary)
