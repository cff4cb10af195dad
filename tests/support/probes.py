"""A palpation sensor for tests: coarse, with few steps, with one tissue."""

from softtact.materials.config import validated
from softtact.probe.design import PalpationDesign

_FILM = {"source": "a test's"}


def small_design(**changes):
    """A `PalpationDesign` of the paper's sizes on elements of 5 mm; `changes` as `PalpationDesign.with_` takes them."""
    soft = {"shear_mpa": 0.0633, "bulk_mpa": 0.703, "source": "table II"}
    values = {
        "name": "small",
        "geometry": {"support_length": 15, "support_height": 5, "filler_length": 37, "beam_height": 1.2, "tissue_height": 15,
                     "depth": 8},
        "supports": {"young_mpa": 3000, "poisson": 0.37, "source": "handbook"},
        "beam": {"young_mpa": 3500, "poisson": 0.35, "source": "handbook"},
        "filler": {"shear_mpa": 0.002743, "bulk_mpa": 0.030477, "source": "table II"},
        "tissues": {"rubber": soft},
        "films": {"middle": {"on": "filler", "side": "bottom", "start": 15, "end": 52} | _FILM,
                  "left": {"on": "left support", "side": "bottom", "start": 0, "end": 15} | _FILM,
                  "right": {"on": "right support", "side": "bottom", "start": 52, "end": 67} | _FILM},
        "load_n": {"to": 5, "by": 2.5}, "displacement_mm": {"to": 2, "by": 1},
        "mesh": {"along": 5, "tissue": 5, "base": 2.5},
    }
    return validated(PalpationDesign, values, where="small").with_(**changes)
