"""A press in the terms of any finite-element program: nodes, elements, laws, constraints, surfaces, contacts and steps.

It does not depend on a program's dialect. Numbers count from 0; the writers add 1. Lengths in mm, forces in N, stresses
in MPa. The mesh has 20-node bricks and 15-node wedges: our 27-node bricks and 18-node wedges have nodes in the middle of faces and
bodies, too. Without these the element has the same shape, for its sides are curves through three nodes and its faces are spanned
by them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from softtact.contact.friction import Coulomb
from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.penalty import Contact
from softtact.errors import InputError, MissError
from softtact.fem.elements import HEX27, WEDGE18
from softtact.fem.extruded_mesh import Mesh2D
from softtact.geometry.meshes import facets_over
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.frusta import DIRECTIONS

_NO_WEIGHT = 1e-10
# Numbers of a brick's and a wedge's faces in Abaqus and CalculiX alike, S1 to S6: those of `Element.faces`, counted from 1.
BOTTOM, TOP, FIRST_SIDE = 1, 2, 3
TOUCH_MM = 0.01                   # overlap of object and cover after the first step, as a free object under a force needs contact
SLIVER_MM = 0.01                  # narrower facets are left out, as CalculiX's contact search does not end with them
_BOARD_MARGIN_MM = 1.0


@dataclass(frozen=True)
class Part:
    """Elements of one law: `elements` (h + w,) their numbers, nodes of `hexes` (h, 20), then of `wedges` (w, 15)."""

    name: str
    elements: np.ndarray
    hexes: np.ndarray
    wedges: np.ndarray
    law: object

    @property
    def hex_elements(self) -> np.ndarray:
        """Numbers (h,) of the bricks."""
        return self.elements[:len(self.hexes)]

    @property
    def wedge_elements(self) -> np.ndarray:
        """Numbers (w,) of the wedges."""
        return self.elements[len(self.hexes):]

    @property
    def nodes(self) -> np.ndarray:
        """Every node once."""
        return np.unique(np.concatenate([self.hexes.ravel(), self.wedges.ravel()]))


@dataclass(frozen=True)
class Tie:
    """Every component of the displacement of node `slave` is sum(weights * the masters')."""

    slave: int
    masters: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class BodyMesh:
    """points (n, 3) in mm; parts SHEET, COVER where there is one, FRUSTA; ties of nodes that follow others.

    slab (s,), frusta (f, nodes): number in `points` of each node of the slab and of each frustum, -1 where it is left out.
    """

    points: np.ndarray
    parts: list
    ties: list
    slab: np.ndarray
    frusta: np.ndarray


def body_mesh(body: LayeredBody) -> BodyMesh:
    """The `BodyMesh` of a `LayeredBody`."""
    slab = body.slab
    support: Any = body.support     # a `FrustumArray`: decks are of sensors with frusta
    cover, hanging = _cover_numbers(slab)
    sheet, followers = _sheet_numbers(slab, slab.nodes + len(hanging))
    first = slab.nodes + len(hanging) + len(followers)
    frusta = first + np.arange(support.count * support.nodes).reshape(support.count, support.nodes)
    frusta[:, support.root] = body.cells.roots
    points = np.vstack([slab.points, slab.cover_mesh.points[hanging], slab.sheet_mesh.points[followers],
                        support.coordinates.reshape(-1, 3)])
    ties = _ties(slab.nodes, hanging, *slab.cover_mesh.masters())
    ties += _ties(slab.nodes + len(hanging), followers, slab.sheet_nodes.masters, slab.sheet_nodes.weights)
    number = _numbers_in_use([sheet[_hexes(slab.sheet_mesh)], sheet[_wedges(slab.sheet_mesh)], cover,
                              frusta[:, _hexes(support.mesh)], *(tie.masters for tie in ties)], len(points))
    ties = [Tie(int(number[tie.slave]), number[tie.masters], tie.weights) for tie in ties if number[tie.slave] >= 0]
    frusta = number[frusta]
    return BodyMesh(points[number >= 0], _parts(body, number[sheet], number[cover], frusta), ties, number[:slab.nodes], frusta)


def _hexes(mesh):
    return mesh.hexes[:, HEX27.abaqus_nodes]


def _wedges(mesh):
    return mesh.wedges[:, WEDGE18.abaqus_nodes]


def _cover_numbers(slab):
    """Nodes of the cover's hexahedra (e, 20), and its points that follow others, which are numbered after the slab's nodes."""
    mesh = slab.cover_mesh
    hexes = np.where(mesh.hexes < mesh.free, mesh.hexes, slab.nodes + mesh.hexes - mesh.free)
    return hexes, np.arange(mesh.free, len(mesh.points))


def _sheet_numbers(slab, first_follower):
    """Number of each node of the sheet's mesh, and those that follow others, numbered from `first_follower` on.

    A node that follows a single node with weight 1 is identified with it.
    """
    masters, weights = slab.sheet_nodes.masters, slab.sheet_nodes.weights
    first = np.argmax(weights, axis=1)
    rows = np.arange(len(masters))
    followers = np.flatnonzero(np.abs(weights[rows, first] - 1) > _NO_WEIGHT)
    sheet = masters[rows, first]
    sheet[followers] = first_follower + np.arange(len(followers))
    return sheet, followers


def _ties(first, followers, masters, weights):
    """`Tie`s of followers, numbered from `first` on: to larger elements of the cover, its lower side, or constrained cell edges."""
    used = np.abs(weights) > _NO_WEIGHT
    return [Tie(first + k, masters[node, used[node]], weights[node, used[node]]) for k, node in enumerate(followers)]


def _numbers_in_use(members, count):
    """New number (count,) of each node that occurs among the members, -1 for the others."""
    used = np.zeros(count, dtype=bool)
    for nodes in members:
        used[nodes] = True
    return np.where(used, np.cumsum(used) - 1, -1)


def _parts(body, sheet, cover, frusta):
    slab = body.slab
    support: Any = body.support     # a `FrustumArray`: decks are of sensors with frusta
    none, mesh = np.zeros((0, 15), dtype=np.int64), slab.sheet_mesh
    (hexes, more_hexes), (wedges, more_wedges) = (np.split(sheet[kind], [len(kind) // mesh.layers * slab.sheet_layers])
                                                  for kind in (_hexes(mesh), _wedges(mesh)))     # the cover's are above
    pieces = [("SHEET", hexes, wedges, slab.layers[0].law),
              ("COVER", np.vstack([more_hexes, cover]), more_wedges, slab.layers[1].law),
              ("FRUSTA", frusta[:, _hexes(support.mesh)].reshape(-1, 20), none, support.block.law)]
    parts, first = [], 0
    for name, hexes, wedges, law in pieces:
        if len(hexes):
            parts.append(Part(name, first + np.arange(len(hexes) + len(wedges)), hexes, wedges, law))
            first = parts[-1].elements[-1] + 1
    return parts


@dataclass(frozen=True)
class RigidSurface:
    """Rigid triangles: points (n, 3), facets (m, 3) whose normals point at the rubber; `moves` along z, or is fixed."""

    name: str
    points: np.ndarray
    facets: np.ndarray
    moves: bool


@dataclass(frozen=True)
class SurfacePair:
    """Surface `slave` may not pass surface `master` (a rigid one or one of a part).

    `contact`: the penalty's stiffness (N/mm3) and smoothing depth (mm);  `friction`: the law along the surface, None without.
    """

    name: str
    slave: str
    master: str
    contact: Contact
    friction: Coulomb | None = None


@dataclass(frozen=True)
class ObjectStep:
    """The object is moved down to `value` mm (`control` "indentation") or pushed with `value` N ("force")."""

    name: str
    control: str
    value: float


@dataclass(frozen=True)
class DeckModel:
    """A press: points (n, 3) of the rubber, `held` (h, 2) pairs of node and component 0..2, named node sets and surfaces.

    surfaces: {name: (f, 2) element and face number S1..S6}
    remarks: comments of every deck
    """

    title: str
    points: np.ndarray
    parts: list
    ties: list
    held: np.ndarray
    node_sets: dict
    surfaces: dict
    rigid: list
    contacts: list
    steps: list
    remarks: tuple = ()


def deck_model(body: LayeredBody, placed: trimesh.Trimesh, *, forces_n: Sequence[float] | np.ndarray | None = None,
               indentations_mm: Sequence[float] | np.ndarray | None = None, title: str = "press",
               touch_mm: float = TOUCH_MM) -> DeckModel:
    """The press of a placed mesh (trimesh, mm) on a `LayeredBody` as a `DeckModel`.

    Either `forces_n` (N, increasing), after a first step that lowers the object to an overlap of `touch_mm`, or
    `indentations_mm` (increasing), which are prescribed.
    """
    surface, mesh = HeightField(placed), body_mesh(body)
    support: Any = body.support     # a `FrustumArray`: decks are of sensors with frusta
    surfaces = _surfaces(body, mesh)
    rigid, contacts = [_object(body, surface), _board(body)], _contacts(body)
    if "FRUSTA_SIDES_ODD" in surfaces:
        contacts.append(SurfacePair("NEIGHBOURS", "FRUSTA_SIDES_EVEN", "FRUSTA_SIDES_ODD", support.contact))
    walls = _walls(body)
    if walls is not None:
        rigid.append(walls)
        contacts.append(SurfacePair("WALLS", "FRUSTA_SIDES", "WALLS", support.contact))
    held = _held(body, mesh)
    return DeckModel(title=title, points=mesh.points, parts=mesh.parts, ties=mesh.ties, held=held,
                     node_sets=_node_sets(body, mesh, held), surfaces=surfaces, rigid=rigid, contacts=contacts,
                     steps=_steps(body, surface, forces_n, indentations_mm, touch_mm), remarks=_remarks(body))


def _node_sets(body, mesh, held):
    """Sets by name: nodes of each part, the plane under the cover, tips, nodes that follow others, held ones."""
    sets = {part.name: part.nodes for part in mesh.parts}
    interface = mesh.slab[body.slab.interface_nodes]
    sets["INTERFACE"] = np.sort(interface[interface >= 0])     # a deck leaves out nodes in the middle of faces
    tips = mesh.frusta[:, body.support.tip]
    return sets | {"TIPS": tips[tips >= 0], "TIED": np.array([tie.slave for tie in mesh.ties], dtype=int),
                   "HELD": np.unique(held[:, 0])}


def _held(body, mesh):
    """Pairs (node, component) that do not move: of the slab's held sides, and of held tips."""
    slab = np.ones(3 * body.slab.nodes, dtype=bool)
    slab[body.slab.free] = False
    node, component = np.divmod(np.flatnonzero(slab), 3)
    free = np.zeros(3 * body.support.nodes, dtype=bool)
    free[body.support.inner], free[body.support.root_dofs] = True, True
    local, axis = np.divmod(np.flatnonzero(~free), 3)
    pairs = np.vstack([np.column_stack([mesh.slab[node], component]),
                       np.column_stack([mesh.frusta[:, local].ravel(), np.tile(axis, body.support.count)])])
    return pairs[pairs[:, 0] >= 0]


def _surfaces(body, mesh):
    """Faces that may touch something: the slab's top, and per frustum its tip and its sides."""
    support = body.support
    mesh_2d = Mesh2D(support.mesh.points[:, :2], support.mesh.layer(0)[:, HEX27.bottom], 0)
    quads, sides = mesh_2d.outer_sides()
    elements = mesh.parts[-1].elements.reshape(support.count, support.mesh.layers, -1)
    tips, around = _faces(elements[:, 0], BOTTOM), _faces(elements[:, :, quads], FIRST_SIDE + sides)
    surfaces = {"TOP": _top_faces(body, mesh.parts), "FRUSTA_TIPS": tips, "FRUSTA_SIDES": around,
                "FRUSTA_FOOT": np.vstack([tips, around])}
    if support.count > 1 and support.geometry.neighbours.any():
        odd = _odd(support.geometry.centres)
        surfaces["FRUSTA_SIDES_EVEN"] = _faces(elements[~odd][:, :, quads], FIRST_SIDE + sides)
        surfaces["FRUSTA_SIDES_ODD"] = _faces(elements[odd][:, :, quads], FIRST_SIDE + sides)
    return surfaces


def _top_faces(body, parts):
    """The uppermost elements' upper faces: the cover's, or the sheet's where there is no cover."""
    part = parts[-2]
    if part.name == "COVER":
        return _faces(part.hex_elements[-len(body.slab.cover_mesh.top):], TOP)
    layers, numbers = body.slab.sheet_mesh.layers, (part.hex_elements, part.wedge_elements)
    return _faces(np.concatenate([kind[len(kind) - len(kind) // layers:] for kind in numbers]), TOP)


def _faces(elements, face):
    """Pairs (f, 2) of element and face; `face` one for all, or one for each along the last axis of `elements`."""
    elements = np.asarray(elements)
    return np.column_stack([elements.ravel(), np.broadcast_to(face, elements.shape).ravel()])


def _odd(centres):
    """Whether frusta (f,) are the black squares of a chessboard pattern: the neighbours of a black one are white."""
    index = [np.unique(np.round(axis, 6), return_inverse=True)[1].ravel() for axis in centres.T]
    return (index[0] + index[1]) % 2 == 1


def _object(body, surface):
    """The object's facets that face down, lie over the slab and within the sensor's thickness of the lowest, without slivers."""
    lowest = surface.triangles[..., 2].min(axis=1) if len(surface.triangles) else np.zeros(0)
    footprint = [2 * max(abs(lines[0]), abs(lines[-1])) for lines in (body.slab.x_lines, body.slab.y_lines)]
    reach = -body.support.coordinates[..., 2].min()
    near = facets_over(surface.triangles, footprint) & (lowest <= lowest.min(initial=np.inf) + reach)
    near &= _widths(surface.triangles) > SLIVER_MM
    if not near.any():
        raise MissError("The object misses the sensor: none of its facets that face down lies over it; correct its pose.")
    points, facets = np.unique(surface.triangles[near].reshape(-1, 3), axis=0, return_inverse=True)
    return RigidSurface("OBJECT", points, facets.reshape(-1, 3), moves=True)


def _widths(triangles):
    """Smallest height (n,) in mm of triangles (n, 3, 3)."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return double_area / np.linalg.norm(sides, axis=2).max(axis=1, initial=1e-300)


def _rectangle(name, corners):
    return RigidSurface(name, np.asarray(corners, dtype=float), np.array([[0, 1, 2], [0, 2, 3]]), moves=False)


def _board(body):
    """The PCB under the longest frustum."""
    (x0, x1), (y0, y1) = ((lines[0] - _BOARD_MARGIN_MM, lines[-1] + _BOARD_MARGIN_MM)
                          for lines in (body.slab.x_lines, body.slab.y_lines))
    z = body.support.coordinates[..., 2].min()
    return _rectangle("BOARD", [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])


def _contacts(body):
    return [SurfacePair("OBJECT_ON_TOP", "TOP", "OBJECT", body.slab.top.contact, body.slab.top.friction),
            SurfacePair("FRUSTA_ON_BOARD", "FRUSTA_FOOT", "BOARD", body.support.contact, body.support.friction)]


def _walls(body):
    """Planes of symmetry towards neighbours that are not modelled (unit cell); None where all are modelled."""
    support = body.support
    if support.count > 1 or not support.geometry.neighbours.any():
        return None
    bottom, top = support.coordinates[..., 2].min() - 0.1, support.coordinates[..., 2].max()
    half = 0.5 * support.geometry.root_diameter + support.geometry.wall_mm
    reach = 2 * half
    points, facets = [], []
    for k, (axis, sign) in enumerate(DIRECTIONS):
        if not support.geometry.neighbours[0, k]:
            continue
        corners = np.zeros((4, 3))
        corners[:, axis] = support.geometry.centres[0, axis] + sign * half
        corners[:, 1 - axis] = support.geometry.centres[0, 1 - axis] + reach * np.array([-1, -1, 1, 1])
        corners[:, 2] = [bottom, top, top, bottom]
        if np.cross(corners[1] - corners[0], corners[2] - corners[0])[axis] * sign > 0:   # the normal points at the frustum
            corners = corners[::-1]
        facets += (4 * len(points) + np.array([[0, 1, 2], [0, 2, 3]])).tolist()
        points.append(corners)
    return RigidSurface("WALLS", np.vstack(points), np.array(facets), moves=False)


def _steps(body, surface, forces_n, indentations_mm, touch_mm):
    if (forces_n is None) == (indentations_mm is None):
        raise ValueError("give either forces_n or indentations_mm")
    if forces_n is None:
        depths = np.atleast_1d(indentations_mm)
        return [ObjectStep(f"INDENTATION_{k + 1}", "indentation", float(depth)) for k, depth in enumerate(depths)]
    clearance = body.slab.project(body.rest()[0], surface).anchors[:, 2].min()
    if clearance >= NO_CONTACT_MM:
        raise InputError("The object lies over no contact point of the cover; correct its pose or refine the mesh.")
    touch = ObjectStep("TOUCH", "indentation", float(clearance + touch_mm))
    return [touch] + [ObjectStep(f"FORCE_{k + 1}", "force", float(force)) for k, force in enumerate(np.atleast_1d(forces_n))]


def _remarks(body):
    block = body.support.block
    functions = "trilinear" if block.at_rest.basis.shape[1] > 4 else "linear"
    share = f"{block.unprojected_modulus / block.law.bulk_modulus:.2g}"
    return ("units: mm, N, MPa",
            "*EQUATION: the sheet's upper nodes follow the cover's lower side; where walls between cells are coarse, nodes at "
            "their quarters follow the curve through the corner, the middle and the next corner; small elements of the "
            "cover follow larger ones' faces.",
            "Contacts: object on the top, frusta (tip and sides) on the board, frusta on their neighbours. Left out, as in "
            "softtact: the sheet's underside on the frusta's sides, friction of frusta on each other, the object's upper sides. "
            "Left out here alone: the object's steep walls, and the shell that an object wider than the sensor may rest on.",
            f"Facets of the object narrower than {SLIVER_MM} mm are left out.",
            f"softtact lets the share {share} of the frusta's bulk modulus act at every point and projects the rest on "
            f"{functions} functions; these elements have one volumetric energy. Its bricks and "
            "wedges under the cover have nodes in faces and bodies, too.")
