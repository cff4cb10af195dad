"""A solid's regions: their elements, each kind with the projection of its changes of volume that keeps it from locking; where these
are summed up, in compiled loops on the processor or by Warp's kernels; which bodies they make; and their corners' shares.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from softtact.errors import InputError
from softtact.fem.elements import Element, reference_gradients
from softtact.fem.kernels_plain import PlainLoops
from softtact.fem.quadratic_nodes import shares_of_corners
from softtact.fem.quadrature import Quadrature
from softtact.fem.solid_block import SolidBlock
from softtact.fem.solid_mesh import SolidMesh
from softtact.linalg.workers import unique_rows
from softtact.materials.laws.base import Law

_COMPRESSIBLE = 8.0  # K / mu (Poisson's ratio 0.44) up to which tetrahedra and triangles need no projection
_ROUNDING_MM = 1e-9  # elements whose nodes differ by less are of one shape
_LARGE = 80_000  # unknowns: from here on a factor of the whole costs more
_MOST_BULK = 100.0  # times the shear modulus: beyond, corners alone lock, and two levels take too many steps


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
    block = SolidBlock(gradients, volumes, _pressure(element, rule.points, law), law, shapes=shapes)
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


# --- where elements are summed up ---


def sum_on(blocks: Sequence[tuple[str, np.ndarray, SolidBlock]], device: str) -> None:
    """Let Warp sum up the spatial elements."""
    from softtact.fem.kernels_warp import WarpKernels

    loops = WarpKernels(device)
    for _, _, block in blocks:
        if not isinstance(block.loops, PlainLoops):
            block.loops = loops  # type: ignore[assignment]


# --- bodies and corners ---


def bodies_of(mesh: SolidMesh) -> np.ndarray:
    """(n,) number of the body that each node of a mesh belongs to; nodes of no element are -1."""
    n, cells = len(mesh.points), [nodes for _, _, nodes in mesh.cells]
    pairs = np.concatenate([np.column_stack([np.repeat(nodes[:, 0], nodes.shape[1]), nodes.ravel()]) for nodes in cells])
    _, label = connected_components(sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    used = np.zeros(n, dtype=bool)
    used[pairs.ravel()] = True
    return np.where(used, label, -1)


def refuse_loose(mesh: SolidMesh, free: np.ndarray, supported: np.ndarray, held: Sequence[str]) -> None:
    """Refuse a body of which every component of every node is free: it has no balance.

    free (n, 3): which components are unknown, the mesh's nodes first;  supported: nodes that items tie to the ground
    held: the faces that are held, for the message
    """
    dimensions, body = 3 if mesh.geometry == "solid" else 2, bodies_of(mesh)
    bound = np.logical_not(free[: len(body), :dimensions].all(axis=1))
    bound[supported] = True
    for k in np.unique(body[body >= 0]):
        nodes = body == k
        if not bound[nodes].any():
            x, y, z = mesh.points[nodes].mean(axis=0)
            raise InputError(
                f"Nothing holds the body around {x:.4g}, {y:.4g}, {z:.4g} mm; hold one of its faces or let a frame carry it "
                f"(held are {', '.join(held) or 'none'})."
            )


def lift_from_corners(mesh: SolidMesh, laws: Mapping[str, Law], free: np.ndarray) -> sp.csr_matrix | None:
    """Values (unknowns, c) at the free unknowns, numbered 3 to a node, from those at the free corners.

    None where two levels do not serve (docs/notebook/2026-11-27-large-solids.md).
    """
    plane = mesh.geometry != "solid"  # whose factors take few operations
    if plane or len(free) < _LARGE or any(law.bulk_modulus > _MOST_BULK * law.mu0 for law in laws.values()):
        return None
    shares = shares_of_corners(len(mesh.points), ((element, nodes) for _, element, nodes in mesh.parts()))
    if shares is None:
        return None
    lift = sp.csr_matrix(sp.kron(shares, sp.identity(3)))
    corners = free[lift.diagonal()[free] > 0]
    return sp.csr_matrix(lift[free][:, corners]) if len(corners) else None
