"""A press as any finite-element program understands it: nodes, elements, laws, constraints, surfaces, contacts and steps.

Nothing here is written in a program's dialect. Numbers count from 0; the writers add 1. Lengths in mm, forces in N, stresses
in MPa.
"""

from dataclasses import dataclass

import numpy as np

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import InputError
from softtact.geometry.meshes import facets_over
from softtact.mechanics.frustum_bed import DIRECTIONS, ContactSettings

BOTTOM, TOP, OUTER = 1, 2, 4      # faces S1, S2 and S4 (xi = 1) of a 20-node hexahedron, in Abaqus and in CalculiX alike
TOUCH_MM = 0.01                   # overlap of object and cover after the first step: a force alone holds no free object
SLIVER_MM = 0.01                  # narrower facets are left out: the contact search of CalculiX does not end on them
_NO_WEIGHT = 1e-10
_BOARD_MARGIN_MM = 1.0


@dataclass(frozen=True)
class Part:
    """Hexahedra of one law: `elements` (e,) their numbers, `hexes` (e, 20) their nodes, `nodes` all of these once."""

    name: str
    elements: np.ndarray
    hexes: np.ndarray
    law: object

    @property
    def nodes(self):
        return np.unique(self.hexes)


@dataclass(frozen=True)
class Tie:
    """Every component of the displacement of node `slave` is sum(weights * the masters')."""

    slave: int
    masters: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class RigidSurface:
    """Rigid triangles: points (n, 3), facets (m, 3) whose normals point at the rubber; `moves` along z, or stands still."""

    name: str
    points: np.ndarray
    facets: np.ndarray
    moves: bool


@dataclass(frozen=True)
class ContactPair:
    """Surface `slave` may not pass surface `master` (a rigid one or one of a part), without friction.

    `contact`: the penalty's stiffness (N/mm3) and smoothing depth (mm).
    """

    name: str
    slave: str
    master: str
    contact: ContactSettings


@dataclass(frozen=True)
class Step:
    """The object is lowered to `value` mm (`control` "indentation") or pushed with `value` N ("force")."""

    name: str
    control: str
    value: float


@dataclass(frozen=True)
class DeckModel:
    """A press: points (n, 3) of the rubber, `held` (h, 2) pairs of node and component 0..2, named node sets and surfaces.

    surfaces: {name: (f, 2) element and face number S1..S6}
    remarks: sentences that every deck carries as comments
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


def deck_model(body, placed, *, forces_n=None, indentations_mm=None, title="press", touch_mm=TOUCH_MM):
    """The press of a placed mesh (trimesh, mm) on a `LayeredBody` as a `DeckModel`.

    Either `forces_n` (N, increasing), after a first step that lowers the object until it overlaps by `touch_mm`, or
    `indentations_mm` (increasing), which the object follows.
    """
    surface = HeightField(placed)
    offset = body.slab.nodes
    frusta = body.bed.mesh.hexes[None] + offset + np.arange(body.bed.count)[:, None, None] * body.bed.nodes
    parts = _parts(body, frusta)
    surfaces = _surfaces(body, parts)
    rigid, contacts = [_object(body, surface), _board(body)], _contacts(body)
    if "FRUSTA_SIDES_ODD" in surfaces:
        contacts.append(ContactPair("NEIGHBOURS", "FRUSTA_SIDES_EVEN", "FRUSTA_SIDES_ODD", body.bed.contact))
    walls = _walls(body)
    if walls is not None:
        rigid.append(walls)
        contacts.append(ContactPair("WALLS", "FRUSTA_SIDES", "WALLS", body.bed.contact))
    ties = without_chains(_tied_roots(body))
    held = _held(body)
    interface = body.slab.mesh.planes[min(body.electrode_plane, body.slab.mesh.layers)]
    node_sets = {part.name: part.nodes for part in parts}
    node_sets |= {"INTERFACE": interface, "TIPS": (offset + _frustum_nodes(body, body.bed.tip)).ravel(),
                  "TIED": np.array(sorted(tie.slave for tie in ties), dtype=int), "HELD": np.unique(held[:, 0])}
    return DeckModel(title=title, points=np.vstack([body.slab.mesh.points, body.bed.coordinates.reshape(-1, 3)]), parts=parts,
                     ties=ties, held=held, node_sets=node_sets, surfaces=surfaces, rigid=rigid, contacts=contacts,
                     steps=_steps(body, surface, forces_n, indentations_mm, touch_mm), remarks=_remarks(body))


def _parts(body, frusta):
    """Sheet and cover by the slab's layers, then the frusta."""
    mesh, laws = body.slab.mesh, _layer_laws(body.slab)
    per_layer = len(mesh.hexes) // mesh.layers
    cut = min(body.electrode_plane, mesh.layers)
    parts = []
    for name, layers in (("SHEET", range(cut)), ("COVER", range(cut, mesh.layers))):
        if len(layers):
            elements = np.arange(layers[0] * per_layer, (layers[-1] + 1) * per_layer)
            parts.append(Part(name, elements, mesh.hexes[elements], laws[layers[0]]))
    count = body.bed.count * len(body.bed.mesh.hexes)
    parts.append(Part("FRUSTA", len(mesh.hexes) + np.arange(count), frusta.reshape(-1, 20), body.bed.block.law))
    return parts


def _layer_laws(slab):
    """The law of each element layer, from below."""
    per_layer = len(slab.mesh.hexes) // slab.mesh.layers
    return [block.law for hexes, block in slab.blocks for _ in range(len(hexes) // per_layer)]


def _frustum_nodes(body, local):
    """Numbers (f, k) of local nodes (k,) of every frustum, counted from the first frustum's first node."""
    return np.arange(body.bed.count)[:, None] * body.bed.nodes + np.asarray(local)


def _tied_roots(body):
    """The frusta's root nodes follow the sheet's lower side."""
    slaves = body.slab.nodes + _frustum_nodes(body, body.bed.root)
    ties = []
    for own, nodes, weights in zip(slaves, body.tie_nodes, body.tie_weights, strict=True):
        for slave, row in zip(own, weights, strict=True):
            used = np.abs(row) > _NO_WEIGHT
            ties.append(Tie(int(slave), nodes[used], row[used]))
    return ties


def without_chains(ties):
    """The same ties where no master is itself tied: both programs remove the slave's unknowns and refuse chains."""
    by_slave = {tie.slave: tie for tie in ties}

    def ends(tie, depth=0):
        if depth > len(by_slave):
            raise ValueError(f"node {tie.slave} is tied to itself")
        total = {}
        for master, weight in zip(tie.masters.tolist(), tie.weights.tolist(), strict=True):
            inner = ends(by_slave[master], depth + 1) if master in by_slave else {master: 1.0}
            for node, share in inner.items():
                total[node] = total.get(node, 0.0) + weight * share
        return total

    out = []
    for tie in ties:
        total = ends(tie)
        out.append(Tie(tie.slave, np.array(list(total), dtype=int), np.array(list(total.values()))))
    return out


def _held(body):
    """Pairs (node, component) that do not move: the slab's sides as it has them, and held tips."""
    slab = np.ones(3 * body.slab.nodes, dtype=bool)
    slab[body.slab.free] = False
    node, component = np.divmod(np.flatnonzero(slab), 3)
    free = np.zeros(3 * body.bed.nodes, dtype=bool)
    free[body.bed.inner], free[body.bed.root_dofs] = True, True
    local, axis = np.divmod(np.flatnonzero(~free), 3)
    frusta = body.slab.nodes + _frustum_nodes(body, local)
    return np.vstack([np.column_stack([node, component]),
                      np.column_stack([frusta.ravel(), np.tile(axis, body.bed.count)])])


def _surfaces(body, parts):
    """Faces that may touch something: the slab's top, and per frustum its tip and its sides."""
    slab, bed = body.slab.mesh, body.bed
    per_layer = len(slab.hexes) // slab.layers
    local = np.arange(len(bed.mesh.hexes)).reshape(bed.mesh.layers, -1)
    tips = _faces(_frustum_elements(body, local[0]), BOTTOM)
    sides = _frustum_elements(body, local[:, 1:].ravel())       # the first of each layer is the core
    surfaces = {"TOP": _faces(np.arange(len(slab.hexes) - per_layer, len(slab.hexes)), TOP),
                "FRUSTA_TIPS": tips, "FRUSTA_SIDES": _faces(sides, OUTER)}
    surfaces["FRUSTA_FOOT"] = np.vstack([tips, surfaces["FRUSTA_SIDES"]])
    if bed.count > 1 and bed.geometry.neighbours.any():
        odd = _odd(bed.geometry.centres)
        surfaces["FRUSTA_SIDES_EVEN"] = _faces(sides[~odd], OUTER)
        surfaces["FRUSTA_SIDES_ODD"] = _faces(sides[odd], OUTER)
    return surfaces


def _frustum_elements(body, local):
    """Numbers (f, k) of local elements (k,) of every frustum."""
    return len(body.slab.mesh.hexes) + np.arange(body.bed.count)[:, None] * len(body.bed.mesh.hexes) + local


def _faces(elements, face):
    elements = np.asarray(elements).ravel()
    return np.column_stack([elements, np.full(len(elements), face)])


def _odd(centres):
    """Which frusta are the black squares of the chessboard (f,): every neighbour of a black one is white."""
    index = [np.unique(np.round(axis, 6), return_inverse=True)[1].ravel() for axis in centres.T]
    return (index[0] + index[1]) % 2 == 1


def _object(body, surface):
    """The object's facets that look down, lie over the slab and are as near as the sensor is thick, slivers left out."""
    lowest = surface.triangles[..., 2].min(axis=1) if len(surface.triangles) else np.zeros(0)
    footprint = [2 * max(abs(lines[0]), abs(lines[-1])) for lines in (body.slab.x_lines, body.slab.y_lines)]
    reach = -body.bed.coordinates[..., 2].min()
    near = facets_over(surface.triangles, footprint) & (lowest <= lowest.min(initial=np.inf) + reach)
    near &= _widths(surface.triangles) > SLIVER_MM
    if not near.any():
        raise InputError("The object misses the sensor: none of its facets that look down lies over it; correct its pose.")
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
    z = body.bed.coordinates[..., 2].min()
    return _rectangle("BOARD", [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])


def _contacts(body):
    return [ContactPair("OBJECT_ON_TOP", "TOP", "OBJECT", body.slab.contact),
            ContactPair("FRUSTA_ON_BOARD", "FRUSTA_FOOT", "BOARD", body.bed.contact)]


def _walls(body):
    """Planes of symmetry towards neighbours that are not modelled (the unit cell); None where all of them are."""
    bed = body.bed
    if bed.count > 1 or not bed.geometry.neighbours.any():
        return None
    bottom, top = bed.coordinates[..., 2].min() - 0.1, bed.coordinates[..., 2].max()
    reach = bed.geometry.root_diameter
    points, facets = [], []
    for k, (axis, sign) in enumerate(DIRECTIONS):
        if not bed.geometry.neighbours[0, k]:
            continue
        corners = np.zeros((4, 3))
        corners[:, axis] = bed.coordinates[0, bed.root[12 + k], axis]
        corners[:, 1 - axis] = bed.geometry.centres[0, 1 - axis] + reach * np.array([-1, -1, 1, 1])
        corners[:, 2] = [bottom, top, top, bottom]
        if np.cross(corners[1] - corners[0], corners[2] - corners[0])[axis] * sign > 0:   # the normal looks at the frustum
            corners = corners[::-1]
        facets += (4 * len(points) + np.array([[0, 1, 2], [0, 2, 3]])).tolist()
        points.append(corners)
    return RigidSurface("WALLS", np.vstack(points), np.array(facets), moves=False)


def _steps(body, surface, forces_n, indentations_mm, touch_mm):
    if (forces_n is None) == (indentations_mm is None):
        raise ValueError("give either forces_n or indentations_mm")
    if forces_n is None:
        depths = np.atleast_1d(indentations_mm)
        return [Step(f"INDENTATION_{k + 1}", "indentation", float(depth)) for k, depth in enumerate(depths)]
    clearance = body.slab.facing(body.rest()[0], surface).anchors[:, 2].min()
    if clearance >= NO_CONTACT_MM:
        raise InputError("The object is nowhere over a point of the cover that feels contact; correct its pose or refine the mesh.")
    touch = Step("TOUCH", "indentation", float(clearance + touch_mm))
    return [touch] + [Step(f"FORCE_{k + 1}", "force", float(force)) for k, force in enumerate(np.atleast_1d(forces_n))]


def _remarks(body):
    block = body.bed.block
    share = f"{block.local_modulus / block.law.bulk_modulus:.2g}"
    return ("units: mm, N, MPa",
            "Frusta hang on the sheet by *EQUATION: each root node follows the sheet's lower side.",
            "Contacts: object on the top, frusta (tip and sides) on the board, frusta on their neighbours. Left out, as in "
            "softtact: the sheet's underside on the frusta's sides, friction, the object's steep walls and upper sides.",
            f"Facets of the object narrower than {SLIVER_MM} mm are left out.",
            f"softtact lets the share {share} of the frusta's bulk modulus act at every point and projects the rest on linear "
            "functions; these elements have one volumetric energy.")
