"""A layered body's mesh in elements that CalculiX and Abaqus have: 20-node bricks and 15-node wedges.

Our 27-node bricks and 18-node wedges have nodes in the middle of faces and bodies, too. Without these the element has the same
shape, for its sides are curves through three nodes and its faces are spanned by them. Numbers count from 0.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from softtact.fem.elements import HEX27, WEDGE18
from softtact.models.hyperelastic.body import LayeredBody

_NO_WEIGHT = 1e-10


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

    slab (s,), frusta (f, nodes): the number here of each node of the slab and of each frustum, -1 where it is left out.
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
    own = first + np.arange(support.count * support.nodes).reshape(support.count, support.nodes)
    own[:, support.root] = body.cells.roots
    points = np.vstack([slab.points, slab.cover_mesh.points[hanging], slab.sheet_mesh.points[followers],
                        support.coordinates.reshape(-1, 3)])
    ties = _ties(slab.nodes, hanging, *slab.cover_mesh.masters())
    ties += _ties(slab.nodes + len(hanging), followers, slab.sheet_nodes.masters, slab.sheet_nodes.weights)
    number = _numbers_in_use([sheet[_hexes(slab.sheet_mesh)], sheet[_wedges(slab.sheet_mesh)], cover,
                              own[:, _hexes(support.mesh)], *(tie.masters for tie in ties)], len(points))
    ties = [Tie(int(number[tie.slave]), number[tie.masters], tie.weights) for tie in ties if number[tie.slave] >= 0]
    frusta = number[own]
    return BodyMesh(points[number >= 0], _parts(body, number[sheet], number[cover], frusta), ties, number[:slab.nodes], frusta)


def _hexes(mesh):
    return mesh.hexes[:, HEX27.abaqus_nodes]


def _wedges(mesh):
    return mesh.wedges[:, WEDGE18.abaqus_nodes]


def _cover_numbers(slab):
    """Nodes of the cover's hexahedra (e, 20), and which of its points follow others: those are numbered after the slab's own."""
    mesh = slab.cover_mesh
    hexes = np.where(mesh.hexes < mesh.free, mesh.hexes, slab.nodes + mesh.hexes - mesh.free)
    return hexes, np.arange(mesh.free, len(mesh.points))


def _sheet_numbers(slab, first_follower):
    """Number of each node of the sheet's mesh, and which of them follow others, numbered from `first_follower` on.

    A node that follows one other with weight 1 is that one.
    """
    masters, weights = slab.sheet_nodes.masters, slab.sheet_nodes.weights
    first = np.argmax(weights, axis=1)
    rows = np.arange(len(masters))
    followers = np.flatnonzero(np.abs(weights[rows, first] - 1) > _NO_WEIGHT)
    sheet = masters[rows, first]
    sheet[followers] = first_follower + np.arange(len(followers))
    return sheet, followers


def _ties(first, followers, masters, weights):
    """What followers, numbered from `first` on, follow: larger elements of the cover; its lower side; curves along coarse walls."""
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
