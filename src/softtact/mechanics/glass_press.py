"""The dielectric between a plate and glass: one cell of its lattice, force per frustum against contact area (FTIR)."""

from dataclasses import dataclass

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.mechanics.elements import HEX27_BOTTOM, quad9
from softtact.mechanics.hyperelastic import NewtonSettings, press_levels
from softtact.mechanics.layered_body import MeshSettings, build_unit_cell

_TOUCH_MM = 1.5e-3     # a surface point this near to the glass is dark to total reflection: a wavelength or two and the penalty
# Coarser levels ripple at the tip.
_MESH = MeshSettings(frustum_levels=(0.0, 0.1, 0.3, 0.6, 1.0), local_over_shear=0.1, tip_over_shear=0.1)
_SAMPLES = 24        # points a side of a face at which contact is asked for


@dataclass(frozen=True)
class GlassCurve:
    """force_n (f,) on one frustum; area_mm2 (f,) of its contact with the glass; compression_mm (f,) of the cell."""

    force_n: np.ndarray
    area_mm2: np.ndarray
    compression_mm: np.ndarray


def press_cell_on_glass(spec, law, forces_n, *, mesh=None, height_factor=1.0, tip_factor=1.0):
    """Contact area of one frustum under forces (N per frustum, increasing)."""
    body = build_unit_cell(spec, dielectric_law=law, mesh=mesh or _MESH,
                           height_factor=height_factor, tip_factor=tip_factor)
    plate = trimesh.creation.box((4 * spec.dielectric.frusta.pitch_mm,) * 2 + (1.0,))
    plate.apply_translation([0, 0, 0.5])
    # Overlaps that are pressed apart ripple by as much as they are allowed to, and the dark area with them.
    settings = NewtonSettings(contact_passes=0, first_touch_mm=1e-3, smallest_scale_n=0.1, smallest_increment_n=1e-3)
    levels = list(press_levels(body, HeightField(plate), forces_n, settings=settings))
    area = [contact_area(body.bed, level.state.bed.displacement) for level in levels]
    compression = [level.state.indentation for level in levels]
    body.close()
    return GlassCurve(np.asarray(forces_n, dtype=float), np.array(area), np.array(compression))


def contact_area(bed, displacement):
    """Projected area (mm2) of the first frustum's surface that lies on the PCB or glass."""
    position = bed.coordinates[0] + displacement[0]
    faces = np.vstack([bed.mesh.layer(0)[:, HEX27_BOTTOM], bed.outer_faces])
    side = (np.arange(_SAMPLES) + 0.5) * 2 / _SAMPLES - 1
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    values, slopes = quad9(points)
    nodes = position[faces]                                                     # (f, 8, 3)
    z = np.einsum("pa,fa->fp", values, nodes[..., 2])
    edges = np.einsum("fad,pai->fpdi", nodes[..., :2], slopes)
    projected = np.abs(np.linalg.det(edges)) * (2 / _SAMPLES) ** 2
    glass = bed.coordinates[0][:, 2].min()
    return float(projected[z < glass + _TOUCH_MM].sum())
