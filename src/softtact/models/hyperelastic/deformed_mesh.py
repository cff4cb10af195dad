"""The deformed mesh of the layered body: nodes, cells and displacements for sections and files for ParaView.

Cells are condensed during a press, but every state has the displacements of all nodes, including the frusta's inner ones.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from softtact.fem.elements import HEX20, HEX27, WEDGE18

if TYPE_CHECKING:
    import meshio

    from softtact.models.hyperelastic.body import LayeredBody
    from softtact.models.hyperelastic.states import BodyState

REGIONS = ("frusta", "sheet", "cover")     # from below; their numbers are the cell data `layer`
OBJECT_LAYER = 5                           # the number of a soft object's cells


@dataclass(frozen=True)
class Cells:
    """Like elements: nodes (e, w) in VTK's order, their type by meshio's name, and their region among REGIONS."""

    kind: str
    nodes: np.ndarray
    region: str


@dataclass(frozen=True)
class PressedBody:
    """Sheet, cover and frusta: points_mm (n, 3) at rest, displacement_mm (n, 3) in single precision, cells a tuple of `Cells`.

    In a press of a soft object (model `solid`) the frusta are springs without cells; the object's cells have the region `object`.

    top (t, 8): the cover's upper faces;  pressure_mpa (t,): the object's mean pressure on each, positive in compression

    The sensor's frame: z = 0 is the top at rest, a displacement towards the PCB has a negative z. A frustum's root duplicates nodes
    of the sheet, and the lower side of the cover's part on a grid duplicates points of the mesh below; both move alike.
    """

    points_mm: np.ndarray
    displacement_mm: np.ndarray
    cells: tuple
    top: np.ndarray
    pressure_mpa: np.ndarray

    def to_meshio(self) -> "meshio.Mesh":
        """As a meshio mesh at rest; cell data `layer`: 0 frusta, 1 sheet, 2 cover, 5 a soft object."""
        import meshio

        numbers = {region: number for number, region in enumerate(REGIONS)} | {"object": OBJECT_LAYER}
        layers = [np.full(len(cells.nodes), numbers[cells.region]) for cells in self.cells]
        return meshio.Mesh(self.points_mm, [(cells.kind, cells.nodes) for cells in self.cells], cell_data={"layer": layers})


def pressed_body(body: "LayeredBody", state: "BodyState | None" = None) -> PressedBody:
    """The `PressedBody` of a `LayeredBody` in a `BodyState`, to be taken before the next load step changes the contact; or at
    rest.
    """
    slab, support = (state.slab.displacement, state.support.displacement) if state else body.rest()
    sheet, cover = body.slab.sheet_mesh, body.slab.cover_mesh
    masters, weights = body.slab.sheet_nodes.masters, body.slab.sheet_nodes.weights
    first = np.cumsum([0, len(sheet.points), len(cover.points)])
    cells = (*_frusta(body.support, first[2]), *_on_plan(body.slab), _cells(HEX20, cover.hexes + first[1], body.slab.regions[1]))
    moved = np.vstack([np.einsum("pm,pmd->pd", weights, slab[masters]), cover.follow @ slab[:cover.free], support.reshape(-1, 3)])
    pressure = body.slab.top.pressure_of_faces(state.slab) if state else np.zeros(len(cover.top))
    below = [body.support.coordinates.reshape(-1, 3)] if body.support.count else []     # type: ignore[attr-defined]
    return PressedBody(points_mm=np.vstack([sheet.points, cover.points, *below]),
                       displacement_mm=moved.astype(np.float32), cells=cells, top=cover.top + first[1],
                       pressure_mpa=pressure.astype(np.float32))


def _frusta(support, first):
    """`Cells` of the frusta, whose nodes begin with number `first`; empty without frusta."""
    if support.count:
        hexes = support.mesh.hexes[None] + first + (np.arange(support.count) * support.nodes)[:, None, None]
        yield _cells(HEX27, hexes.reshape(-1, 27), "frusta")


def _on_plan(slab):
    """`Cells` of the sheet, and of the cover's layers that share its 2-D mesh."""
    mesh = slab.sheet_mesh
    for region, layers in zip(slab.regions, (range(slab.sheet_layers), range(slab.sheet_layers, mesh.layers)), strict=True):
        for element, of_layer in ((HEX27, mesh.layer), (WEDGE18, mesh.wedge_layer)):
            nodes = np.vstack([of_layer(k) for k in layers]) if layers else []
            if len(nodes):
                yield _cells(element, nodes, region)


def _cells(element, nodes, region):
    """`Cells` of elements whose nodes (e, w) are in the element's order."""
    return Cells(element.meshio_name, nodes[:, element.vtk_order], region)
