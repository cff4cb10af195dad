"""The dielectric between a plate and glass: one cell of its lattice, force per frustum against contact area (FTIR)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError
from softtact.fem.elements import HEX27, QUAD9
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.frusta import FrustumArray
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.sensors.frusta import SensorSpec

# A gap this wide ends total reflection: the evanescent wave's intensity falls to 1/e in lambda / (4 pi sqrt(n^2 sin^2 theta - 1)),
# for green light (0.53 um) in acrylic (n = 1.49) 0.13 um at 45 degrees and 0.05 um at 60 degrees.
DARK_GAP_MM = 1e-4
# Where tips are narrow their sides fold onto the glass: thin layers in the lowest third and thin rings at the rim
# (docs/notebook/2026-11-22-mesh-on-glass.md).
GLASS_MESH = MeshSettings.converging(frustum_heights=(*np.linspace(0, 0.2, 11), 0.24, 0.28, 0.33, 0.4, 0.5, 0.7, 1.0),
                                     frustum_rings=4)
# Where tips are wide the sides fold onto the sheet, and thin layers there turn inside out before the paper's 140 N.
WIDE_TIP_MESH = MeshSettings.converging(frustum_heights=(0.0, 0.1, 0.3, 0.6, 0.9, 1.0))
# Overlaps that are pressed apart ripple by as much as they are allowed to, and the dark area with them.
SETTINGS = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.1, smallest_increment_n=1e-3)
_GIVE_UP_N = 5e-3    # force step at which a curve that may end early ends: smaller ones cost minutes and win little
_SAMPLES = 24        # points a side of a face at which contact is asked for


@dataclass(frozen=True)
class GlassCurve:
    """force_n (f,) on one frustum; area_mm2 (f,) of its contact with the glass; compression_mm (f,) of the cell."""

    force_n: np.ndarray
    area_mm2: np.ndarray
    compression_mm: np.ndarray


def press_cell_on_glass(spec: SensorSpec, law: Law, forces_n: Sequence[float] | np.ndarray, *, mesh: MeshSettings | None = None,
                        height_factor: float = 1.0, tip_factor: float = 1.0, as_far_as_it_goes: bool = False) -> GlassCurve:
    """Contact area of one frustum under forces (N per frustum, increasing, from 0 on).

    mesh: `MeshSettings`, by default the one for the frustum's shape
    as_far_as_it_goes: end the curve at the last force that was reached, where otherwise a ConvergenceError would be raised
    """
    body = build_unit_cell(spec, dielectric_law=law, mesh=mesh or glass_mesh(spec), height_factor=height_factor,
                           tip_factor=tip_factor)
    forces = np.asarray(forces_n, dtype=float)
    reached = [(0.0, 0.0, 0.0)] if forces[0] == 0 else []
    settings = replace(SETTINGS, smallest_increment_n=_GIVE_UP_N) if as_far_as_it_goes else SETTINGS
    try:
        for load_step in press_load_steps(body, HeightField(plate_over(spec)), forces[forces > 0], settings=settings):
            area = contact_area(body.support, load_step.state.support.displacement)     # type: ignore[arg-type]
            reached.append((load_step.force_n, area, load_step.state.indentation))
    except ConvergenceError:
        if not as_far_as_it_goes or len(reached) < 2:
            raise
    finally:
        body.close()
    return GlassCurve(*np.array(reached).T)


def glass_mesh(spec: SensorSpec, **changes: Any) -> MeshSettings:
    """The `MeshSettings` that a frustum of this shape needs; changes are made where its sides fold onto the glass."""
    frusta = spec.dielectric.frusta
    return replace(GLASS_MESH, **changes) if frusta.tip_diameter_mm < frusta.root_diameter_mm else WIDE_TIP_MESH


def plate_over(spec: SensorSpec) -> trimesh.Trimesh:
    """A rigid plate over the cell, its underside at z = 0."""
    plate = trimesh.creation.box((4 * spec.dielectric.frusta.pitch_mm,) * 2 + (1.0,))
    plate.apply_translation([0, 0, 0.5])
    return plate


def contact_area(support: FrustumArray, displacement: np.ndarray, *, frustum: int = 0, gap_mm: float = DARK_GAP_MM) -> float:
    """Projected area (mm2) of one frustum's surface that is nearer to the glass than `gap_mm`."""
    position = support.coordinates[frustum] + displacement[frustum]
    faces = np.vstack([support.mesh.layer(0)[:, HEX27.bottom], support.outer_faces])
    side = (np.arange(_SAMPLES) + 0.5) * 2 / _SAMPLES - 1
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    values, slopes = QUAD9.shape(points)
    nodes = position[faces]                                                     # (f, 9, 3)
    z = np.einsum("pa,fa->fp", values, nodes[..., 2])
    edges = np.einsum("fad,pai->fpdi", nodes[..., :2], slopes)
    projected = np.abs(np.linalg.det(edges)) * (2 / _SAMPLES) ** 2
    glass = support.coordinates[..., 2].min()
    return float(projected[z < glass + gap_mm].sum())
