"""The dialects of CalculiX (ccx 2.20) and Abaqus/Standard: differences between their input files.

CalculiX
Elements   C3D20R. Its 2 x 2 x 2 points are those of our slab, and with them it locks as little as our projected pressure: eight
           volume conditions an element against our four, where C3D20 has 27. In the frusta we take 27 points with the same
           projection, which ccx does not offer: C3D20R is softer where frusta fold, C3D20 stiffer, and near incompressibility
           locks. Either can be asked for. ccx has no hybrid elements.
Objects    ccx shifts shells by their thickness, so every facet becomes a tetrahedron behind it, whose first face is the facet.
           All its nodes have the reference node's movement by *EQUATION: a rigid body that only translates, as in our press.
Contact    A linear pressure-overclosure of our penalty stiffness. Our smooth start (a parabola over 0.001 mm) is left out, so
           overlaps are up to 0.0005 mm smaller: as a table it would give a touching pair no stiffness, and the sheet of a unit
           cell would fall through. Pressure counts per deformed area.
Friction   Its stick slope does not grow with the pressure, as our stiffness does.
Steps      *STEP has no name in ccx, so a comment before it gives one.

Abaqus
Elements   C3D20RH: 20 nodes, 2 x 2 x 2 points and a linear pressure, four unknowns an element, as our projected pressure has. In
           the frusta we take 27 points: C3D20H has as many, and the same pressure. (CalculiX has neither.)
Objects    Discrete rigid facets (R3D3) with a reference node.
Contact    Our smooth penalty as a table of pressure over overlap.
Friction   Our slip tolerance as elastic slip.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softtact.contact.penalty import Contact, penalty
from softtact.decks import keywords
from softtact.errors import InputError
from softtact.fem.elements import HEX20, TET4, WEDGE18

_PARABOLA_STEPS, _LINE_MM = 8, 1.0   # of the contact law in Abaqus: points on its parabola, length of its straight line
_DEPTH_MM = 1.0                      # of the tetrahedra behind facets
STIFF_MATERIAL = ("*MATERIAL, NAME=RIGID", "*ELASTIC", "1000, 0.3")     # of elements whose nodes are all prescribed


@dataclass(frozen=True)
class Dialect:
    """Types and lines of a deck that differ between the programs."""

    program: str
    """The program's name."""
    elements: tuple[str, ...]
    """Types of bricks that can be asked for."""
    slab: str
    """Type of the slab's bricks."""
    frusta: str
    """Type of the frusta's bricks."""
    wedge: str
    """Type of the wedges."""
    no_term: float
    """D_i in 1/MPa for a volumetric term that a law does not have; CalculiX replaces zero by a default."""
    hybrid: str
    """Suffix of the type of hybrid elements, which have a pressure as an unknown; empty where there are none."""
    fields: tuple[str, ...]
    """Lines of a step that ask for displacements and stresses of all bodies."""
    contact_fields: tuple[str, ...]
    """Lines of a step that ask for results of contacts."""
    facets_are_rigid: bool
    """Whether an object's facets are rigid by themselves (Abaqus), or need elements behind them."""

    def contact(self, settings: Contact) -> list[str]:
        """*SURFACE BEHAVIOR of our penalty; in Abaqus pressure over overlap: a parabola up to the smoothing depth, then a line."""
        if not self.facets_are_rigid:
            return linear_contact(settings.stiffness)
        depth = settings.smoothing
        overlaps = np.append(np.linspace(0.0, depth, _PARABOLA_STEPS + 1), depth + _LINE_MM)
        pressures = penalty(-overlaps, stiffness=settings.stiffness, smoothing=depth)[1]
        table = [f"{keywords.number(p)}, {keywords.number(s)}" for p, s in zip(pressures, overlaps, strict=True)]
        return ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR", *table]

    def friction(self, coefficient: float, *, stick_slope: float, slip_mm: float) -> list[str]:
        """*FRICTION. stick_slope: N/mm3, in CalculiX;  slip_mm: the elastic slip in Abaqus."""
        if self.facets_are_rigid:
            return [f"*FRICTION, ELASTIC SLIP={keywords.number(slip_mm)}", keywords.number(coefficient)]
        return ["*FRICTION", f"{keywords.number(coefficient)}, {keywords.number(stick_slope)}"]

    def step(self, name: str, increments: str, *, first: bool) -> list[str]:
        """A step's first lines, up to *BOUNDARY, which each step states in full, so that a force can release a reference node."""
        named = ([f"*STEP, NAME={name}, NLGEOM=YES, INC=1000"] if self.facets_are_rigid
                 else [f"** STEP: {name}", "*STEP, NLGEOM, INC=1000"])
        return [*named, "*STATIC", increments, "*BOUNDARY" if first else "*BOUNDARY, OP=NEW"]

    def rigid_facets(self, name: str, numbers: np.ndarray, nodes: np.ndarray, reference: int, *,
                     material: Sequence[str] = ()) -> list[str]:
        """Elements (e,) of a rigid object with nodes (e, 3) or (e, 4) as numbered in the deck, and the surface NAME_SURFACE.

        material: lines before the section of elements behind facets
        """
        if self.facets_are_rigid:
            return [*keywords.elements("R3D3", name, numbers, nodes), f"*RIGID BODY, REF NODE={reference}, ELSET={name}",
                    f"*SURFACE, NAME={name}_SURFACE, TYPE=ELEMENT", f"{name}, SPOS"]
        return [*keywords.elements(str(TET4.abaqus_name), name, numbers, nodes), *material,
                f"*SOLID SECTION, ELSET={name}, MATERIAL=RIGID",
                *keywords.surface(f"{name}_SURFACE", [(int(number), 1) for number in numbers])]


_BRICK = str(HEX20.abaqus_name)
DIALECTS = {
    "calculix": Dialect(program="CalculiX", elements=(f"{_BRICK}R", _BRICK), slab=f"{_BRICK}R", frusta=f"{_BRICK}R",
                        wedge=str(WEDGE18.abaqus_name), no_term=1e20, hybrid="", facets_are_rigid=False,
                        fields=("*NODE FILE, FREQUENCY=1000", "U, RF", "*EL FILE, FREQUENCY=1000", "S"),
                        contact_fields=("*CONTACT FILE, FREQUENCY=1000", "CDIS, CSTR")),
    "abaqus": Dialect(program="Abaqus", elements=(f"{_BRICK}RH", f"{_BRICK}H"), slab=f"{_BRICK}RH", frusta=f"{_BRICK}H",
                      wedge=f"{WEDGE18.abaqus_name}H", no_term=0.0, hybrid="H", facets_are_rigid=True,
                      fields=("*OUTPUT, FIELD, FREQUENCY=1000", "*NODE OUTPUT", "U, RF", "*ELEMENT OUTPUT", "S, LE"),
                      contact_fields=("*CONTACT OUTPUT", "CSTRESS", "*OUTPUT, HISTORY, FREQUENCY=1"))}


def dialect_of(name: str) -> Dialect:
    """The dialect of a name. Raises InputError that lists the names."""
    if name not in DIALECTS:
        raise InputError(f"The format {name!r} is unknown; use one of {', '.join(DIALECTS)}.")
    return DIALECTS[name]


def linear_contact(stiffness: float) -> list[str]:
    """*SURFACE BEHAVIOR of a linear penalty in N/mm3."""
    return ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", keywords.number(stiffness)]


def contact_pair(name: str, laws: Sequence[str], slave: str, master: str | None) -> list[str]:
    """A pair of surfaces with the lines of its laws, slave surface first; no master: the surface with itself."""
    return [f"*SURFACE INTERACTION, NAME={name}", *laws, f"*CONTACT PAIR, INTERACTION={name}, TYPE=SURFACE TO SURFACE",
            f"{slave}, {master}" if master else slave]


def tetrahedra_behind(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n + m, 3) and tetrahedra (m, 4) of points (n, 3) and facets (m, 3): each facet with a further point behind it.

    The first face of a tetrahedron is its nodes 1, 2, 3, which turn about the inward normal: the facet's reversed.
    """
    corners = points[facets]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    apex = corners.mean(axis=1) - _DEPTH_MM * normal
    tetrahedra = np.column_stack([facets[:, ::-1], len(points) + np.arange(len(apex))])
    return np.vstack([points, apex]), tetrahedra
