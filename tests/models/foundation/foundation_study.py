"""What the tests of the foundation model share: a small sensor, objects, and comparisons."""


import numpy as np
import trimesh
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.contact.underside import Underside
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})      # 6 x 6 frusta
PUNCH = trimesh.creation.cylinder(radius=1.8, height=3.0, sections=96)
BOX = trimesh.creation.box((3.1, 2.2, 2.0))
TILTED = (0.3, -0.4, 0, 4.0, -3.0, 20.0)


def points_of(mesh, compliance, values=(0, 0, 0, 0, 0, 0)):
    mesh = place(mesh, pose=Pose.from_values(values))
    mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return Underside(HeightField(mesh), compliance.grid).points(1.0)


def force_of(law, compression):
    """Forces of frusta of given compressions, by bisection on the law."""
    low, high = np.zeros_like(compression), np.full_like(compression, 2 * law.force_n[-1])
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = law.extension(middle) > compression
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.where(compression > 0, low, 0.0)


def assert_close(got, expected, relative):
    np.testing.assert_allclose(got, expected, rtol=0, atol=relative * np.abs(expected).max())
