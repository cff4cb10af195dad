"""What the meshes are worth: the same load on finer and finer meshes, with one taxel, its neighbours being part of the guard."""

import numpy as np
import pandas as pd

from softtact.skin.elasticity import ElasticLayer
from softtact.skin.electrostatics import Field
from softtact.skin.layer_mesh import LayerMesh
from softtact.skin.layout import Layout
from softtact.skin.loads import Load
from softtact.skin.plan import even_plan, taxel_plan

_DEFORMATION = {"coarse": (1.5, 2), "standard": (1.0, 4), "fine": (0.75, 5)}  # spacing in mm, layers
_FIELD = {
    "coarse": (1, (0.5, 1.0)),
    "standard": (1, (1 / 3, 2 / 3, 1.0)),
    "fine": (2, (0.03, 0.1, 0.25, 0.6, 1.0)),
    "finest": (3, (0.01, 0.03, 0.08, 0.2, 0.4, 0.7, 1.0)),
}  # points around the gap, levels as shares


def mesh_convergence(
    layout: Layout, load: Load, *, taxel: int, thickness_mm: float, poisson: float, permittivity: float, young_mpa: float
) -> pd.DataFrame:
    """A row a mesh: largest displacement in mm, capacitance of a taxel (counted from 0) in fF at rest and under the load.

    The field's meshes are compared on the deformation of the standard mesh.
    """
    rows, solved = [], {}
    for name, (spacing, layers) in _DEFORMATION.items():
        layer = ElasticLayer(
            LayerMesh(even_plan(layout, spacing_mm=spacing), np.linspace(0.0, thickness_mm, layers + 1)), poisson=poisson
        )
        moved = layer.displacement(load, young_mpa=young_mpa)
        solved[name] = layer, moved
        rows.append({"mesh": name, "of": "deformation", "nodes": len(moved), "largest_displacement_mm": -moved[:, 2].min()})
    one = Layout(
        layout.outline_mm,
        layout.centres_mm[taxel][None],
        np.zeros(1, dtype=int),
        layout.corners_mm,
        layout.radius_mm,
        layout.guard_radius_mm,
    )
    layer, moved = solved["standard"]
    for name, (refinement, levels) in _FIELD.items():
        mesh = LayerMesh(taxel_plan(one, spacing_mm=1.2, refinement=refinement), thickness_mm * np.array([0.0, *levels]))
        at_rest, pressed = (
            Field(mesh, one, permittivity=permittivity, displacement_mm=u, order=4).capacitance_ff[0]
            for u in (None, layer.at(mesh.nodes_mm, moved))
        )
        rows.append(
            {
                "mesh": name,
                "of": "field",
                "nodes": len(mesh.nodes_mm),
                "at_rest_ff": at_rest,
                "capacitance_ff": pressed,
                "delta_ff": pressed - at_rest,
            }
        )
    return pd.DataFrame(rows)
