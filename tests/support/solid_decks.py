"""A `SolidBody` whose frames move without turning, as a deck of CalculiX (ccx 2.20): meshed bodies, laws, contacts, friction.

Elements   C3D20R for hexahedra HEX27 (without the middles of faces and body), C3D15 for wedges, C3D10 for quadratic tetrahedra.
Contact    SURFACE TO SURFACE with a linear pressure-overclosure of the pair's stiffness; the stick slope of friction is the same.
           ccx has no augmentation: overlaps are pressure over stiffness.
Forces     *NODE PRINT gives the reaction of each frame's nodes as their total, sets FRAME1, FRAME2, ..., at each step's end.
"""

from collections.abc import Mapping

import numpy as np

from softtact.contact.motion import Motion
from softtact.decks import keywords
from softtact.decks.keywords import law_card
from softtact.errors import InputError
from softtact.fem.elements import HEX27
from softtact.fem.solid_mesh import ELEMENTS
from softtact.models.solid.body import SolidBody

_NO_TERM = 1e20              # a zero D_i would be replaced by a default
_AXES = "xyz"


def calculix_lines(body: SolidBody, motions: Mapping[str, Motion], *, increments: int = 4, fixed: bool = False,
                   reduced: bool = True, stiffness: float | None = None) -> list[str]:
    """The deck's lines, with a step for each of the motions' (all of as many steps, {frame: `Motion`}).

    increments: parts of each step to begin with;  fixed: keep to them;  reduced: C3D20R for hexahedra, else C3D20
    stiffness: penalty in N/mm3 of the deck's contacts, by default that of each pair
    Raises InputError for plane bodies, rigid objects, pressures, and motions that turn or load a frame.
    """
    _refuse(body, motions)
    number = _numbers(body)
    lines = ["*HEADING", "units: mm, N, MPa"] + keywords.nodes(body.points[number > 0], 1, name="ALL")
    faces = _elements(body, number, lines, reduced)
    for name, law in body.laws.items():
        label = _label(body, name)
        lines += keywords.material(f"RUBBER_{label}", law_card(law, no_term=_NO_TERM, dialect="CalculiX"))
        lines += [f"*SOLID SECTION, ELSET={label}, MATERIAL=RUBBER_{label}"]
    for k, frame in enumerate(body.frames, 1):
        lines += keywords.node_set(f"FRAME{k}", _used(number, frame.nodes))
    for k, pair in enumerate(body.pairs, 1):
        lines += _contact(k, pair, faces, pair.stiffness if stiffness is None else stiffness)
    count = len(next(iter(motions.values())).steps)
    for step in range(count):
        lines += _step(body, motions, number, step, increments, fixed)
    return lines


def _refuse(body, motions):
    if body.mesh.geometry != "solid" or body.pressures or any(pair.rigid for pair in body.pairs):
        raise InputError("Only spatial bodies without pressures and rigid objects can be written for CalculiX; mesh the object.")
    for name, motion in motions.items():
        if any(step.loads or set(step.ways) - set(_AXES) for step in motion.steps):
            raise InputError(f"The frame {name!r} turns or is loaded, which this deck does not take; give ways along x, y and z.")


def _numbers(body):
    """The deck's number of each node, 0 where no element of the deck has it."""
    used = np.zeros(len(body.points), bool)
    for _, element, nodes in body.mesh.parts():
        used[nodes[:, element.abaqus_nodes]] = True
    return np.cumsum(used) * used


def _used(number, nodes):
    return number[nodes][number[nodes] > 0]


def _label(body, region):
    return f"REGION{body.mesh.regions.index(region) + 1}"


def _elements(body, number, lines, reduced):
    """Add *ELEMENT; returns (element, face) by the sorted corners of each face."""
    first, faces = 1, {}
    for region, kind, nodes in body.mesh.cells:
        element = ELEMENTS[kind]
        name = f"{element.abaqus_name}R" if element is HEX27 and reduced else element.abaqus_name
        own = number[nodes[:, element.abaqus_nodes]]
        lines += keywords.elements(name, _label(body, region), range(first, first + len(nodes)), own)
        for side, face in enumerate(element.faces, 1):
            corners = np.sort(nodes[:, face.nodes[:3 if len(face.nodes) == 6 else 4]], axis=1)
            faces |= {tuple(own): (first + k, side) for k, own in enumerate(corners.tolist())}
        first += len(nodes)
    return faces


def _contact(k, pair, faces, stiffness):
    lines = []
    for name, surface in (("POINTS", pair.surface), ("OTHER", pair.other)):
        corners = [np.sort(own[:3 if (own >= 0).sum() == 6 else 4]) for own in surface.nodes]
        lines += keywords.surface(f"{name}{k}", [faces[tuple(own.tolist())] for own in corners])
    lines += [f"*SURFACE INTERACTION, NAME=CONTACT{k}", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:g}, 0."]
    if pair.friction:
        lines += ["*FRICTION", f"{pair.friction:g}, {stiffness:g}"]
    return lines + [f"*CONTACT PAIR, INTERACTION=CONTACT{k}, TYPE=SURFACE TO SURFACE", f"POINTS{k}, OTHER{k}"]


def _step(body, motions, number, step, increments, fixed):
    lines = ["*STEP, NLGEOM, INC=1000", "*STATIC" + (", DIRECT" if fixed else ""), f"{1 / increments:g}, 1.", "*BOUNDARY"]
    held = ~body.free_components & (number > 0)[:, None]
    for frame in body.frames:
        held[frame.carried] = False
    lines += [f"{number[node]}, {axis + 1}, {axis + 1}" for node, axis in np.argwhere(held)]
    for frame in body.frames:
        ways = motions.get(frame.name, Motion()).steps[:step + 1]
        for axis in frame.axes:
            way = sum(own.ways.get(axis, 0.0) for own in ways)
            component = _AXES.index(axis) + 1
            lines += [f"{n}, {component}, {component}, {keywords.number(way)}" for n in _used(number, frame.nodes)]
    for k in range(1, len(body.frames) + 1):
        lines += [f"*NODE PRINT, NSET=FRAME{k}, TOTALS=ONLY, FREQUENCY=1000", "RF"]
    return lines + ["*END STEP"]
