"""The layered body's points and cells as VTK numbers them."""

import numpy as np

# VTK's order of the nodes, by ours (bottom, top, middle of a plan of corners, mid-sides and centre).
VTK_HEX27 = np.array([0, 1, 2, 3, 9, 10, 11, 12, 4, 5, 6, 7, 13, 14, 15, 16, 18, 19, 20, 21, 25, 23, 22, 24, 8, 17, 26])
VTK_WEDGE18 = np.array([0, 1, 2, 6, 7, 8, 3, 4, 5, 9, 10, 11, 12, 13, 14, 15, 16, 17])
FRUSTA, SHEET, COVER = 0, 1, 2     # layers


def body_cells(body):
    """Points (n, 3) in mm of a `LayeredBody`: sheet, cover, the frusta one by one; cells [(VTK's kind, nodes (e, w), layer)]."""
    sheet, cover, bed = body.slab.sheet_mesh, body.slab.cover_mesh, body.bed
    first = np.cumsum([0, len(sheet.points), len(cover.points)])
    frusta = (bed.mesh.hexes[None] + first[2] + (np.arange(bed.count) * bed.nodes)[:, None, None]).reshape(-1, 27)
    cells = [("hexahedron27", frusta[:, VTK_HEX27], FRUSTA), ("hexahedron27", sheet.hexes[:, VTK_HEX27], SHEET),
             ("wedge18", sheet.wedges[:, VTK_WEDGE18], SHEET), ("hexahedron20", cover.hexes + first[1], COVER)]
    return np.vstack([sheet.points, cover.points, bed.coordinates.reshape(-1, 3)]), cells
