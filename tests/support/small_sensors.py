"""Sensors of few points, which are prepared in a moment: the default one with a coarser map, and a gel."""

from pathlib import Path

from softtact.fem.files.solids import write_mesh
from softtact.fem.structured_meshes import box
from softtact.sensors.library import sensor_file

GEL = """
kind: layers
name: small_gel
footprint_mm: [12.0, 16.0]
map_shape: [33, 25]
force_range_n: [0.0, 20.0]
support: base
layers: [{material: gel_silicone, thickness_mm: 2.0}]
elastic_layer: {young_mpa: 0.435, poisson: 0.49}
edge: {held: far}
friction: {object: 0.5}
"""


BLOCK = """
kind: solid
name: block
mesh: {file: block.vtu}
regions: {rubber: {law: neo_hooke, parameters: {c10: 0.1}, bulk_over_shear: 20}}
held: {z0: xyz}
contact: {face: z1, friction: 0.3}
readouts: {tips: {kind: points, points_mm: [[26, 28, 6], [30, 28, 6]], radius_mm: 2.5}}
force_range_n: [0, 20]
"""


SKIN = """
kind: skin
skin: small_skin
mesh: {spacing_mm: 3.0, layers: 2, field_spacing_mm: 3.0, field_layers: 2}
loads: []
"""


def small_skin(folder: Path) -> Path:
    """The file of a module of the papers' skins on coarse meshes."""
    path = folder / "skin.yaml"
    path.write_text(SKIN)
    return path


def small_block(folder: Path) -> Path:
    """The file of a solid of few elements, 12 x 16 x 6 mm with its middle at (26, 28) mm."""
    write_mesh(box((20, 20, 0), (32, 36, 6), (3, 4, 2), region="rubber"), folder / "block.vtu")
    path = folder / "block.yaml"
    path.write_text(BLOCK)
    return path


def small_coro(folder: Path) -> Path:
    """The file of the default sensor with a quarter of the map's points."""
    path = folder / "small.yaml"
    path.write_text(sensor_file("coro").read_text().replace("map_shape: [57, 33]", "map_shape: [29, 17]"))
    return path


def small_gel(folder: Path) -> Path:
    """The file of a gel whose sides are far."""
    path = folder / "gel.yaml"
    path.write_text(GEL)
    return path
