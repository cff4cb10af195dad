"""Sheet and cover as one slab over the frusta, with the contact of a rigid object on its top (`TopContact`).

The sheet's mesh conforms with the frusta's roots. The cover's hexahedra are independent of the frusta and may be coarser along x
and y: the nodes below are tied to its lower side. At the interface of sheet and cover the displacement still varies from frustum to
frustum, so such a tie changes the map by several per cent; therefore the cover's lowest layers can share the sheet's 2-D mesh.
`SheetNodes` relates the sheet's nodes to the slab's, `CoverSide` is a side of the cover to which nodes are tied."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from softtact.contact.friction import Coulomb
from softtact.contact.penalty import Contact
from softtact.fem.assembly import add_upper, upper_pattern, upper_positions
from softtact.fem.elements import HEX20, QUAD8
from softtact.fem.extruded_mesh import HexMesh, SheetMesh2D, extrude, interpolation_2d
from softtact.fem.graded_mesh import CoverMesh, cover_mesh
from softtact.fem.kernels import add_forces
from softtact.fem.quadrature import densest_rule, lobatto_gauss_rule
from softtact.fem.solid_block import HexBlock, SolidBlock, WedgeBlock, hanging_node_constraints, joined
from softtact.fem.static_condensation import make_positive
from softtact.linalg.symmetric_product import SymmetricProduct
from softtact.linalg.workers import SERIAL, Workers, chunks
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.rigid_contact import TopContact
from softtact.models.hyperelastic.states import ContactHistory, ContactProjection, LinearGaps, ObjectSurface, SlabState

_NO_WEIGHT = 1e-12
# Rules of the cover's elements: one that may fold; with points at corners, too; with all points where `CoverMesh` looks for folds.
_COVER_RULES = (HEX20.reduced, lobatto_gauss_rule(3), densest_rule(3))
_FOLDING_PENALTY_RATIO = 100.0     # quartic modulus over mu of a cover that resists folding, as of the frusta by default
_AT_ONCE = 8     # elements whose tangents one thread makes positive at once; indefinite ones are often neighbours


@dataclass(frozen=True)
class SheetNodes:
    """Nodes (p,) of the sheet's mesh among those of a slab. The mesh's top is tied to the cover, the rest has separate unknowns.

    masters (p, w), weights (p, w): the slab's nodes that determine each node; unused entries have weight 0
    own (k,): the nodes that are not constrained;  number (p,): the slab's number of each of these, -1 for the others
    """

    masters: np.ndarray
    weights: np.ndarray
    own: np.ndarray
    number: np.ndarray

    def like_cells(self, cells: np.ndarray) -> list[np.ndarray]:
        """Numbers of like cells, kind by kind, of cells with nodes (c, k): those with the same pattern of constraints."""
        used = np.abs(self.weights) > _NO_WEIGHT
        kinds: dict[bytes, list[int]] = {}
        for number, cell in enumerate(cells):
            _, local = np.unique(np.where(used[cell], self.masters[cell], -1), return_inverse=True)
            signature = local.tobytes() + np.round(self.weights[cell] * used[cell], 9).tobytes()
            kinds.setdefault(signature, []).append(number)
        return [np.array(numbers) for numbers in kinds.values()]


def sheet_nodes(mesh: HexMesh, sheet_2d: SheetMesh2D, *, first: int, above: sp.csr_matrix,
                constrained: bool | np.ndarray | Callable[[np.ndarray], np.ndarray]) -> SheetNodes:
    """`SheetNodes` of the sheet's mesh, extruded from a `SheetMesh2D`.

    first: number of the first node that is not the cover's;  above (plane's points, cover's nodes): tie of its top to the cover
    constrained: constrained cell edges: everywhere (True), nowhere, or where a function of places (n, 2) returns True

    Along such an edge of two elements the sheet moves as one quadratic curve: the nodes at the quarter points are determined by the
    corner, the middle and the next corner. (Free quarter points: 50 % more unknowns, and 1 % softer.)
    """
    top, planes = mesh.planes[-1], mesh.inner_planes
    curve, curve_weights = sheet_2d.quarters
    if callable(constrained):
        constrained = constrained(sheet_2d.mesh_2d.points[curve[:, 0]])
    curve = curve[np.broadcast_to(constrained, len(curve))]
    follows = np.zeros(len(mesh.points), dtype=bool)
    follows[top] = True
    follows[planes[:, curve[:, 0]]] = True
    own = np.flatnonzero(~follows)
    number = np.full(len(mesh.points), -1, dtype=np.int64)
    number[own] = first + np.arange(len(own))
    width = max(int(np.diff(above.indptr).max()), 3)
    masters, weights = np.zeros((len(mesh.points), width), dtype=np.int64), np.zeros((len(mesh.points), width))
    masters[own, 0], weights[own, 0] = number[own], 1.0
    row = np.repeat(np.arange(len(top)), np.diff(above.indptr))
    place = np.arange(above.nnz) - above.indptr[row]
    masters[top[row], place], weights[top[row], place] = above.indices, above.data
    for plane in planes:
        masters[plane[curve[:, 0]], :3] = number[plane[curve[:, 1:]]]
        weights[plane[curve[:, 0]], :3] = curve_weights
    return SheetNodes(masters, weights, own, number)


class CoverSide:
    """The lower or the upper side of a `CoverMesh` between grid lines (mm)."""

    def __init__(self, mesh: CoverMesh, faces: np.ndarray, cells: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray) -> None:
        """faces (t, 8): of the side;  cells (ny 2^m, nx 2^m): index of the face on each cell of the finest grid"""
        self._mesh, self._faces, self._cells, self._lines = mesh, faces, cells, (x_lines, y_lines)

    def locate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Faces (p,) of the side and shape values (p, 8) at points (p, 2); points on a line belong to the lower face."""
        cells = self._cells
        fine = cells.shape[0] // (len(self._lines[1]) - 1)
        i, j = (_place(value, lines, fine) for value, lines in zip(points.T, self._lines, strict=True))
        faces = cells[j, i]
        low, _, high, _ = self._mesh.points[self._faces[faces, :4], :2].transpose(1, 0, 2)
        return faces, QUAD8.shape(2 * (points - low) / (high - low) - 1)[0]

    def interpolation(self, points: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix (p, free nodes of the cover) that interpolates on the side at points (p, 2)."""
        mesh, (faces, values) = self._mesh, self.locate(points)
        rows = np.repeat(np.arange(len(points)), 8)
        all_nodes = sp.csr_matrix((values.ravel(), (rows, self._faces[faces].ravel())), shape=(len(points), len(mesh.points)))
        return without_zeros(all_nodes @ mesh.follow)


def _place(value, lines, fine):
    """Index of the interval that contains each value (p,), for intervals between lines cut into `fine` equal parts."""
    grid = np.interp(np.arange(fine * (len(lines) - 1) + 1), fine * np.arange(len(lines)), lines)
    return np.clip(np.searchsorted(grid, value - 1e-9) - 1, 0, len(grid) - 2)


def without_zeros(matrix: sp.spmatrix) -> sp.csr_matrix:
    """A sparse matrix as csr without entries that are zero to rounding."""
    matrix.data[np.abs(matrix.data) < _NO_WEIGHT] = 0.0
    matrix.eliminate_zeros()
    return matrix.tocsr()


@dataclass(frozen=True)
class Layer:
    """One material's layer: increasing heights z of its element layers (mm), and its law."""

    heights: np.ndarray
    law: Law | None


@dataclass(frozen=True)
class SlabMesh:
    """The mesh of a slab along x and y."""

    mesh_2d: SheetMesh2D
    """Of the sheet."""
    x_lines: np.ndarray
    """Coordinates x in mm of the cover's grid lines."""
    y_lines: np.ndarray
    """Coordinates y in mm of the cover's grid lines."""
    splits: np.ndarray | None = None
    """(layers, ny 2^m, nx 2^m): split depths of the cover's uppermost layers (see `cover_mesh`); the layers below these share
    the sheet's 2-D mesh. None: all layers are on the grid, and none is split."""
    constrained_cell_edges: bool | Callable[[np.ndarray], np.ndarray] = True
    """Constrained cell edges: everywhere, nowhere, or where a function of places (n, 2) returns (n,) True."""


@dataclass(frozen=True)
class CellGroup:
    """Cells (c,) of the sheet under like parts of the cover.

    layers: for each layer from below its elements: nodes (c * elements, w), cell by cell, and their block
    """

    cells: np.ndarray
    layers: list

    @property
    def parts(self) -> list[tuple[np.ndarray, SolidBlock]]:
        """Nodes and blocks of all layers."""
        return [part for layer in self.layers for part in layer]


class Slab:
    """Sheet on a `SheetMesh2D` under a cover on a grid; a cover with a single height is the sheet's top without a cover.

    sheet_mesh: the sheet (`sheet_layers`) and the cover's layers that share its 2-D mesh;  cover_mesh: the cover's other layers
    Nodes: cover_mesh's first, then sheet_mesh's without its top. `bottom`: nodes under the sheet in the 2-D mesh's order.
    sheet_nodes: `SheetNodes`, the constraints of sheet_mesh's nodes;  underside: of the cover, to which the sheet's top is tied
    """

    regions = ("sheet", "cover")     # of the deformed mesh that the two parts belong to
    groups: list[tuple[np.ndarray, SolidBlock]]
    cell_groups: list[CellGroup]

    def __init__(self, sheet: Layer, cover: Layer, mesh: SlabMesh, *, sides: str, contact: Contact,
                 quartic_penalty_ratio: float = 0.0, friction: Coulomb | None = None, held_below_mm: float = 0.0) -> None:
        """quartic_penalty_ratio: see `solid_block`;  friction: `Coulomb` of the object on the top, or None

        held_below_mm: depth below the top, one of the layers' heights, from which `held` sides are fixed
        """
        x_lines, y_lines, splits, sheet_mesh_2d = mesh.x_lines, mesh.y_lines, mesh.splits, mesh.mesh_2d
        if splits is None:
            splits = np.zeros((len(cover.heights) - 1, len(y_lines) - 1, len(x_lines) - 1), dtype=np.int64)
        self.x_lines, self.y_lines = np.asarray(x_lines), np.asarray(y_lines)
        self.layers, self.sheet_mesh_2d = (sheet, cover), sheet_mesh_2d
        bound = len(cover.heights) - 1 - len(splits)
        self.cover_mesh = cover_mesh(x_lines, y_lines, cover.heights[bound:], splits)
        self.sheet_mesh = extrude(sheet_mesh_2d.mesh_2d, np.append(sheet.heights, cover.heights[1:bound + 1]))
        self.sheet_layers = len(sheet.heights) - 1
        self._quartic_penalty_ratio = quartic_penalty_ratio
        self.underside = CoverSide(self.cover_mesh, self.cover_mesh.bottom, self.cover_mesh.bottom_cells,
                                   self.x_lines, self.y_lines)
        above = self.underside.interpolation(sheet_mesh_2d.mesh_2d.points)
        self.sheet_nodes = sheet_nodes(self.sheet_mesh, sheet_mesh_2d, first=self.cover_mesh.free, above=above,
                                       constrained=mesh.constrained_cell_edges)
        self.points = np.vstack([self.cover_mesh.points[:self.cover_mesh.free], self.sheet_mesh.points[self.sheet_nodes.own]])
        self.nodes = len(self.points)
        self.bottom = self.sheet_nodes.number[self.sheet_mesh.planes[0]]
        self.groups, self.cell_groups = [], []   # (nodes, block) outside of cells; a `CellGroup` for each kind of cell
        self._cover_law, self.resists_folding = cover.law, 0
        self._values_at: np.ndarray | None = None     # displacement of the cached values of `_beside_cells`
        self.groups += self._cover_groups()
        self._add_sheet(sheet_mesh_2d, [sheet.law] * self.sheet_layers + [cover.law] * bound)
        self._joined = joined(self.solids)     # evaluating a hundred small blocks takes twice as long
        self._number_unknowns(sides, held_below_mm)
        pressed = cover.law or sheet.law     # None in bodies at rest, of which only the mesh is wanted
        self.top = TopContact(self.cover_mesh, contact, plane_modulus=pressed.plane_modulus if pressed else np.inf,
                              friction=friction)

    @cached_property
    def uses(self) -> np.ndarray:
        """Number (n,) of cells, groups of other elements and top faces that contain each node; 1: inside one cell."""
        cells = [np.unique(np.hstack([nodes.reshape(len(group.cells), -1) for nodes, _ in group.parts])[k])
                 for group in self.cell_groups for k in range(len(group.cells))]
        others = [np.unique(nodes) for nodes, _ in self.groups] + [np.unique(self.top.faces)]
        return np.bincount(np.concatenate([*cells, *others]), minlength=self.nodes)

    def _cover_groups(self):
        """Groups of the cover's elements; those with hanging nodes form separate groups, as they have more master nodes."""
        mesh = self.cover_mesh
        if not len(mesh.hexes):
            return []
        alone = (mesh.hexes < mesh.free).all(axis=1)
        groups = [(mesh.hexes[alone], self._cover_block(mesh.hexes[alone]))]
        if not alone.all():
            hanging = mesh.hexes[~alone]
            groups.append(hanging_node_constraints(*mesh.masters(), hanging, self._cover_block(hanging)))
        return groups

    def _cover_block(self, hexes):
        ratio = max(self._quartic_penalty_ratio, _FOLDING_PENALTY_RATIO if self.resists_folding else 0.0)
        return HexBlock(self.cover_mesh.points[hexes], self._cover_law, rule=_COVER_RULES[self.resists_folding],
                        quartic_penalty_ratio=ratio)

    def resist_folding(self, resists: int) -> None:
        """Give the cover's elements a quartic penalty, and points at which they cannot turn inside out: 1 at their corners and
        between these, 2 at more places between; or undo it (0).

        Under an edge sharper than an element its corners fold, which a rule with eight points inside does not see.
        """
        if resists == self.resists_folding:
            return
        self.resists_folding, loops = resists, self.blocks[0].loops
        groups = self._cover_groups()
        self.groups[:len(groups)] = groups
        self._joined, self._values_at = joined(self.solids), None
        for block in self.blocks:
            block.loops = loops

    def _add_sheet(self, mesh_2d, laws):
        """Like elements (nodes, block): of the strips around the lattice, and of each kind of cell; a law per layer."""
        mesh, cells = self.sheet_mesh, len(mesh_2d.roots)
        in_cells = cells * mesh_2d.cell_quads
        layers = [(mesh.layer(k), mesh.wedge_layer(k), law) for k, law in enumerate(laws)]
        self.groups += [self._following(hexes[in_cells:], HexBlock, law) for hexes, _, law in layers if len(hexes) > in_cells]
        if not cells:
            return
        pieces = [[(hexes[:in_cells].reshape(cells, -1, 27), HexBlock, law), (wedges.reshape(cells, -1, 18), WedgeBlock, law)]
                  for hexes, wedges, law in layers]
        nodes = np.hstack([elements.reshape(cells, -1) for layer in pieces for elements, _, _ in layer])
        for same in self.sheet_nodes.like_cells(nodes):
            self.cell_groups.append(CellGroup(same, [
                [self._following(elements[same].reshape(-1, elements.shape[2]), make, law)
                 for elements, make, law in layer if elements.size] for layer in pieces]))

    def _following(self, elements, make, law):
        block = make(self.sheet_mesh.points[elements], law, quartic_penalty_ratio=self._quartic_penalty_ratio)
        return hanging_node_constraints(self.sheet_nodes.masters, self.sheet_nodes.weights, elements, block)

    @property
    def solids(self) -> list[tuple[np.ndarray, SolidBlock]]:
        """All elements with their nodes: [(nodes (e, w), block)]."""
        return self.groups + [part for group in self.cell_groups for part in group.parts]

    @property
    def blocks(self) -> list[SolidBlock]:
        """All blocks of elements: those of `solids`, and the same joined."""
        return [block for _, block in self.solids + self._joined]

    def _number_unknowns(self, sides, held_below_mm):
        """Free unknowns: all except on the sides, which are `held` (sensor shell), `symmetric` (unit cell) or `free`."""
        x, y, z = self.points.T
        on_x = (np.abs(x - self.x_lines[0]) < 1e-9) | (np.abs(x - self.x_lines[-1]) < 1e-9)
        on_y = (np.abs(y - self.y_lines[0]) < 1e-9) | (np.abs(y - self.y_lines[-1]) < 1e-9)
        held = np.zeros((self.nodes, 3), dtype=bool)
        if sides == "held":
            held[(on_x | on_y) & (z <= 1e-9 - held_below_mm)] = True
        elif sides == "symmetric":
            held[on_x, 0] = held[on_y, 1] = True
        elif sides != "free":
            raise ValueError(f"sides must be 'held', 'symmetric' or 'free', not {sides!r}")
        self.free = np.flatnonzero(~held.ravel())

    def hold(self, nodes: np.ndarray) -> None:
        """Fix nodes (k,) in all directions; to be called before `build_pattern`."""
        dofs = (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()
        self.free = np.setdiff1d(self.free, dofs)

    def project(self, displacement: np.ndarray, surface: ObjectSurface, indentation: float | None = None) -> ContactProjection:
        """The `ContactProjection` of the top's points on the object."""
        return self.top.project(displacement, surface, indentation)

    def evaluate(self, displacement: np.ndarray, projection: ContactProjection, indentation: float,
                 history: ContactHistory | None = None, *, workers: Workers = SERIAL) -> SlabState | None:
        """Energy, forces and contact with the object `indentation` mm below its pose; None if an element is inverted.

        history: of the contact, by default none
        """
        force = np.zeros((self.nodes, 3))
        energy = 0.0
        for nodes, block in self._joined:
            state = block.evaluate(displacement[nodes], workers=workers)
            if state is None:
                return None
            energy += state.energy
            add_forces(force, nodes, state.force.reshape(*nodes.shape, 3))
        return self._with_contact(displacement, (energy, force), projection, indentation, history or self.top.fresh_history())

    def update_normals(self, state: SlabState, projection: ContactProjection, indentation: float,
                       history: ContactHistory | None = None) -> SlabState:
        """The state with another contact projection, and with another history of the contact if one is given."""
        return self._with_contact(state.displacement, state.elastic, projection, indentation, history or state.history)

    def _with_contact(self, displacement, elastic, projection, indentation, history):
        energy, force = elastic[0], elastic[1].copy()
        touch = self.top.touch(displacement, projection, indentation, history)
        add_forces(force, self.top.faces, touch.force.reshape(*self.top.faces.shape, 3))
        return SlabState(elastic=elastic, energy=energy + touch.energy, force=force, gaps=touch.gaps, projection=projection,
                         displacement=displacement, indentation_force=touch.indentation_force, history=history,
                         friction_response=touch.friction_response)

    def build_pattern(self, eliminated: np.ndarray, cells: list[np.ndarray], *, precision: type[np.floating] = np.float32) -> None:
        """Build the global matrix' pattern without the `eliminated` unknowns; cells [(c, k)]: unknowns that cells leave.

        precision: of its values; single is enough for steps that are corrected by a residual in double precision
        """
        keep = np.setdiff1d(self.free, eliminated)
        self.unknowns = keep
        number = np.full(3 * self.nodes, -1, dtype=np.int64)
        number[keep] = np.arange(len(keep))
        *groups, top = [(3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)
                        for nodes in [*(nodes for nodes, _ in self.groups), self.top.faces]]
        self._number = number.reshape(-1, 3)
        members, self._top_dofs = [np.ascontiguousarray(number[dofs]) for dofs in [*groups, *cells]], number[top]
        indptr, indices = upper_pattern([*members, self._top_dofs], len(keep))
        self._positions = [upper_positions(indptr, indices, dofs) for dofs in members]
        self._top_positions = upper_positions(indptr, indices, self._top_dofs)
        self._matrix = sp.csr_matrix((np.zeros(len(indices), dtype=precision), indices, indptr), shape=(len(keep),) * 2)
        self.product = SymmetricProduct(indptr, indices)
        self._values_at = None
        self._values: dict[bool, np.ndarray] = {}

    def tangent(self, state: SlabState, condensed: list[np.ndarray], *, workers: Workers = SERIAL) -> sp.csr_matrix:
        """Upper triangle (csr) of the tangent with the cells' condensed blocks [(f, k, k)] and the object's contact."""
        whole, shapes = self.rubber_tangent(state, condensed, workers=workers).copy(), self.top.normal_shapes(state.projection)
        weighted = shapes * self.top.stiffness(state).reshape(len(shapes), -1, 1)
        add_upper(whole.data, np.matmul(weighted.transpose(0, 2, 1), shapes), self._top_positions)
        return whole

    def rubber_tangent(self, state: SlabState, condensed: list[np.ndarray], *, positive: float = 0.0,
                       workers: Workers = SERIAL) -> sp.csr_matrix:
        """Upper triangle (csr) of the tangent with friction, but without the object's pressure; valid until the next call.

        positive: share of the elements' modes of negative stiffness that is made positive
        """
        matrix = self._matrix
        matrix.data[:] = self._beside_cells(state.displacement, False, workers)
        if positive:
            matrix.data += positive * (self._beside_cells(state.displacement, True, workers) - matrix.data)
        for part, positions in zip(condensed, self._positions[len(self.groups):], strict=True):
            add_upper(matrix.data, part, positions)
        if state.friction_response is not None:
            add_upper(matrix.data, self.top.friction_tangent(state)[0], self._top_positions)
        return matrix

    def _beside_cells(self, displacement, positive, workers):
        """Contribution of elements outside of cells to the matrix' values, cached for several tangents of one step."""
        if self._values_at is not displacement:
            self._values_at, self._values = displacement, {}
        if positive not in self._values:
            values = np.zeros_like(self._matrix.data)
            blocks = workers.map(lambda group: group[1].tangent(displacement[group[0]], precision=values.dtype.type), self.groups)
            if positive:
                workers.map(make_positive, [part for block in blocks for part in chunks(block, _AT_ONCE)])
            for block, positions in zip(blocks, self._positions, strict=False):
                add_upper(values, block, positions)
            self._values[positive] = values
        return self._values[positive]

    def linear_gaps(self, displacement: np.ndarray, projection: ContactProjection, indentation: float,
                    history: ContactHistory) -> LinearGaps:
        """The `LinearGaps` of the object's contact points for a step of the global unknowns."""
        shapes, gaps = self.top.normal_shapes(projection), self.top.gaps(displacement, projection, indentation)
        covered = projection.covered.reshape(*shapes.shape[:2], 1) > 0
        free = np.broadcast_to((self._top_dofs[:, None] >= 0) & covered, shapes.shape)
        points = np.broadcast_to(np.arange(len(gaps)).reshape(*shapes.shape[:2], 1), shapes.shape)[free]
        columns = np.broadcast_to(self._top_dofs[:, None], shapes.shape)[free]
        rows = sp.csr_matrix((shapes[free], (points, columns)), shape=(len(gaps), len(self.unknowns)))
        return LinearGaps(gaps=gaps, rows=rows, indentation_increment=projection.normals[:, 2],
                          area=self.top.area * projection.covered, contact=self.top.contact_on(projection, history))

    def unknowns_of(self, nodes: np.ndarray) -> np.ndarray:
        """The global matrix' unknowns (k, 3) of nodes (k,), -1 where a component is not an unknown."""
        return self._number[nodes]

    def friction_border(self, state: SlabState) -> tuple[np.ndarray, float]:
        """Friction's coupling to the indentation: derivatives by it of the residual (unknowns,) and of the object's force."""
        if state.friction_response is None:
            return np.zeros(len(self.unknowns)), 0.0
        _, of_faces, corner = self.top.friction_tangent(state)
        border, here = np.zeros(len(self.unknowns)), self._top_dofs >= 0
        np.add.at(border, self._top_dofs[here], of_faces[here])
        return border, corner

    @staticmethod
    def add_to_diagonal(matrix: sp.csr_matrix, value: float) -> None:
        """Add `value` (N/mm) to each diagonal entry of an upper triangle."""
        matrix.data[matrix.indptr[:-1]] += value   # sorted upper triangle: each row begins with its diagonal

    def sampling(self, points: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix (p, nodes) that interpolates a nodal field of the plane between sheet and cover at points (p, 2)."""
        if self.sheet_layers == self.sheet_mesh.layers:
            at = self.underside.interpolation(points)
            at.resize(len(points), self.nodes)
            return at
        plane = self.sheet_mesh.planes[self.sheet_layers]
        masters, weights = self.sheet_nodes.masters[plane], self.sheet_nodes.weights[plane]
        rows = np.repeat(np.arange(len(plane)), masters.shape[1])
        own = sp.csr_matrix((weights.ravel(), (rows, masters.ravel())), shape=(len(plane), self.nodes))
        return without_zeros(interpolation_2d(self.sheet_mesh_2d.mesh_2d, points) @ own)

    @property
    def interface_nodes(self) -> np.ndarray:
        """Free nodes (n,) of the plane between sheet and cover."""
        if self.sheet_layers == self.sheet_mesh.layers:
            return self.cover_mesh.bottom_nodes
        plane = self.sheet_mesh.planes[self.sheet_layers]
        return np.unique(self.sheet_nodes.masters[plane][np.abs(self.sheet_nodes.weights[plane]) > 1e-12])
