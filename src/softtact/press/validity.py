"""Which load steps of a press can be relied on, and why the others cannot: `PressResult.within_validity`, `validity_reason`.

A rule returns `Flags`: for each reason, in words that name its limit, the load steps that it flags. In prose:
docs/reference/command_line.md, "What is flagged".
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from softtact.models.hyperelastic.mesh_settings import FULL_POCKET
from softtact.press.result import PressResult
from softtact.words import plain

Flags = Mapping[str, np.ndarray]

_DEEPEST_LINEAR = 0.5       # of the layer's thickness, beyond which a real layer is stiffer than a linear one
_AROUND = 0.9              # of the deepest node: least mean of three by three nodes where a contact is wider than these
_DEEPEST_NARROW = 0.5      # of the dielectric: a wall of 0.3 mm reads within 2 % wherever it stands up to 0.43, and 30 % at 0.58
_SLIGHT_COMPRESSION = 0.33   # of a frustum's height: the foundation model's error is at most 2 % (docs/explanation/fast_models.md)
_OVERLAP_LEFT = 3.0         # times the allowed overlap, or gap under pressure: above, the augmentations have failed
# Contact points under pressure: fewer do not resolve the contact of a spike. Balls of 0.3 to 5 mm on a layer of 2 mm, moved by
# parts of the nodes' step, against nodes four times as dense: depths of the elastic model are within 5 % with 10 points or more, 18
# % with 9, 40 % with 6 to 8, and twice too large with fewer. A ball of 2 mm has 10 on coro from 0.2 N on. The foundation model
# knows edges between nodes: depths under pins of 0.1 mm differ by 60 % (mostly fewer than 9 points), under pins of 0.2 mm by 10 %.
_FEWEST_POINTS = 9
# Largest residual as a share of the force. The solver's tolerance is that of 10 N for all smaller forces (`smallest_scale_n`): of a
# box, a cylinder and a ball on a layer of 2 mm at 1 mN to 1 N, maps with a smaller share are within 3 % (one of 11: 14 %), those
# with a larger one are off by up to 75 %.
_RESIDUAL = 0.02
BETWEEN = "; "             # two reasons of one load step


def reasons(flags: Flags, steps: int) -> np.ndarray:
    """Reasons (l,) in words why load steps are not valid, several joined by `BETWEEN`; empty where a step is valid."""
    return np.array([BETWEEN.join(words for words, where in flags.items() if where[step]) for step in range(steps)], dtype=str)


def flagged(result: PressResult, words: str, where: np.ndarray) -> PressResult:
    """The result with some more load steps (l,) flagged for a reason."""
    why = [BETWEEN.join(filter(None, (before, words if here else "")))
           for before, here in zip(result.validity_reason, where, strict=True)]
    return replace(result, within_validity=result.within_validity & (~where).astype(np.int8), validity_reason=np.array(why, str))


def by_reason(forces_n: list[float], within_validity: list[int], validity_reason: list[str]) -> dict[str, list[float]]:
    """{reason: forces in N} of the flagged load steps; one without a stated reason has an empty one."""
    found: dict[str, list[float]] = {}
    for force, valid, why in zip(forces_n, within_validity, validity_reason, strict=True):
        for words in () if valid else why.split(BETWEEN):
            found.setdefault(words, []).append(force)
    return found


def few_points(points: np.ndarray, of: str = "surface") -> Flags:
    """Flags of load steps at which some points (l,) of the `of` carry the object, but too few."""
    return {f"fewer than {_FEWEST_POINTS} points of the {of} carry the object, which is finer than these":
            (points > 0) & (points < _FEWEST_POINTS)}


def touches_lightly(reason: str) -> bool:
    """Whether a load step is flagged for few points alone, as the first ones may be; those of larger forces may be valid."""
    return bool(reason) and all(part.startswith(f"fewer than {_FEWEST_POINTS} points") for part in reason.split(BETWEEN))


def flags_elastic(depth_mm: np.ndarray, fields_mm: np.ndarray, points: np.ndarray, *, thickness_mm: float,
                  dielectric_mm: float) -> Flags:
    """Flags of an elastic press, by the descent (l,) of the object's lowest point, the surface's deformation (l, y, x) in mm
    at all its nodes, and how many points (l,) of it carry the object.
    """
    deepest, narrow = _DEEPEST_LINEAR * thickness_mm, _DEEPEST_NARROW * dielectric_mm
    return {f"the object is deeper in than {deepest:.3g} mm, half of the linear layer": ~(depth_mm < deepest),
            f"a wall or pin narrower than three points of the surface is deeper in than {narrow:.3g} mm, half of the dielectric":
                ~resolved_elastic(fields_mm, dielectric_mm=dielectric_mm), **few_points(points)}


def resolved_elastic(fields_mm: np.ndarray, *, dielectric_mm: float) -> np.ndarray:
    """Which load steps (l,) of an elastic press the surface's nodes resolve, by its deformation (l, y, x) in mm at all of them.

    Under a wall or a pin the surface is as steep as the nodes are close. Once it is deep in a dielectric, dielectric_mm thick,
    whose capacitance then rises without bound, readings would depend on how the nodes happen to lie.
    """
    deepest = fields_mm.max(axis=(1, 2))
    shallow: np.ndarray = deepest < _DEEPEST_NARROW * dielectric_mm
    if shallow.all():
        return shallow
    from scipy.ndimage import uniform_filter

    return shallow | (uniform_filter(fields_mm, (0, 3, 3)).max(axis=(1, 2)) >= _AROUND * deepest)


def flags_foundation(compression_mm: np.ndarray, depth_mm: np.ndarray, points: np.ndarray, *, frustum_mm: float,
                     thickness_mm: float, law_limit_mm: float) -> Flags:
    """Flags of a foundation press, by the most compressed frustum (l,), frustum_mm high, by the descent (l,) of the object's
    lowest point, as the slab is linear too and does not limit the depth of a corner, and by the points (l,) that carry the object.
    """
    compared, deepest = _SLIGHT_COMPRESSION * frustum_mm, _DEEPEST_LINEAR * thickness_mm
    limit = (f"{compared:.3g} mm, {_SLIGHT_COMPRESSION:.0%} of its height" if compared <= law_limit_mm else
             f"{law_limit_mm:.3g} mm, to which its law was computed")
    return {f"a frustum is compressed by more than {limit}": ~(compression_mm < min(law_limit_mm, compared)),
            f"the object is deeper in than {deepest:.3g} mm, half of the layer with its linear slab": ~(depth_mm < deepest),
            **few_points(points)}


def flags_hyperelastic(*, compression_mm: np.ndarray, contact_error_mm: np.ndarray, points: np.ndarray, depth_mm: np.ndarray,
                       rough: np.ndarray, residual_n: np.ndarray, forces_n: np.ndarray, volume_ratio: np.ndarray,
                       frustum_mm: float, allowed_mm: float) -> Flags:
    """Flags of a hyperelastic press, by compression, contact error, residual, folding and growth of depth.

    contact_error_mm (l,): deepest overlap, or widest gap under pressure; `allowed_mm` is the tolerance for it
    points (l,): number of the cover's points that carry the object;  compression_mm, frustum_mm: nan without frusta
    rough (l,): whether the residual is above the tolerance;  residual_n (l,): a small share of the force
    forces_n (l,): depths must grow where these do
    volume_ratio (l,): the least of the cover's elements, their corners included; nan without a cover
    """
    full, overlap = FULL_POCKET * frustum_mm, _OVERLAP_LEFT * allowed_mm
    steady = (np.diff(forces_n) <= 0).any() | _grows(depth_mm, slack_mm=allowed_mm)
    return {f"a frustum is compressed by more than {full:.3g} mm, {FULL_POCKET:.0%} of its height, when its pocket is full":
                compression_mm >= full,
            f"surfaces in contact overlap, or gape under pressure, by more than {plain(overlap)} mm":
                ~(contact_error_mm < overlap),
            f"fewer than {_FEWEST_POINTS} points of the cover carry the object, which is finer than the mesh":
                points < _FEWEST_POINTS,
            "an element of the cover is folded at a corner: an edge of the object is sharper than the mesh": volume_ratio <= 0,
            "frusta fold on under the same force, and the residual is above its tolerance": rough,
            f"the force is so small that the residual is above {_RESIDUAL:.0%} of it":
                (forces_n > 0) & (residual_n > _RESIDUAL * forces_n),
            "the depth does not grow with the force: two load steps are different equilibria": ~steady & np.ones(len(points), bool)}


def flags_solid(compression_mm: np.ndarray, *, law_limit_mm: float) -> Flags:
    """Flags of a press of a pad by the solid model, by the most compressed frustum (l,); nan without frusta."""
    return {f"a frustum is compressed by more than {law_limit_mm:.3g} mm, to which its law was computed":
                compression_mm > law_limit_mm}


def _grows(depth, *, slack_mm):
    """Which depths (l,) increase with the load steps: of two that do not, one belongs to another branch of equilibria."""
    deepest_before, least_after = np.maximum.accumulate(depth), np.minimum.accumulate(depth[::-1])[::-1]
    return (depth >= deepest_before - slack_mm) & (depth <= least_after + slack_mm)


def flag_buried(result: PressResult, top_mm: float | np.ndarray) -> PressResult:
    """The result with the load steps flagged at which the object's top, `top_mm` over first touch, is below the surface at rest: no
    model has contact on that side.

    top_mm: one for all load steps, or one for each
    """
    buried, top = ~(result.indentation_mm < top_mm), np.broadcast_to(top_mm, result.steps)
    for height in np.unique(top[buried]) if buried.any() else top[:0]:
        result = flagged(result, f"the object is {height:.3g} mm high, and its top is below the surface", buried & (top == height))
    return result


def flag_overloaded(result: PressResult, largest_n: float) -> PressResult:
    """The result with the steps flagged at which a press by depth needs more force than the sensor's limit."""
    return flagged(result, f"the force is above {largest_n:g} N, the sensor's limit", ~(result.normal_force_n <= largest_n))
