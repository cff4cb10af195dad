"""A `DeckModel` in CalculiX's dialect (ccx 2.20).

Elements   C3D20R. Its 2 x 2 x 2 points are those of our slab, and with them it locks as little as our projected pressure: eight
           volume conditions an element against our four, where C3D20 has 27. In the frusta we take 27 points with the same
           projection, which ccx does not offer: C3D20R is softer where frusta fold, C3D20 stiffer, and near incompressibility
           locks. Either can be asked for. ccx has no hybrid elements.
Object     ccx shifts shells by their thickness, so every facet becomes a tetrahedron behind it, whose first face is the facet.
           All its nodes have the reference node's movement along z by *EQUATION, and none across: a rigid body that
           only translates, as in our press.
Contact    *CONTACT PAIR, TYPE=SURFACE TO SURFACE with a linear pressure-overclosure of our penalty stiffness. Our smooth
           start (a parabola over 0.001 mm) is left out, so overlaps are up to 0.0005 mm smaller: as a table it would give
           a touching pair no stiffness, and the sheet of a unit cell would fall through. Pressure counts per deformed area.
Friction   *FRICTION where the sensor has friction. Its stick slope does not grow with the pressure, as our stiffness does: it is
           such that a point slides off after our slip tolerance at 1 MPa, earlier at less.
Steps      *STEP has no name in ccx, so a comment before it gives one.
"""

import numpy as np

from softtact.decks import keywords
from softtact.decks.laws import law_card
from softtact.decks.model import DeckModel
from softtact.fem.elements import HEX20, TET4, WEDGE18

PROGRAM = "CalculiX"
ELEMENTS = (f"{HEX20.abaqus_name}R", HEX20.abaqus_name)     # R: 2 x 2 x 2 points
WEDGE: str = WEDGE18.abaqus_name     # type: ignore[assignment]
_NO_TERM = 1e20              # a zero D_i would be replaced by a default
_STIFF = "1000, 0.3"         # of the rigid bodies' elements, whose nodes are all prescribed
_FIRST_INCREMENT, _LARGEST_INCREMENT, _SMALLEST_INCREMENT = 0.1, 0.25, 1e-6
_DEPTH_MM = 1.0              # of the tetrahedra behind facets
_STICK_PRESSURE_MPA = 1.0    # at which friction is as stiff as ours

_TABLES = ("*NODE PRINT, NSET=OBJECT_REFERENCE, FREQUENCY=1000", "U",
           "*NODE PRINT, NSET=OBJECT_NODES, TOTALS=ONLY, FREQUENCY=1000", "RF",
           "*NODE PRINT, NSET=BOARD_NODES, TOTALS=ONLY, FREQUENCY=1000", "RF",
           "*NODE PRINT, NSET=INTERFACE, FREQUENCY=1000", "U")
_FIELDS = ("*NODE FILE, FREQUENCY=1000", "U, RF", "*EL FILE, FREQUENCY=1000", "S", "*CONTACT FILE, FREQUENCY=1000", "CDIS, CSTR")


def deck_lines(model: DeckModel, *, slab_element: str = "C3D20R", frustum_element: str = "C3D20R",
               fields: bool = True) -> list[str]:
    """The deck's lines.

    `fields`: displacements, stresses and contact in the .frd file too, not only the tables of the .dat file
    """
    kinds = {part.name: frustum_element if part.name == "FRUSTA" else slab_element for part in model.parts}
    cards = {part.name: law_card(part.law, no_term=_NO_TERM, dialect=PROGRAM) for part in model.parts}
    lines = keywords.heading(model, PROGRAM) + keywords.rubber(model, kinds, WEDGE, cards) + keywords.equations(model.ties)
    rigid, reference, fixed = _rigid_bodies(model)
    lines += rigid + keywords.contacts(model, _linear, _friction)
    fixed = keywords.held(model) + fixed
    for k, step in enumerate(model.steps):
        lines += _step(step, reference, fixed, first=k == 0, fields=fields)
    return lines


def _rigid_bodies(model):
    """Lines of the rigid bodies, the number of the moving one's reference node, and *BOUNDARY rows of what stands still."""
    lines, fixed = ["*MATERIAL, NAME=RIGID", "*ELASTIC", _STIFF], []
    node, element, reference = len(model.points) + 1, keywords.element_count(model) + 1, None
    for body in model.rigid:
        points, tetrahedra = tetrahedra_behind(body.points, body.facets)
        numbers = np.arange(element, element + len(tetrahedra))
        lines += keywords.nodes(points, node, name=f"{body.name}_NODES")
        lines += keywords.elements(TET4.abaqus_name, body.name, numbers, tetrahedra + node)
        lines += [f"*SOLID SECTION, ELSET={body.name}, MATERIAL=RIGID"]
        lines += keywords.surface(f"{body.name}_SURFACE", [(n, 1) for n in numbers])
        last = node + len(points)
        if body.moves:
            reference, last = last, last + 1
            lines += keywords.nodes([points.mean(axis=0)], reference, name=f"{body.name}_REFERENCE")
            lines += keywords.moving_along(range(node, reference), reference, 3)
            fixed += [f"{body.name}_NODES, 1, 2", f"{reference}, 1, 2"]
        else:
            fixed += [f"{body.name}_NODES, 1, 3"]
        node, element = last, element + len(tetrahedra)
    return lines, reference, fixed


def tetrahedra_behind(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n + m, 3) and tetrahedra (m, 4) of points (n, 3) and facets (m, 3): each facet with a point of its own behind it.

    The first face of a tetrahedron is its nodes 1, 2, 3, which turn about the inward normal: the facet's reversed.
    """
    corners = points[facets]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    apex = corners.mean(axis=1) - _DEPTH_MM * normal
    tetrahedra = np.column_stack([facets[:, ::-1], len(points) + np.arange(len(apex))])
    return np.vstack([points, apex]), tetrahedra


def _linear(settings):
    return ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", keywords.number(settings.stiffness)]


def _friction(law):
    slope = law.coefficient * _STICK_PRESSURE_MPA / law.slip_tolerance_mm
    return ["*FRICTION", f"{keywords.number(law.coefficient)}, {keywords.number(slope)}"]


def _step(step, reference, fixed, *, first, fields):
    """One step; *BOUNDARY is given anew in each, so that a force step can release the reference node."""
    increments = f"{_FIRST_INCREMENT}, 1, {_SMALLEST_INCREMENT}, {_LARGEST_INCREMENT}"
    lines = [f"** STEP: {step.name}", "*STEP, NLGEOM, INC=1000", "*STATIC", increments]
    lines += ["*BOUNDARY" if first else "*BOUNDARY, OP=NEW", *fixed]
    if step.control == "indentation":
        lines += [f"{reference}, 3, 3, {keywords.number(-step.value)}"]
    else:
        lines += ["*CLOAD", f"{reference}, 3, {keywords.number(-step.value)}"]
    return [*lines, *_TABLES, *(_FIELDS if fields else ()), "*END STEP"]
