"""Gels with a camera for tests: their specifications, and made-up motions of their surface."""

from dataclasses import replace

import numpy as np
import yaml

import softtact.press.kinds  # noqa: F401  (registers the readouts)
from softtact.press.making import layered_surface
from softtact.readout.registry import PlaneMotion, make_readout
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import any_spec

SMALL_GEL = """
kind: layers
name: small_gel
footprint_mm: [16, 20]
map_shape: [41, 33]
force_range_n: [0, 50]
support: base
layers: [{material: gel_silicone, thickness_mm: 3.0}]
elastic_layer: {young_mpa: 0.4, poisson: 0.48}
edge: far
friction: {object: 0.5}
readouts:
  camera: {kind: camera, pixels: [64, 48], mm_per_px: 0.3, distance_mm: 30, shading: gelsight_mini,
           markers: {rows: 3, columns: 5, pitch_mm: 2.5, radius_mm: 0.5}}
  markers: {kind: markers}
"""


def gel_values(name="gelsight_wonkdim", **changes):
    """Keys and values of a shipped gel's file, those of its camera changed."""
    values = yaml.safe_load(sensor_file(name).read_text())
    values["readouts"]["camera"] |= changes
    return values


def gel_spec(name="gelsight_wonkdim", **changes):
    return any_spec(gel_values(name, **changes))


def surface_of(spec, *moved, gap=None):
    """A `SurfaceMotion` of maps (ny, nx, 3) in mm, one for each step."""
    displacement = np.stack(moved)
    gap = np.full(displacement.shape[:3], np.inf) if gap is None else gap
    plane = PlaneMotion(spec.map_x_mm, spec.map_y_mm, displacement, np.zeros_like(displacement), np.zeros(gap.shape, bool), gap)
    return replace(layered_surface(spec, -displacement[..., 2], displacement), plane=plane)


def dent(spec, *, depth=0.0, aside=(0.0, 0.0), width=3.0):
    """A map (ny, nx, 3) of a smooth dent in the middle that moves aside, in mm."""
    x, y = np.meshgrid(spec.map_x_mm, spec.map_y_mm)
    bell = np.exp(-(x**2 + y**2) / width**2)
    return np.stack([aside[0] * bell, aside[1] * bell, -depth * bell], axis=-1)


def read(spec, name, surface):
    return make_readout(name, spec.stated_readouts[name]).read(surface)
