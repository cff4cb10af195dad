"""The kinds of elements that are compared: nodes of a `LayeredMesh`, shape functions, quadrature, projection of the volume change.

A `SolidBlock` projects J on the constant and on the further functions it is given at the quadrature points: none, the three
coordinates, or so many that the projection changes nothing (a plain displacement element).
"""

from dataclasses import dataclass

import numpy as np
from free_bodies.free_body import SolidElements
from free_bodies.tetrahedra import LinearTetrahedra
from sensor_meshes import compressed, tetrahedra_of, wedges_of

from softtact.fem.elements import HEX20, HEX27, QUAD8, QUAD9, TRI6, WEDGE18, reference_gradients
from softtact.fem.quadrature import gauss, wedge_rule
from softtact.fem.solid_block import SolidBlock, pressure_modes

_TET_EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
_TET_FACES = np.array([[0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]])
# Of the full quadratic elements' nodes: those of the smaller kinds, in their usual order.
_HEX20, _WEDGE15 = HEX27.abaqus_nodes.tolist(), WEDGE18.abaqus_nodes.tolist()
_HEX8, _WEDGE6 = _HEX20[:8], [0, 1, 2, 6, 7, 8]


def hex8(points):
    """Values (n, 8) and derivatives (n, 8, 3) of the trilinear hexahedron."""
    corners = HEX20.nodes[:8]
    factor = 0.5 * (1 + np.asarray(points)[:, None, :] * corners)
    slopes = [0.5 * corners[:, i] * np.delete(factor, i, axis=2).prod(axis=2) for i in range(3)]
    return factor.prod(axis=2), np.stack(slopes, axis=2)


def wedge6(points):
    """Values (n, 6) and derivatives (n, 6, 3) of the linear wedge."""
    r, s, z = np.asarray(points).T
    L, dL = np.column_stack([1 - r - s, r, s]), np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    values, slopes = [], []
    for sign in (-1, 1):
        up = 0.5 * (1 + sign * z)[:, None]
        values.append(L * up)
        slopes.append(np.concatenate([dL[None] * up[..., None], 0.5 * sign * L[..., None]], axis=2))
    return np.hstack(values), np.concatenate(slopes, axis=1)


def wedge15(points):
    """Values (n, 15) and derivatives (n, 15, 3) of the serendipity wedge: the full one's functions, its bubbles passed on."""
    full, slopes = WEDGE18.shape(points)
    # A full element's face centre takes the mean that a serendipity quadrilateral has there: corners -1/4, mid-sides 1/2.
    follow = np.zeros((18, 15))
    follow[_WEDGE15, np.arange(15)] = 1.0
    for k in range(3):
        n = (k + 1) % 3
        follow[15 + k, [k, n, 3 + k, 3 + n]] = -0.25
        follow[15 + k, [6 + k, 9 + k, 12 + k, 12 + n]] = 0.5
    return full @ follow, np.einsum("gmd,mk->gkd", slopes, follow)


def tet10(points):
    """Values (n, 10) and derivatives (n, 10, 3) of the quadratic tetrahedron."""
    points = np.asarray(points)
    L = np.column_stack([1 - points.sum(axis=1), points])
    dL = np.vstack([-np.ones(3), np.eye(3)])
    a, b = _TET_EDGES.T
    values = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    slopes = np.concatenate([(4 * L - 1)[..., None] * dL, 4 * (L[:, a, None] * dL[b] + L[:, b, None] * dL[a])], axis=1)
    return values, slopes


def tet_rule():
    """The usual four points of degree 2: points (4, 3), weights (4,)."""
    near, far = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
    return np.vstack([[near] * 3, near + (far - near) * np.eye(3)]), np.full(4, 1 / 24)


def fine_tet_rule():
    """Gauss points of a cube collapsed to a tetrahedron, degree 3 and more: points (27, 3), weights (27,)."""
    x, w = gauss(3, 3)
    u, v, t = (0.5 * (1 + x)).T
    return np.column_stack([u, v * (1 - u), t * (1 - u) * (1 - v)]), w / 8 * (1 - u) ** 2 * (1 - v)


def small_wedge_rule(in_plan):
    """Three points in plan (degree 2) times `in_plan` along the height."""
    z, w = np.polynomial.legendre.leggauss(in_plan)
    plane = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
    return np.column_stack([np.tile(plane, (in_plan, 1)), np.repeat(z, 3)]), np.repeat(w, 3) / 6


def _none(points):
    return np.eye(len(points))[:, 1:]


def _constant(points):
    return np.zeros((len(points), 0))


def _linear(points):
    return points


def _block(points, nodes, shape, rule, modes, law, **options):
    x, weights = rule
    gradients, volumes = reference_gradients(points[nodes], shape(x)[1], weights)
    return SolidElements(nodes, SolidBlock(gradients, volumes, pressure_modes(modes(x)), law, **options))


@dataclass(frozen=True)
class Kind:
    """A kind of element: its name in tables, and how it takes its nodes, shapes, rules and modes from a mesh."""

    name: str
    family: str                  # "brick" or "tet"
    hex: tuple = ()              # (columns of the 27 nodes, shape, rule)
    wedge: tuple = ()            # (columns of the 18 nodes, shape, rule)
    tet: tuple = ()              # (number of nodes, rule)
    modes: object = _none
    unprojected_penalty_ratio: tuple = (0.0, 0.0)   # in sheet and cover, in cones: see `blocks`

    @property
    def linear(self):
        """Whether its edges are straight: the mesh then corrects the circles' area."""
        return len(self.hex[0]) == 8 if self.hex else self.tet[0] == 4


_ALL27, _ALL18 = list(range(27)), list(range(18))
KINDS = {
    "tet4": Kind("linear tetrahedra", "tet", tet=(4, None)),
    "tet10": Kind("quadratic tetrahedra", "tet", tet=(10, tet_rule())),
    "tet10p0": Kind("quadratic tetrahedra, constant pressure", "tet", tet=(10, tet_rule()), modes=_constant),
    "tet10p1": Kind("quadratic tetrahedra, linear pressure", "tet", tet=(10, fine_tet_rule()), modes=_linear),
    "hex8": Kind("8-node hexahedra and 6-node wedges, mean dilatation", "brick", modes=_constant,
                 hex=(_HEX8, hex8, gauss(2, 3)), wedge=(_WEDGE6, wedge6, small_wedge_rule(2))),
    "hex20": Kind("20-node hexahedra of 8 points and 15-node wedges, linear pressure", "brick", modes=_linear,
                  hex=(_HEX20, HEX20.shape, gauss(2, 3)), wedge=(_WEDGE15, wedge15, small_wedge_rule(3))),
    "hex27": Kind("27-node hexahedra and 18-node wedges, linear pressure", "brick", modes=_linear,
                  hex=(_ALL27, HEX27.shape, gauss(3, 3)), wedge=(_ALL18, WEDGE18.shape, wedge_rule())),
    "hex27local": Kind("the 27-node row, in cones 4 mu of K at every point", "brick", modes=_linear,
                       unprojected_penalty_ratio=(0.0, 4.0),
                       hex=(_ALL27, HEX27.shape, gauss(3, 3)), wedge=(_ALL18, WEDGE18.shape, wedge_rule())),
    "reference": Kind("the 27-node row, mu of K at every point", "brick", modes=_linear, unprojected_penalty_ratio=(1.0, 1.0),
                      hex=(_ALL27, HEX27.shape, gauss(3, 3)), wedge=(_ALL18, WEDGE18.shape, wedge_rule())),
}


@dataclass(frozen=True)
class Discretised:
    """points (n, 3), parts for a `FreeBody`, faces {nodes a face: (f, nodes)} of top, tips and cone sides, interface nodes."""

    points: np.ndarray
    parts: list
    top: dict
    tips: dict
    sides: dict
    interface: np.ndarray


def discretise(mesh, kind, laws):
    """A `LayeredMesh` in elements of a `Kind`; laws by material."""
    return (_in_tetrahedra if kind.family == "tet" else _in_bricks)(mesh, kind, laws)


def _in_tetrahedra(mesh, kind, laws):
    count, rule = kind.tet
    faces = 6 if count == 10 else 3
    cut = [tetrahedra_of(mesh.points, wedges_of(mesh.hexes[name], mesh.wedges[name]))[:, :count] for name in laws]
    points, *cut, interface = compressed(mesh.points, *cut, mesh.interface)
    if count == 4:
        parts = [LinearTetrahedra(points, tets, law) for tets, law in zip(cut, laws.values(), strict=True)]
    else:
        parts = [_block(points, tets, tet10, rule, kind.modes, law) for tets, law in zip(cut, laws.values(), strict=True)]
    outer = _boundary(np.vstack(cut)[:, _TET_FACES[:, :faces]].reshape(-1, faces))
    z = points[outer[:, :3]][..., 2]
    bottom, root = points[:, 2].min(), mesh.z_root
    chosen = {"top": z.min(axis=1) > -1e-9, "tips": z.max(axis=1) < bottom + 1e-9,
              "sides": (z.mean(axis=1) < root - 1e-6) & (z.max(axis=1) > bottom + 1e-9)}
    return Discretised(points, parts, interface=interface, **{name: {faces: outer[here]} for name, here in chosen.items()})


def _boundary(faces):
    _, first, counts = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[counts == 1]]


def _in_bricks(mesh, kind, laws):
    groups = []
    for name, law in laws.items():
        for whole, (columns, shape, rule) in ((mesh.hexes[name], kind.hex), (mesh.wedges[name], kind.wedge)):
            in_cones = mesh.points[whole].mean(axis=1)[:, 2] < mesh.z_root
            for share, chosen in zip(kind.unprojected_penalty_ratio, (~in_cones, in_cones), strict=True):
                if chosen.any():
                    groups.append((np.ascontiguousarray(whole[chosen][:, columns]), shape, rule, law, share))
    in_quad = {8: 4, 20: 8, 27: 9}[len(kind.hex[0])]
    in_triangle = {4: 3, 8: 6, 9: 6}[in_quad]
    faces = [{in_quad: f[9][:, :in_quad], in_triangle: f.get(6, np.zeros((0, 6), int))[:, :in_triangle]}
             for f in (mesh.top, mesh.tips, mesh.cone_sides)]
    flat = [face for group in faces for face in group.values()]
    points, *rest = compressed(mesh.points, *(nodes for nodes, *_ in groups), *flat, mesh.interface)
    parts = [_block(points, nodes, shape, rule, kind.modes, law, unprojected_penalty_ratio=share)
             for nodes, (_, shape, rule, law, share) in zip(rest, groups, strict=False)]
    rest = rest[len(groups):]
    top, tips, sides = ({in_quad: rest[2 * k], in_triangle: rest[2 * k + 1]} for k in range(3))
    return Discretised(points, parts, top, tips, sides, rest[-1])


# Points on faces --------------------------------------------------------------------------------------------------------------


def _quad4(points):
    x, y = np.asarray(points).T
    cx, cy = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    fx, fy = 0.5 * (1 + x[:, None] * cx), 0.5 * (1 + y[:, None] * cy)
    return fx * fy, np.stack([0.5 * cx * fy, 0.5 * cy * fx], axis=2)


def _tri3(points):
    points = np.asarray(points)
    slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    return np.column_stack([1 - points.sum(axis=1), points]), np.tile(slopes, (len(points), 1, 1))


_FACE_SHAPES = {3: _tri3, 4: _quad4, 6: TRI6.shape, 8: QUAD8.shape, 9: QUAD9.shape}


def face_points(points, faces, along):
    """Shape values (g, m) and areas (f, g) of about `along` points along each side of the faces (f, m)."""
    nodes = faces.shape[1]
    x, weights = gauss(along, 2) if nodes in (4, 8, 9) else _triangle_rule(along)
    values, slopes = _FACE_SHAPES[nodes](x)
    edges = np.einsum("fad,gai->fgdi", points[faces], slopes, optimize=True)
    return values, np.linalg.norm(np.cross(edges[..., 0], edges[..., 1]), axis=-1) * weights


def _triangle_rule(parts):
    """The centres of the p^2 equal parts of a triangle: points (p^2, 2), weights (p^2,)."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(parts), np.arange(parts)))
    up, down = i + j < parts, i + j < parts - 1
    x = np.vstack([np.column_stack([i[up], j[up]]) + 1 / 3, np.column_stack([i[down], j[down]]) + 2 / 3]) / parts
    return x, np.full(len(x), 0.5 / len(x))
