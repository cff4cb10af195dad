"""Small skins for tests: one taxel, meshes that are coarse, and solved once."""

from functools import cache

import numpy as np

from softtact.skin.analysis import LayerMeshSizes, Skin
from softtact.skin.layout import module_layout


@cache
def small_skin(*, poisson=0.3, thickness_mm=2.0, centres=((8.0, 4.0), (13.0, 4.0)), side_mm=20.0, spacing_mm=1.5, layers=2,
               threads=1):
    """A module of 20 mm with two taxels, of permittivity 1."""
    layout = module_layout(side_mm=side_mm, centres_mm=np.array(centres))
    mesh = LayerMeshSizes(spacing_mm=spacing_mm, layers=layers, field_spacing_mm=2.0, field_layers=2)
    return Skin(layout, thickness_mm=thickness_mm, poisson=poisson, permittivity=1.0, mesh=mesh, threads=threads)
