"""A `DeckModel` in the dialect of Abaqus/Standard.

Elements   C3D20RH: 20 nodes, 2 x 2 x 2 points and a linear pressure of its own, four unknowns an element, as our projected pressure
           has. In the frusta we take 27 points: C3D20H has as many, and the same pressure. (CalculiX has neither.)
Object     discrete rigid facets (R3D3) with a reference node that may only move along z.
Contact    *CONTACT PAIR, TYPE=SURFACE TO SURFACE with our smooth penalty as a table of pressure over overlap.
Friction   *FRICTION with our slip tolerance as elastic slip, where the sensor has friction.
Steps      NAME on *STEP; each repeats what is held, so that a force step can release the reference node.
"""

import numpy as np

from softtact.contact.penalty import penalty
from softtact.decks import keywords
from softtact.decks.laws import law_card
from softtact.decks.model import DeckModel
from softtact.fem.elements import HEX20, WEDGE18

PROGRAM = "Abaqus"
ELEMENTS = (f"{HEX20.abaqus_name}RH", f"{HEX20.abaqus_name}H")     # R: 2 x 2 x 2 points, H: a pressure of its own
WEDGE = f"{WEDGE18.abaqus_name}H"
_NO_TERM = 0.0
_PARABOLA_STEPS, _LINE_MM = 8, 1.0   # of the contact law: points on its parabola, length of its straight line
_FIRST_INCREMENT, _LARGEST_INCREMENT, _SMALLEST_INCREMENT = 0.1, 0.25, 1e-6

_OUTPUT = ("*OUTPUT, FIELD, FREQUENCY=1000", "*NODE OUTPUT", "U, RF", "*ELEMENT OUTPUT", "S, LE", "*CONTACT OUTPUT", "CSTRESS",
           "*OUTPUT, HISTORY, FREQUENCY=1", "*NODE OUTPUT, NSET=OBJECT_REFERENCE", "U3, RF3",
           "*NODE PRINT, NSET=INTERFACE, FREQUENCY=1000", "U3")


def deck_lines(model: DeckModel, *, slab_element: str = "C3D20RH", frustum_element: str = "C3D20H") -> list[str]:
    """The deck's lines."""
    kinds = {part.name: frustum_element if part.name == "FRUSTA" else slab_element for part in model.parts}
    cards = {part.name: law_card(part.law, no_term=_NO_TERM, dialect=PROGRAM) for part in model.parts}
    lines = keywords.heading(model, PROGRAM) + keywords.rubber(model, kinds, WEDGE, cards) + keywords.equations(model.ties)
    rigid, reference, fixed = _rigid_bodies(model)
    lines += rigid + keywords.contacts(model, _table, _friction)
    fixed = keywords.held(model) + fixed
    for k, step in enumerate(model.steps):
        lines += _step(step, reference, fixed, first=k == 0)
    return lines


def _rigid_bodies(model):
    """Lines of the rigid bodies, the number of the moving one's reference node, and *BOUNDARY rows of what stands still."""
    lines, fixed, moving = [], [], None
    node, element = len(model.points) + 1, keywords.element_count(model) + 1
    for body in model.rigid:
        numbers = range(element, element + len(body.facets))
        reference = node + len(body.points)
        lines += keywords.nodes(body.points, node, name=f"{body.name}_NODES")
        lines += keywords.nodes([body.points.mean(axis=0)], reference, name=f"{body.name}_REFERENCE")
        lines += keywords.elements("R3D3", body.name, numbers, body.facets + node)
        lines += [f"*RIGID BODY, REF NODE={reference}, ELSET={body.name}",
                  f"*SURFACE, NAME={body.name}_SURFACE, TYPE=ELEMENT", f"{body.name}, SPOS"]
        if body.moves:
            moving = reference
            fixed += [f"{reference}, 1, 2", f"{reference}, 4, 6"]
        else:
            fixed += [f"{reference}, 1, 6"]
        node, element = reference + 1, element + len(body.facets)
    return lines, moving, fixed


def _table(settings):
    """Our penalty, pressure over overlap: its parabola up to the smoothing depth, then its straight line."""
    depth = settings.smoothing
    overlaps = np.append(np.linspace(0.0, depth, _PARABOLA_STEPS + 1), depth + _LINE_MM)
    pressures = penalty(-overlaps, stiffness=settings.stiffness, smoothing=depth)[1]
    rows = [f"{keywords.number(p)}, {keywords.number(s)}" for p, s in zip(pressures, overlaps, strict=True)]
    return ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR", *rows]


def _friction(law):
    return [f"*FRICTION, ELASTIC SLIP={keywords.number(law.slip_tolerance_mm)}", keywords.number(law.coefficient)]


def _step(step, reference, fixed, *, first):
    increments = f"{_FIRST_INCREMENT}, 1, {_SMALLEST_INCREMENT}, {_LARGEST_INCREMENT}"
    lines = [f"*STEP, NAME={step.name}, NLGEOM=YES, INC=1000", "*STATIC", increments]
    lines += ["*BOUNDARY" if first else "*BOUNDARY, OP=NEW", *fixed]
    if step.control == "indentation":
        lines += [f"{reference}, 3, 3, {keywords.number(-step.value)}"]
    else:
        lines += ["*CLOAD", f"{reference}, 3, {keywords.number(-step.value)}"]
    return [*lines, *_OUTPUT, "*END STEP"]
