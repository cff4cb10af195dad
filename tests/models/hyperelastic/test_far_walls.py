"""Walls between cells of the sheet are coarse far from the object only."""

import numpy as np
import trimesh
from support.bodies import SMALL
from support.laws import LAWS

from softtact.contact.height_field import HeightField
from softtact.geometry.meshes import place
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings

LONG = SMALL.model_copy(update={"footprint_mm": (6.0, 24.0)})
PUNCH = trimesh.creation.cylinder(radius=1.0, height=2, sections=32)


def free_nodes(**changes):
    """Places (n, 2) of the sheet's own nodes."""
    surface = HeightField(place(PUNCH, pose=None))
    body = build_sensor_body(LONG, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"],
                             mesh=MeshSettings(far_pitches=1, **changes), surface=surface)
    return body.slab.points[body.slab.cover_mesh.free:, :2]


def test_cell_edges_are_fine_around_the_object_and_constrained_far_from_it():
    mixed, coarse = free_nodes(), free_nodes(constrained_cell_edges=True)
    more = {tuple(p) for p in np.round(mixed, 6)} - {tuple(p) for p in np.round(coarse, 6)}
    assert more
    assert max(abs(y) for _, y in more) < 6.0       # the punch's edge, 2.4 mm around it, and an element
    assert min(abs(y) for _, y in more) < 1.0       # under the punch, too
