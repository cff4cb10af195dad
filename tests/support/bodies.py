"""A small sensor and its layered body, for tests of the hyperelastic model."""

from support.laws import LAWS
from support.sensors import CORO

from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings

# One layer of the cover, unsplit, and two of the frusta: the coarsest mesh that has all parts.
COARSE = MeshSettings(cover_heights=(0.0, 1.0), cover_splits=(0,), far_pitches=1, frustum_heights=(0.0, 0.35, 1.0))
SMALL = CORO.model_copy(update={"footprint_mm": (6.0, 8.4), "map_shape": (15, 11)})   # 5 x 7 frusta


def small_body():
    """The small sensor's body on the coarse mesh, at rest."""
    return build_sensor_body(SMALL, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=COARSE)
