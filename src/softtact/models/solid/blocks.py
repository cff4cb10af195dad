"""Elements of a solid's regions, each kind with the projection of its changes of volume that keeps it from locking."""

from collections.abc import Mapping

import numpy as np

from softtact.errors import InputError
from softtact.fem.elements import Element, reference_gradients
from softtact.fem.kernels_plain import PlainLoops
from softtact.fem.quadrature import Quadrature
from softtact.fem.solid_block import SolidBlock
from softtact.fem.solid_mesh import SolidMesh
from softtact.linalg.workers import unique_rows
from softtact.materials.laws.base import Law

_COMPRESSIBLE = 8.0  # K / mu (Poisson's ratio 0.44) up to which tetrahedra and triangles need no projection
_ROUNDING_MM = 1e-9  # elements whose nodes differ by less are of one shape


def region_blocks(mesh: SolidMesh, laws: Mapping[str, Law]) -> list[tuple[str, np.ndarray, SolidBlock]]:
    """(region, nodes (e, m), block) of a mesh's elements.

    Raises InputError where a region has no law, a law no region, or an element is inverted.
    """
    if missing := [region for region in mesh.regions if region not in laws]:
        raise InputError(f"The region {missing[0]!r} has no law; give one for each of {', '.join(mesh.regions)}.")
    if unknown := [region for region in laws if region not in mesh.regions]:
        raise InputError(
            f"There is a law for {unknown[0]!r}, which is no region of the mesh; its regions are {', '.join(mesh.regions)}."
        )
    return [
        (region, np.ascontiguousarray(nodes), element_block(mesh, region, element, nodes, laws[region]))
        for region, element, nodes in mesh.parts()
        if len(nodes)
    ]


def element_block(mesh: SolidMesh, region: str, element: Element, nodes: np.ndarray, law: Law) -> SolidBlock:
    """The block of elements (e, m) of one kind and law."""
    d, rule = element.nodes.shape[1], _rule(element)
    corners = mesh.points[nodes]
    first, shapes = unique_rows(
        np.round((corners - corners[:, :1]).reshape(len(corners), -1) / _ROUNDING_MM)
        if not mesh.axisymmetric
        else np.round(corners.reshape(len(corners), -1) / _ROUNDING_MM)
    )
    values, slopes = element.shape(rule.points)
    try:
        gradients, volumes = reference_gradients(corners[first][..., :d], slopes, rule.weights)
    except ValueError:
        raise InputError(_inverted(mesh, region, element, nodes, rule)) from None
    hoop = np.zeros((*volumes.shape, nodes.shape[1]))
    if d == 2:
        gradients = np.concatenate([gradients, np.zeros((*gradients.shape[:3], 1))], axis=3)
        volumes, hoop = _swept(mesh, corners[first], values, volumes)
    block = SolidBlock(
        gradients, volumes, _coordinates(rule.points), law, shapes=shapes, basis=_pressure(element, rule.points, law)
    )
    if d == 2:
        block.loops = PlainLoops(hoop)  # type: ignore[assignment]
    return block


def _swept(mesh, corners, values, areas):
    """Volumes (u, g) in mm3 of a plane's areas (u, g), and the hoop functions (u, g, m) in 1/mm."""
    if not mesh.axisymmetric:
        return areas * mesh.thickness_mm, np.zeros((*areas.shape, corners.shape[1]))
    radius = np.einsum("gm,um->ug", values, corners[..., 0])
    return areas * 2 * np.pi * radius, values[None] / radius[..., None]


def _inverted(mesh, region, element, nodes, rule):
    d = element.nodes.shape[1]
    jacobian = np.einsum("emi,gmj->egij", mesh.points[nodes][..., :d], element.shape(rule.points)[1], optimize=True)
    worst = int(np.linalg.det(jacobian).min(axis=1).argmin())
    x, y, z = mesh.points[nodes[worst]].mean(axis=0)
    return (
        f"The region {region!r} has an inverted element (number {worst}, at {x:.4g}, {y:.4g}, {z:.4g} mm); number its nodes the "
        "other way round, or mesh the body again."
    )


def _rule(element: Element) -> Quadrature:
    """The rule of an element: four points of a quadratic tetrahedron, else the full one."""
    return element.reduced if element.meshio_name == "tetra10" else element.quadrature  # type: ignore[return-value]


def _coordinates(points):
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def _pressure(element: Element, points: np.ndarray, law: Law) -> np.ndarray:
    """Functions (g, p) on which changes of volume are projected.

    Linear ones in hexahedra, wedges and quadrilaterals. Tetrahedra and triangles: a constant for a law that is nearly
    incompressible,
    and as many functions as points, which change nothing, for any other.
    """
    if element.meshio_name in ("tetra10", "triangle6"):
        if law.bulk_modulus > _COMPRESSIBLE * law.mu0:
            return np.ones((len(points), 1))
        return np.eye(len(points))
    return np.column_stack([np.ones(len(points)), points])
