"""Which load steps of a press can be relied on (`PressResult.within_validity`); the rules: docs/reference/command_line.md."""

from dataclasses import replace

import numpy as np

from softtact.models.hyperelastic.newton import FULL_POCKET
from softtact.press.result import PressResult

_DEEPEST_LINEAR = 0.5       # of the layer's thickness: a linear layer does not know that it ends
_HARDLY_COMPRESSED = 0.33   # of a frustum's height; the foundation model then errs by 2 % at most (docs/explanation/fast_models.md)
_OVERLAP_LEFT = 3.0         # times the allowed overlap, or gap under pressure: above, pressing apart has failed
_FEWEST_POINTS = 9          # of the cover that carry the object: fewer do not resolve where a spike touches, and how deep


def valid_elastic(depth_mm: np.ndarray, *, thickness_mm: float) -> np.ndarray:
    """Which load steps (l,) of an elastic press hold: depth_mm (l,) is how far the object's lowest point has come down."""
    return depth_mm < _DEEPEST_LINEAR * thickness_mm


def valid_foundation(compression_mm: np.ndarray, depth_mm: np.ndarray, *, frustum_mm: float, thickness_mm: float,
                     law_limit_mm: float) -> np.ndarray:
    """Which load steps (l,) of a foundation press hold, by its most compressed frustum (l,), frustum_mm high, and by how far the
    object's lowest point has come down (l,): the slab is linear, too, and a corner sinks into it without end.
    """
    return (compression_mm < min(law_limit_mm, _HARDLY_COMPRESSED * frustum_mm)) & (depth_mm < _DEEPEST_LINEAR * thickness_mm)


def valid_hyperelastic(*, compression_mm: np.ndarray, contact_error_mm: np.ndarray, points: np.ndarray, depth_mm: np.ndarray,
                       rough: np.ndarray, forces_n: np.ndarray, frustum_mm: float, allowed_mm: float) -> np.ndarray:
    """Which load steps (l,) of a hyperelastic press hold, by its most compressed frustum, contacts, balance and course.

    contact_error_mm (l,): deepest overlap, or widest gap under pressure, of which `allowed_mm` were asked for
    points (l,): of the cover that carry the object;  compression_mm, frustum_mm: nan without frusta, where nothing asks for them
    rough (l,): whether more than the tolerance is left unbalanced;  forces_n (l,): where they do not grow, depths need not either
    """
    return (~rough & ~(compression_mm >= FULL_POCKET * frustum_mm) & (contact_error_mm < _OVERLAP_LEFT * allowed_mm)
            & (points >= _FEWEST_POINTS) & ((np.diff(forces_n) <= 0).any() | _grows(depth_mm, slack_mm=allowed_mm)))


def _grows(depth, *, slack_mm):
    """Which of the depths (l,) are not above a later one, nor below an earlier one: of two such one is another equilibrium."""
    deepest_before, least_after = np.maximum.accumulate(depth), np.minimum.accumulate(depth[::-1])[::-1]
    return (depth >= deepest_before - slack_mm) & (depth <= least_after + slack_mm)


def flag_buried(result: PressResult, top_mm: float) -> PressResult:
    """The result with the load steps flagged at which the object's top has sunk below the surface at rest: no model feels that
    side.
    """
    above = result.indentation_mm < top_mm
    return replace(result, within_validity=result.within_validity & above.astype(np.int8))


def flag_overloaded(result: PressResult, largest_n: float) -> PressResult:
    """The result with the steps flagged at which a press by depth needs more force than the sensor bears."""
    return replace(result, within_validity=result.within_validity & (result.normal_force_n <= largest_n).astype(np.int8))
