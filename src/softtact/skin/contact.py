"""A rigid mesh pressed on the skin: where it touches, and with which forces; the papers take an even pressure instead."""

import warnings

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.unilateral import active_set
from softtact.errors import ExtrapolationWarning, InputError
from softtact.skin.analysis import Skin
from softtact.skin.elastomers import Elastomer
from softtact.skin.loads import Load

_DEPTHS = (0.15, 0.3, 0.6)  # of the thickness: points further below an object are not looked at, unless it comes down as far
_AT_ONCE = 200  # columns of the compliance that are solved together
_GUESS_MPA = 0.1
_PASSES, _SETTLED = 20, 1e-3  # of the secant modulus, which depends on the pressure


def contact_load(
    skin: Skin,
    mesh: trimesh.Trimesh,
    centre_mm: tuple[float, float],
    *,
    force_n: float,
    elastomer: Elastomer,
    turned_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    name: str = "mesh",
) -> Load:
    """Forces of frictionless contact on the nodes of the upper side, so that nothing penetrates and nothing pulls.

    centre_mm: where the middle of the mesh's bounding box comes to, after turns about fixed x, y, z in degrees; it comes
    straight down
    The modulus is the secant one at the mean pressure on the nodes that touch, found by repetition.
    Raises InputError where no part of the mesh is above the elastomer.
    """
    placed = placed_over(mesh, centre_mm, turned_deg)
    top = skin.layer.mesh.top
    nodes = skin.layer.mesh.nodes_mm[top, :2]
    height = underside(placed, nodes, centre_mm, name)
    gap = height - height.min()
    for depth in _DEPTHS:
        near = np.flatnonzero(gap < depth * skin.thickness_mm)
        forces, pressure, indentation = _settled(skin, top[near], gap[near], force_n, elastomer)
        if indentation < depth * skin.thickness_mm:
            touching = forces > 0
            return Load(
                nodes[near[touching]],
                forces[touching],
                pressure,
                f"{force_n:g} N by {name} at ({centre_mm[0]:g}, {centre_mm[1]:g}) mm, {1e3 * pressure:.3g} kPa in the mean",
            )
    raise InputError(
        f"load {name!r}: {force_n:g} N presses it deeper than {_DEPTHS[-1]:.0%} of the {skin.thickness_mm:g} mm of elastomer, "
        "where small strains mean nothing; choose a smaller force_n."
    )


def placed_over(mesh: trimesh.Trimesh, centre_mm: tuple[float, float], turned_deg: tuple[float, float, float]) -> trimesh.Trimesh:
    """A copy, turned about fixed x, y, z in degrees, with the middle of its bounding box over a place in mm."""
    placed = mesh.copy()
    placed.vertices = Rotation.from_euler("xyz", turned_deg, degrees=True).apply(mesh.vertices)
    placed.apply_translation([*(np.array(centre_mm) - placed.bounds.mean(axis=0)[:2]), 0.0])
    return placed


def underside(placed: trimesh.Trimesh, points_mm: np.ndarray, centre_mm: tuple[float, float], name: str) -> np.ndarray:
    """Height (n,) in mm of the mesh's underside over points (n, 2), infinite beside it. InputError where it is over none."""
    height, _ = HeightField(placed)(*points_mm.T)
    over = height < NO_CONTACT_MM
    if not over.any():
        raise InputError(
            f"load {name!r}: the mesh at ({centre_mm[0]:g}, {centre_mm[1]:g}) mm lies beside the elastomer; correct at_mm."
        )
    return np.where(over, height, np.inf)


def _settled(skin, nodes, gap, force_n, elastomer):
    """Forces (c,) on nodes under gaps (c,), mean pressure, and how far the object comes down, with the modulus at that pressure."""
    compliance = _compliance(skin, nodes)
    node_area = skin.layout.area_mm2 / len(skin.layer.mesh.top)
    young = elastomer.young_gentle_mpa or _GUESS_MPA
    for _ in range(_PASSES):
        step = next(iter(active_set(compliance / young, gap, [force_n])))
        pressure = force_n / (node_area * np.count_nonzero(step.nodal_force))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)  # `analyse` says so of the modulus that is found
            before, young = young, elastomer.young_mpa(pressure)
        if abs(young / before - 1) < _SETTLED:
            break
    return step.nodal_force, pressure, step.indentation


def _compliance(skin, nodes):
    """Displacement down (c, c) of nodes under unit forces down on them, for a modulus of 1 MPa."""
    columns = []
    for start in range(0, len(nodes), _AT_ONCE):
        some = nodes[start : start + _AT_ONCE]
        nodal = np.zeros((len(skin.layer.mesh.nodes_mm), 3, len(some)))
        nodal[some, 2, np.arange(len(some))] = -1.0
        columns.append(-skin.layer.respond(nodal)[nodes, 2])
    return np.concatenate(columns, axis=1)
