"""Mesh and body of a palpation sensor with tissue and jaw, in plane strain or as a solid.

Base (supports and filler), beam and tissue have one grid of lines. Bonded layers share their nodes; loose ones are separate meshes
that meet in contact pairs.
"""

import numpy as np

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.solid_mesh import SolidMesh
from softtact.fem.structured_meshes import box
from softtact.materials.laws.base import Law
from softtact.materials.linear import small_strain_constants
from softtact.models.solid.body import SolidBody
from softtact.probe.design import EDGE_LINES, PalpationDesign

JAW = "jaw"
_LAYERS = ("base", "beam", "tissue")
_PENALTY = 10.0          # times E over the element's side
_ROUNDING_MM = 1e-9


def lines(breaks: list[float], size: float) -> np.ndarray:
    """Ends of elements no longer than `size`; all the rising `breaks` are among them."""
    kept = np.unique(np.round(breaks, 9))
    parts = [np.linspace(a, b, max(1, int(np.ceil((b - a) / size - 1e-6))) + 1)[:-1] for a, b in zip(kept, kept[1:], strict=False)]
    return np.concatenate([*parts, kept[-1:]])


def structure_mesh(design: PalpationDesign) -> SolidMesh:
    """The `SolidMesh`: regions as in REGIONS, and `lump`; faces `base bottom`, `tissue top`, and those of loose layers."""
    groups: list[list[int]] = [[0]]
    for layer, bond in ((1, design.beam_on_base), (2, design.tissue_on_beam)):
        if bond == "bonded":
            groups[-1].append(layer)
        else:
            groups.append([layer])
    meshes = [_stack(design, group) for group in groups]
    whole = meshes[0]
    for mesh in meshes[1:]:
        whole = whole.joined(mesh)
    return whole


def _stack(design, layers):
    """The mesh of neighbouring layers that are bonded."""
    g, sizes, lump = design.geometry, design.mesh, design.lump
    x = lines([0.0, *_edges(design), g.middle, g.length, *_sides(lump)], sizes.along)
    y = np.unique(np.concatenate([_rows(design, layer) for layer in layers]))
    low, high = [x[0], y[0]], [x[-1], y[-1]]
    divisions, grading = [len(x) - 1, len(y) - 1], [_shares(x), _shares(y)]
    solid = design.model == "solid"
    if solid:
        low, high, divisions, grading = [*low, 0.0], [*high, g.depth], [*divisions, sizes.depth_layers], [*grading, None]
    mesh = box(low, high, divisions, grading=grading, thickness_mm=None if solid else g.depth)
    mesh = mesh.with_regions(lambda middles: _regions(design, middles))
    faces = {f"{_LAYERS[layers[0]]} bottom": _at(1, y[0]), f"{_LAYERS[layers[-1]]} top": _at(1, y[-1])}
    if layers == [0]:     # loose: its stiff and soft parts have separate contact pairs
        top, (left, right) = _at(1, y[-1]), design.span("filler")
        faces["filler top"] = lambda m: top(m) & (m[:, 0] > left) & (m[:, 0] < right)
        faces["support top"] = lambda m: top(m) & ((m[:, 0] < left) | (m[:, 0] > right))
    return mesh.with_faces(**faces)


def _edges(design):
    """x of the supports' inner edges and of closer lines beside them."""
    first, (left, right) = design.mesh.edge, design.span("filler")
    if first is None:
        return [left, right]
    return [edge + side * step * first for edge in (left, right) for step in (0, *EDGE_LINES) for side in (-1, 1)]


def _sides(lump):
    return [] if lump is None else [lump.x - 0.5 * lump.width, lump.x + 0.5 * lump.width]


def _rows(design, layer):
    """Ends of a layer's elements along y."""
    low, high = design.geometry.levels[layer:layer + 2]
    if layer == 1:
        return np.linspace(low, high, design.mesh.beam_layers + 1)
    lump = design.lump if layer == 2 else None
    inner = [] if lump is None else [high - lump.depth - 0.5 * lump.height, high - lump.depth + 0.5 * lump.height]
    return lines([low, *inner, high], design.mesh.base if layer == 0 else design.mesh.tissue)


def _shares(ends):
    return (ends - ends[0]) / (ends[-1] - ends[0])


def _at(axis, value):
    return lambda middles: np.abs(middles[:, axis] - value) < _ROUNDING_MM * 1e3


def _regions(design, middles):
    """Names (e,) of the regions at places (e, 3)."""
    x, y = middles[:, 0], middles[:, 1]
    _, base, beam, top = design.geometry.levels
    left, right = design.span("filler")
    names = np.where(y > beam, "tissue", np.where(y > base, "beam", np.where(x < left, "left support",
                                                                            np.where(x > right, "right support", "filler"))))
    if design.lump is not None:
        lump = design.lump
        inside = (np.abs(x - lump.x) < 0.5 * lump.width) & (np.abs(top - y - lump.depth) < 0.5 * lump.height)
        names = np.where(inside, "lump", names)
    return names


def structure_laws(design: PalpationDesign, tissue: Law) -> dict[str, Law]:
    """Laws by region, with that of a tissue."""
    laws = {"left support": design.supports.make(), "right support": design.supports.make(), "filler": design.filler.make(),
            "beam": design.beam.make(), "tissue": tissue}
    if design.lump is not None:
        laws["lump"] = stiffer(tissue, design.lump.stiffness_ratio)
    return laws


def stiffer(law: Law, ratio: float) -> Law:
    """The same law with all its moduli times a ratio."""
    scaled = {constant.name: law.parameters[constant.name] * (ratio if constant.unit == "MPa" else 1.0)
              for constant in law.constants}
    made = type(law)(scaled, bulk_modulus=law.bulk_modulus * ratio, volumetric=type(law.volumetric))
    made.stretch_window = law.stretch_window
    return made


def structure_body(design: PalpationDesign, tissue: Law, *, threads: int = 1) -> SolidBody:
    """The `SolidBody`: the base is held; the frame `jaw` carries the tissue's top and moves along y."""
    mesh, laws = structure_mesh(design), structure_laws(design, tissue)
    g = design.geometry
    axes = "xyz" if design.jaw == "bonded" else "y"
    body = SolidBody(mesh, laws, held={"base bottom": "xyz" if design.model == "solid" else "xy"},
                     carried={JAW: ((g.middle, g.levels[3], 0.0), ["tissue top"], axes)}, threads=threads)
    if design.tissue_on_beam != "bonded":
        _add_contact(body, design, "tissue bottom", "beam top", tissue, design.tissue_on_beam)
    if design.beam_on_base != "bonded":
        _add_contact(body, design, "filler top", "beam bottom", laws["filler"], design.beam_on_base)
        _add_contact(body, design, "support top", "beam bottom", laws["left support"], design.beam_on_base)
    return body


def _add_contact(body, design, face, other, law, friction):
    """Add a contact pair whose penalty stiffness follows from a law."""
    young = small_strain_constants(law.mu0, law.bulk_modulus)["young_mpa"]
    body.add(ContactPair(Surface.of(body.mesh.face(face)), Surface.of(body.mesh.face(other)), friction=friction,
                              stiffness=_PENALTY * young / design.mesh.along, reach_mm=0.5 * design.geometry.beam_height,
                              thickness_mm=design.geometry.depth, name=f"{face} on {other}"))
