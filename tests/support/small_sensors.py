"""Sensors of few points, which are prepared in a moment: the default one with a coarser map, and a gel."""

from pathlib import Path

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
