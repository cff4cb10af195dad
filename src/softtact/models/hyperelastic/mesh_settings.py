"""Resolution of the layered body, settings of Newton's method, and the scatter of one specimen's sizes about the drawing's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np

from softtact.contact.penalty import Contact
from softtact.errors import InputError
from softtact.fem.extruded_mesh import CORE_RADIUS
from softtact.sensors.frusta import SensorSpec
from softtact.unknown_names import unknown

FULL_POCKET = 0.8   # of a frustum's height: beyond, its pocket is full and contacts occur that are not modelled
_OBJECT_SMOOTHING_MM = 1e-3
_CORE_IN_ONE_RING = 0.6     # docs/notebook/2026-11-24-choice-of-the-meshes.md
SCATTER_KEYS = ("height_scatter", "tip_scatter", "thickness_scatter", "specimen")
_LARGEST_DEVIATION = 2.5     # standard deviations: a specimen beyond would not have passed inspection
LARGEST_SCATTER = 1 / _LARGEST_DEVIATION     # from which a frustum of the largest deviation would have no height, or no tip
_FAR_PITCHES = (1, 2, 4)
_SOLVER_KEYS = ("largest_penetration_mm", "relative_tolerance")


@dataclass(frozen=True)
class MeshSettings:
    """Resolution of the layered body.

    cover_heights: heights of the cover's element layers as shares of its thickness; cover_splits: split depths of the elements, a
    pitch wide, of its uppermost layers along x and y: at the object's edges, and in the lowest of these layers all over the area
    under the object if it lies on the sheet. Layers below these, without a number in cover_splits, share the sheet's 2-D mesh;
    far_pitches: pitches (1, 2, 4) that an element far from the object spans; contact_stiffness: N/mm3 of the contacts' penalty,
    a third of it takes a quarter fewer iterations and leaves three times the overlap; sheet_layers: elements through the sheet;
    frustum_heights: heights of the frustum's element layers as shares of its height; unprojected_penalty_ratio,
    quartic_penalty_ratio: moduli over mu of the penalties on the frusta's volume change outside the projection (see
    `solid_block`);
    slab_quartic_penalty_ratio: the quartic one in sheet and cover, for frusta pressed to two thirds of their height;
    trilinear_pressure: or linear, which is softer by 2 % for small displacements, and fails under deep objects.
    refinement: number of splits of all elements along x and y. frustum_rings: rings of elements around a frustum's core, outer
    ones thinner; frustum_core: corners of this square core over the radius, by default 0.6 with one ring, which then
    resolves the rim, else 0.5: wider cores buckle earlier where frusta are pressed flat. constrained_cell_edges: along all edges
    between cells, not only far from the object, the sheet moves as one
    quadratic curve: half of a factorisation's operations, 2 to 2.5 % change of the map; no effect on refined meshes.
    """

    sheet_layers: int = 1
    frustum_heights: tuple = (0.0, 0.2, 0.6, 1.0)
    unprojected_penalty_ratio: float = 0.5
    quartic_penalty_ratio: float = 100.0
    slab_quartic_penalty_ratio: float = 0.0
    trilinear_pressure: bool = True
    refinement: int = 0
    frustum_rings: int = 1
    frustum_core: float | None = None
    constrained_cell_edges: bool = False
    cover_heights: tuple = (0.0, 0.5, 1.0)
    cover_splits: tuple = (1,)
    far_pitches: int = 2
    contact_stiffness: float = 3000.0

    def __post_init__(self):
        for name in ("cover_heights", "frustum_heights"):
            _check_heights(name, getattr(self, name))
        if self.far_pitches not in _FAR_PITCHES:
            raise InputError(f"mesh: far_pitches is {self.far_pitches!r}; use 1, 2 or 4.")
        if not isinstance(self.cover_splits, Sequence):
            raise InputError(f"mesh: cover_splits is {self.cover_splits!r}; give a list with a number for each of the uppermost "
                             "layers.")
        if not 1 <= len(self.cover_splits) <= len(self.cover_heights) - 1:
            raise InputError(f"mesh: cover_splits has {len(self.cover_splits)} entries for the {len(self.cover_heights) - 1} "
                             "layers of cover_heights; give a number for each, or for the uppermost ones.")
        if self.cover_splits[0] > 1:
            raise InputError(f"mesh: cover_splits begins with {self.cover_splits[0]}; give 0 or 1: the nodes of a layer that is "
                             "finer than the one below are not tied to it, and the map is wrong by up to a third.")

    @property
    def core(self) -> float:
        """Radius of the core's corners over that of a frustum's disc."""
        if self.frustum_core is not None:
            return self.frustum_core
        return _CORE_IN_ONE_RING if self.frustum_rings == 1 else CORE_RADIUS

    @property
    def bound_layers(self) -> int:
        """Number of the cover's lowest layers that share the sheet's 2-D mesh."""
        return len(self.cover_heights) - 1 - len(self.cover_splits)

    @property
    def contact(self) -> Contact:
        """The frusta's penalty, linear above half of a pressure of 1 MPa."""
        return Contact(stiffness=self.contact_stiffness, smoothing=1.0 / self.contact_stiffness)

    @property
    def object_contact(self) -> Contact:
        """The object's penalty: softer at low pressure; a third fewer factorisations under a wide punch, 0.3 um more overlap."""
        return Contact(stiffness=self.contact_stiffness, smoothing=_OBJECT_SMOOTHING_MM)

    @classmethod
    def draft(cls) -> "MeshSettings":
        """For quick studies: a layer less in frusta, cover tied to the sheet, constrained edges; see `NewtonSettings.draft`."""
        return cls(frustum_heights=(0.0, 0.35, 1.0), constrained_cell_edges=True, cover_splits=(0, 1), contact_stiffness=1000.0)

    @classmethod
    def fine(cls) -> "MeshSettings":
        """Within 2 % of the map's maximum at every point under punch, sphere and ridges, for twice the default's time.

        The cover has one more layer and is finer at edges, frusta have two rings. Under a punch as wide as two frusta 3 %
        (docs/explanation/discretisation.md).
        """
        return cls(cover_heights=(0.0, 0.4, 0.75, 1.0), cover_splits=(1, 2), frustum_rings=2, frustum_core=0.6,
                   frustum_heights=(0.0, 0.2, 0.7, 1.0))

    @classmethod
    def converging(cls, *, unprojected_penalty_ratio: float = 0.1, **changes: Any) -> "MeshSettings":
        """For mesh convergence studies of single frusta and cells, and light presses: linear pressure, which does not lock."""
        return cls(unprojected_penalty_ratio=unprojected_penalty_ratio, quartic_penalty_ratio=0.0, trilinear_pressure=False,
                   **changes)

    @classmethod
    def light(cls) -> "MeshSettings":
        """For presses that compress no frustum by more than a third: frusta within 2.5 % of converged ones, at the default's time.

        As many unknowns as the default, whose frusta are 8 to 11 % too stiff: the ring around a frustum's core lies at the rim,
        where stress concentrates, and its pressure is linear. Deeper presses may stop, as elements with linear pressure collapse
        (docs/notebook/2026-11-28-stiffness-of-the-frusta.md).
        """
        return cls.converging(frustum_core=0.9, frustum_heights=(0.0, 0.15, 0.5, 1.0))

    @classmethod
    def stable(cls) -> "MeshSettings":
        """For frusta compressed by more than 60 % of their height, where elements of the default mesh buckle and many steps fail.

        Tested with a sphere up to 50 N; under a flat punch the map differs from the default mesh's by 1.4 % of its maximum
        (docs/notebook/2026-11-23-folding-frusta.md).
        """
        return cls(quartic_penalty_ratio=400.0, slab_quartic_penalty_ratio=10.0)


def _check_heights(name, values):
    """Refuse heights of element layers that do not rise from 0 to 1."""
    numbers = isinstance(values, Sequence | np.ndarray) and all(isinstance(value, Real) for value in values)
    if not numbers or len(values) < 2 or (values[0], values[-1]) != (0, 1) or not all(low < high for low, high in pairwise(values)):
        raise InputError(f"mesh: {name} is {values!r}; give shares of the height that rise from 0 to 1, as (0, 0.5, 1).")


@dataclass(frozen=True)
class NewtonSettings:
    """Convergence criteria of a load step, and limits of Newton's method.

    relative_tolerance: largest unbalanced nodal force as a share of the force, at least of smallest_scale_n
    largest_penetration_mm, max_augmentations: load steps with deeper overlaps are augmented and solved again, at most so
    often
    full_depth_mm: for a smaller descent of the cover the allowed overlap is reduced in proportion: 1 um is 4 % of a light press
    largest_step_mm: largest movement of a node in one iteration;  smallest_increment_n: force steps are halved down to this
    load_step_iterations: limit of all iterations of a load step, of which a run under rounded edges counts at most
    max_iterations;  friction_iterations: the same with friction, and for
    augmentations; a load step that converges slowly would take hours
    first_touch_mm, first_touch_tolerance_n: overlap at which the press begins, and the tolerance of its residual
    largest_way_mm: largest displacement of an object in an increment of a `Motion`
    max_iterations: of an increment, doubled if the residual is then at most nearly_balanced, a share of the force
    rough_tolerance: replaces relative_tolerance after rough_after iterations if frusta are compressed beyond `DEEP`: there they
    continue to fold at constant force. Under rounded edges, where points may still slip, after twice as many. Results flag such a
    load step.
    projection_iterations: number of iterations that update the contact projection
    kept_tangent_mm: a cell that moved less since its last tangent keeps it
    force_growth: largest ratio of the forces of two increments in turn, with friction and under rounded edges
    With friction
    friction_tolerance: share of the tolerance
    friction_passes, whole_passes: number of updates of the friction's pressures, and of those that take the full difference
    """

    relative_tolerance: float = 3e-4   # with 1e-4 the indentation changes by 3e-4 of its value, the map by 0.03 % (rms)
    largest_penetration_mm: float = 1e-3
    full_depth_mm: float = 0.2
    max_augmentations: int = 20
    max_iterations: int = 30
    nearly_balanced: float = 0.02
    rough_tolerance: float = 3e-3
    rough_after: int = 30
    load_step_iterations: int = 100
    largest_step_mm: float = 0.12
    smallest_increment_n: float = 0.02
    smallest_scale_n: float = 10.0
    largest_way_mm: float = 0.05       # of a motion at once, down or aside: friction depends on the path
    first_touch_mm: float = 0.01
    first_touch_tolerance_n: float = 0.1   # only the start of the first load step, not a result
    projection_iterations: int = 6
    kept_tangent_mm: float = 0.016     # as many iterations as with 4 um, since frusta far from equilibrium take separate steps
    force_growth: float = 2.0          # error of a single step with friction to 4 N 1.8 %, of two steps less than 0.1 %
    friction_tolerance: float = 0.3    # sliding is soft: indentation error 0.4 % with 1, 0.01 % with 0.3, at 1 N on 20 frusta
    friction_iterations: int = 300
    friction_passes: int = 30
    whole_passes: int = 3

    @classmethod
    def draft(cls) -> "NewtonSettings":
        """For `MeshSettings.draft()`, whose map has errors of 10 % at edges: half the time; the map changes by 0.1 % (rms)."""
        return cls(relative_tolerance=1e-3, largest_penetration_mm=4e-3, kept_tangent_mm=0.03)


def frustum_scatter(spec: SensorSpec, values: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """Factors (heights, tip diameters) of a specimen's frusta, each near 1; None if no scatter is requested."""
    if not any(key in values for key in SCATTER_KEYS):
        return None
    for key in ("height_scatter", "tip_scatter"):
        _check_scatter(key, values.get(key, 0.0))
    count = int(np.prod(spec.frusta_counts))
    rng = np.random.default_rng(int(values.get("specimen", 0)))
    heights, tips = rng.standard_normal((2, count)).clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    return 1 + values.get("height_scatter", 0.0) * heights, 1 + values.get("tip_scatter", 0.0) * tips


def _check_scatter(key, value):
    if not (isinstance(value, Real) and 0 <= value < LARGEST_SCATTER):
        raise InputError(f"mesh: {key} is {value!r}; give a standard deviation as a share of the size, from 0 to below "
                         f"{LARGEST_SCATTER:g}, with which nothing turns over.")


def specimen_of(spec: SensorSpec, values: Mapping[str, Any]) -> SensorSpec:
    """The sensor with the thickness of sheet and cover of one specimen; the frusta's scatter is `frustum_scatter`'s."""
    scatter = values.get("thickness_scatter", 0.0)
    _check_scatter("thickness_scatter", scatter)
    if not scatter:
        return spec
    sheet, cover = 1 + scatter * np.random.default_rng([int(values.get("specimen", 0)), 1]).standard_normal(2).clip(
        -_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    dielectric = spec.dielectric.model_copy(update={"sheet_thickness_mm": spec.dielectric.sheet_thickness_mm * sheet})
    return spec.model_copy(update={
        "dielectric": dielectric, "cover": spec.cover.model_copy(update={"thickness_mm": spec.cover.thickness_mm * cover})})
# Presets by name: mesh settings with their Newton settings.
PRESETS = {"default": (MeshSettings, NewtonSettings), "draft": (MeshSettings.draft, NewtonSettings.draft),
           "stable": (MeshSettings.stable, NewtonSettings), "fine": (MeshSettings.fine, NewtonSettings),
           "light": (MeshSettings.light, NewtonSettings)}


def mesh_settings(values: Mapping[str, Any]) -> MeshSettings:
    """`MeshSettings` from a mapping: those of its `preset`, changed by its other keys.

    Keys of the scatter and the solver are ignored, an unknown key is refused.
    """
    own = {key: value for key, value in values.items() if key not in ("preset", *SCATTER_KEYS, *_SOLVER_KEYS)}
    unknown = sorted(set(own) - set(MeshSettings.__dataclass_fields__))
    if unknown:
        raise InputError(f"mesh: key {unknown[0]!r} is unknown; use one of {', '.join(MeshSettings.__dataclass_fields__)}.")
    changes = {key: tuple(value) if isinstance(value, list) else value for key, value in own.items()}
    return replace(_preset(values)[0](), **changes)


def newton_settings(values: Mapping[str, Any]) -> NewtonSettings:
    """`NewtonSettings` from the same mapping."""
    return replace(_preset(values)[1](), **{key: values[key] for key in _SOLVER_KEYS if key in values})


def _preset(values):
    name = values.get("preset", "default")
    if name not in PRESETS:
        raise InputError(f"mesh: {unknown(name, PRESETS, kind='preset')}")
    return PRESETS[name]
