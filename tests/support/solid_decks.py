"""A `SolidBody` whose frames are driven, as a deck of CalculiX (ccx 2.20): meshed bodies, laws, contacts, friction.

Elements   C3D20R for hexahedra HEX27 (without the middles of faces and body), C3D15 for wedges, C3D10 for quadratic tetrahedra.
Contact    SURFACE TO SURFACE with a linear pressure-overclosure of the pair's stiffness; the stick slope of friction is the same.
           ccx has no augmentation: overlaps are pressure over stiffness.
Frames     each of their nodes is prescribed: straight from step to step, so turn in small steps.
Forces     *NODE PRINT gives the reaction of each frame's nodes as their total, sets FRAME1, FRAME2, ..., at each step's end; of
           a frame that turns also node by node (`frame_load`).
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
from softtact.models.solid.frames import FramePose, step_vector

_NO_TERM = 1e20              # a zero D_i would be replaced by a default
_AXES = "xyz"


def calculix_lines(body: SolidBody, motions: Mapping[str, Motion], *, increments: int = 4, fixed: bool = False,
                   reduced: bool = True, stiffness: float | None = None) -> list[str]:
    """The deck's lines, with a step for each of the motions' (all of as many steps, {frame: `Motion`}).

    increments: parts of each step to begin with;  fixed: keep to them;  reduced: C3D20R for hexahedra, else C3D20
    stiffness: penalty in N/mm3 of the deck's contacts, by default that of each pair
    Raises InputError for plane bodies, objects without elements, pressures, and motions that load a frame.
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
    soft = len(body.mesh.points)
    if body.mesh.geometry != "solid" or body.pressures or any((pair.other.used >= soft).any() for pair in body.pairs):
        raise InputError("Only spatial bodies without pressures and rigid objects can be written for CalculiX; mesh the object.")
    for name, motion in motions.items():
        if any(step.loads for step in motion.steps):
            raise InputError(f"The frame {name!r} is loaded, which this deck does not take; give ways.")


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
        steps = motions.get(frame.name, Motion()).steps[:step + 1]
        moved = pose_after(steps).displacement(frame, body.points)
        for axis in frame.axes:
            component = _AXES.index(axis)
            lines += [f"{number[n]}, {component + 1}, {component + 1}, {keywords.number(way)}"
                      for n, way in zip(frame.nodes, moved[:, component], strict=True) if number[n] > 0]
    for k, frame in enumerate(body.frames, 1):
        lines += [f"*NODE PRINT, NSET=FRAME{k}, TOTALS=ONLY, FREQUENCY=1000", "RF"]
        if _turns(motions.get(frame.name, Motion())):
            lines += [f"*NODE PRINT, NSET=FRAME{k}, FREQUENCY=1000", "RF"]
    return lines + ["*END STEP"]


def _turns(motion):
    return any(set(step.ways) - set(_AXES) for step in motion.steps)


def pose_after(steps):
    """`FramePose` after some steps of a motion from rest."""
    pose = FramePose()
    for step in steps:
        pose = pose.moved(step_vector(step.ways))
    return pose


def frame_load(body, frame, pose, table):
    """Force (N) and torque (N mm) (6,) of a frame about its reference point, of a table (nodes, 4): number and reaction."""
    number, force = _numbers(body), np.zeros_like(body.points)
    node_of = {int(own): node for node, own in enumerate(number) if own > 0}
    for own, *reaction in table:
        force[node_of[int(own)]] = reaction
    return pose.loads(frame, body.points, force)
