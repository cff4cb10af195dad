"""A press of solids (`SolidBody`) as input for CalculiX or Abaqus.

    export_solid("press.inp", body, {"ball": Motion().step(ways={"z": -0.2})}, dialect="calculix")

Elements   CalculiX: C3D10, C3D20R, C3D15, CPE8R, CAX8R, CPE6, CAX6. Abaqus: the same with a pressure in each element
           (H), except for foams. Nodes in faces and bodies of our full quadratic elements are left out.
Frames     move without turning: every node that a frame carries follows its reference node by *EQUATION, so that a displacement or
           a force of the reference node drives it. A frame that turns is refused.
Contact    surface to surface, linear penalty: `STIFFER` times that of the pair, because neither program augments it as we do.
Sticking
           friction is as stiff (CalculiX), or slips elastically by 1 um (Abaqus).
Steps      those of the motions. A rigid object whose first step is a force is moved to touch in a step before.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.contact.facet_shapes import LINE2, QUAD8
from softtact.contact.motion import FREEDOMS, Motion, MotionStep
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.decks import keywords
from softtact.decks.dialects import STIFF_MATERIAL, Dialect, contact_pair, dialect_of, linear_contact, tetrahedra_behind
from softtact.errors import InputError
from softtact.fem.elements import Element
from softtact.files import atomic_path
from softtact.models.solid.body import SolidBody
from softtact.models.solid.frames import Frame
from softtact.models.solid.items import FacePressure
from softtact.models.solid.path import count_steps, still_loaded

STIFFER = 50.0
_ELASTIC_SLIP_MM = 1e-3
_TOUCH_MM = 0.01
_FACING = -0.1       # cosine between a facet's normal and one of a surface that it faces
_INCREMENTS = "0.1, 1, 1e-6, 0.25"


@dataclass(frozen=True)
class DeckStep:
    """A step: displacements {(frame, axis): mm from rest}, loads {(frame, axis): N}, and the faces' pressures in MPa."""

    name: str
    displacements: dict[tuple[int, int], float]
    loads: dict[tuple[int, int], float]
    pressures: list[float]


def export_solid(path: str | Path, body: SolidBody, motions: Mapping[str, Motion] | None = None,
                 pressures: Mapping[str, Sequence[float]] | None = None, *, dialect: str, title: str = "press of solids") -> None:
    """Write a press of solids as a deck, whole or not at all; arguments as `SolidPath` takes them.

    Raises InputError for what a deck cannot express: an unknown dialect, a law that the program lacks, a frame that turns, a
    freedom that is prescribed after it was loaded, self-contact in CalculiX, items other than contact pairs and pressures, names
    that are one in capitals.
    """
    lines = _Deck(body, dialect_of(dialect)).lines(deck_steps(body, motions or {}, pressures or {}), title)
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii", errors="replace")


def deck_steps(body: SolidBody, motions: Mapping[str, Motion], pressures: Mapping[str, Sequence[float]]) -> list[DeckStep]:
    """The steps of a deck; displacements add up from rest, and loads stay until their freedom is prescribed, as in `SolidPath`."""
    count, names = count_steps(body, motions, pressures), [frame.name for frame in body.frames]
    displacements = {(k, axis): 0.0 for k in range(len(names)) for axis in range(3)}
    loads: dict[tuple[int, int], float] = {}
    steps: dict[str, MotionStep] = {}
    out = []
    for number in range(count):
        steps = {name: still_loaded(steps.get(name), motion.steps[number]) for name, motion in motions.items()}
        for name, step in steps.items():
            _refuse_turning(name, number, step)
        ways = _by_axis(names, {name: step.ways for name, step in steps.items()})
        if moved := loads.keys() & ways.keys():
            frame, axis = min(moved)
            raise InputError(f"The frame {names[frame]!r} is prescribed along {FREEDOMS[axis]} in step {number + 1} from the "
                             "position to which the force before moved it, unknown to a deck; continue to load it, or end the "
                             "motion before.")
        loads = _by_axis(names, {name: step.loads for name, step in steps.items()})
        if number == 0 and (touch := _touch(body, loads)):
            out.append(DeckStep("TOUCH", displacements | touch, {}, [0.0] * len(body.pressures)))
        displacements = {key: value + ways.get(key, 0.0) for key, value in displacements.items()}
        free = {key: value for key, value in displacements.items() if key not in loads}
        out.append(DeckStep(f"STEP_{number + 1}", free, loads, [float(pressures[face.name][number]) for face in body.pressures]))
    return out


def _by_axis(names, values):
    """{(frame, axis): value} of values {frame's name: {freedom: value}} of freedoms that do not turn."""
    return {(names.index(name), FREEDOMS.index(freedom)): value for name, of in values.items() for freedom, value in of.items()}


def _refuse_turning(name, number, step):
    if turned := [freedom for freedom in (*step.ways, *step.loads) if FREEDOMS.index(freedom) > 2]:
        raise InputError(f"The frame {name!r} turns in step {number + 1} ({turned[0]}), which decks do not take; leave its "
                         "rotations out.")


def _touch(body, loads):
    """Displacements {(frame, axis): mm} that bring a rigid object to touch along the one force that acts on it."""
    first = len(body.mesh.points)
    rigid = {key: value for key, value in loads.items() if body.frames[key[0]].nodes.min() >= first and value}
    if not rigid:
        return {}
    gap = min((float(np.min(contact.projection.gap, initial=np.inf)) for contact in body.rest().contacts), default=np.inf)
    if len(rigid) > 1 or not np.isfinite(gap):
        raise InputError("A deck moves only one loaded object to touch, along one axis, within its pair's reach; place it "
                         "closer, or prescribe its displacement in a step before.")
    key, value = next(iter(rigid.items()))
    return {key: float(np.sign(value)) * (max(gap, 0.0) + _TOUCH_MM)}


class _Deck:
    """A body in a dialect."""

    def __init__(self, body: SolidBody, writer: Dialect) -> None:
        self.body, self.writer = body, writer
        _refuse_items(body)
        _refuse_equal_names(body)
        self.parts = [part for part in body.mesh.parts() if len(part[2])]
        first = np.cumsum([1, *(len(nodes) for _, _, nodes in self.parts)])
        self.numbers = [np.arange(start, start + len(nodes)) for start, (_, _, nodes) in zip(first, self.parts, strict=False)]
        self.next_element, self.soft = int(first[-1]), len(body.mesh.points)
        self.used = np.unique(np.concatenate([nodes[:, element.abaqus_nodes].ravel() for _, element, nodes in self.parts]))
        self.reference = {k: len(body.points) + 1 + k for k in range(len(body.frames))}
        self.next_node = len(body.points) + len(body.frames) + 1
        self._sides: dict[tuple[int, ...], tuple[int, int]] = {}

    def lines(self, steps, title):
        """All lines."""
        lines = keywords.heading(title, self.writer.program) + self._rubber() + self._frames() + self._contacts()
        for number, step in enumerate(steps):
            lines += self._step(step, first=number == 0)
        return lines

    def _rubber(self):
        body, writer = self.body, self.writer
        lines = ["*NODE, NSET=SOFT"] + [f"{k + 1}, " + ", ".join(map(keywords.number, body.points[k])) for k in self.used]
        for (region, element, nodes), numbers in zip(self.parts, self.numbers, strict=True):
            kind = self._kind(element, body.laws[region])
            lines += keywords.elements(kind, name_of(region), numbers, nodes[:, element.abaqus_nodes] + 1)
        for region in body.mesh.regions:
            card = keywords.law_card(body.laws[region], no_term=writer.no_term, dialect=writer.program)
            lines += keywords.material(f"LAW_{name_of(region)}", card)
            lines += [f"*SOLID SECTION, ELSET={name_of(region)}, MATERIAL=LAW_{name_of(region)}"]
            lines += [keywords.number(body.mesh.thickness_mm)] if body.mesh.geometry == "plane_strain" else []
        for axis in range(3):
            lines += keywords.node_set(f"HELD_{axis + 1}", self._held(axis) + 1)
        return lines

    def _kind(self, element: Element, law) -> str:
        letters = {"solid": "C3D", "plane_strain": "CPE", "axisymmetric": "CAX"}[self.body.mesh.geometry]
        name = letters + (element.abaqus_name or "").removeprefix("C3D")
        name += "R" if name.endswith(("C3D20", "8")) else ""
        return name + (self.writer.hybrid if law.projected_modulus > 0 else "")

    def _held(self, axis):
        """Soft nodes that are held along an axis, and that no frame carries along it."""
        if axis == 2 and self.body.mesh.geometry != "solid":
            return np.zeros(0, dtype=int)
        carried = [frame.nodes for frame in self.body.frames if "xyz"[axis] in frame.axes]
        held = self.used[~self.body.free_components[self.used, axis]]
        return np.setdiff1d(held, np.concatenate([np.zeros(0, dtype=int), *carried]))

    def _frames(self):
        """Reference nodes, rigid objects, and the nodes that follow the reference nodes."""
        lines, taken = [], np.zeros((len(self.body.points), 3), dtype=bool)
        axes = range(3 if self.body.mesh.geometry == "solid" else 2)
        for k, frame in reversed(list(enumerate(self.body.frames))):     # a node that two frames carry follows the last
            name, nodes = name_of(frame.name), frame.nodes
            lines += keywords.nodes([frame.point], self.reference[k], name=f"{name}_REFERENCE")
            if nodes.min() >= self.soft:
                nodes = np.concatenate([nodes, self._object(frame, lines)])
            else:
                nodes = np.intersect1d(nodes, self.used)
            lines += keywords.node_set(f"{name}_NODES", nodes + 1)
            for axis in axes:
                if "xyz"[axis] in frame.axes and (not self.writer.facets_are_rigid or nodes.min() < self.soft):
                    new = nodes[(nodes >= len(taken)) | ~taken[np.minimum(nodes, len(taken) - 1), axis]]
                    lines += keywords.moving_along(new + 1, self.reference[k], axis + 1)
                    taken[new[new < len(taken)], axis] = True
        return lines

    def _object(self, frame: Frame, lines):
        """Add a rigid object's lines; returns the further nodes, from 0, that it needs."""
        name, facets = name_of(frame.name), self._facing(self.body.surface_nodes(frame.name))
        lines += keywords.nodes(self.body.points[frame.nodes], int(frame.nodes[0]) + 1)
        numbers = np.arange(self.next_element, self.next_element + len(facets))
        self.next_element += len(facets)
        reference = self.reference[self.body.frames.index(frame)]
        if self.writer.facets_are_rigid:
            lines += self.writer.rigid_facets(name, numbers, facets + 1, reference)
            return np.zeros(0, dtype=int)
        points, tetrahedra = tetrahedra_behind(self.body.points[frame.nodes], facets - frame.nodes[0])
        behind = np.arange(self.next_node - 1, self.next_node - 1 + len(facets))
        node = np.concatenate([frame.nodes, behind])
        self.next_node += len(facets)
        lines += keywords.nodes(points[len(frame.nodes):], int(behind[0]) + 1)
        lines += self.writer.rigid_facets(name, numbers, node[tetrahedra] + 1, reference, material=STIFF_MATERIAL)
        return behind

    def _facing(self, facets):
        """The facets (t, 3) of an object that face its partner surface: the search of CalculiX also finds those behind."""
        outward = _normals(self.body.points, facets)
        surfaces = [pair.surface for pair in self.body.pairs if np.isin(pair.other.nodes[0, :3], facets).all()]
        met = [np.unique(_normals(self.body.points, surface.nodes[:, :3]).round(3), axis=0) for surface in surfaces]
        if not met:
            return facets
        faces = np.any([(outward @ normals.T).min(axis=1) < _FACING for normals in met], axis=0)
        if not faces.any():
            raise InputError("A rigid object's facets face away from the surface of their pair; turn their normals outwards.")
        return facets[faces]

    def _contacts(self):
        lines = []
        for number, pair in enumerate(self.body.pairs, start=1):
            name = f"PAIR_{number}"
            if pair.itself and not self.writer.facets_are_rigid:
                raise InputError(f"The pair {pair.name!r} is a surface with itself, which {self.writer.program} does not take; "
                                 "export it for Abaqus.")
            lines += keywords.surface(f"{name}_POINTS", self._faces(pair.surface))
            other = self._object_of(pair.other)
            if other is None and not pair.itself:
                other = f"{name}_OTHER"
                lines += keywords.surface(other, self._faces(pair.other))
            stiffness = STIFFER * pair.stiffness
            laws = linear_contact(stiffness)
            if pair.friction:
                laws += self.writer.friction(pair.friction, stick_slope=stiffness, slip_mm=_ELASTIC_SLIP_MM)
            lines += contact_pair(name, laws, f"{name}_POINTS", other)
        return lines

    def _object_of(self, surface: Surface) -> str | None:
        """Name of a rigid object's surface, None for a soft one."""
        node = int(surface.nodes[0, 0])
        frames = (frame for frame in self.body.frames if node >= self.soft and node in frame.nodes)
        return next((f"{name_of(frame.name)}_SURFACE" for frame in frames), None)

    def _faces(self, surface: Surface) -> list[tuple[int, int]]:
        """Element numbers and faces, from 1, of a soft surface's facets."""
        if not self._sides:
            for (_, element, nodes), numbers in zip(self.parts, self.numbers, strict=True):
                for side, face in enumerate(element.faces, start=1):
                    rows = np.sort(nodes[:, face.nodes[:face.element.corners]], axis=1)
                    self._sides |= {tuple(row): (number, side) for row, number in zip(rows.tolist(), numbers.tolist(), strict=True)}
        count = np.where(surface.kinds >= LINE2, 2, np.where(surface.kinds >= QUAD8, 4, 3))
        keys = [tuple(sorted(nodes[:k])) for nodes, k in zip(surface.nodes.tolist(), count, strict=True)]
        if missing := [key for key in keys if key not in self._sides]:
            raise InputError(f"A facet of a surface belongs to no element of the deck (nodes {missing[0]}); name mesh faces.")
        return [self._sides[key] for key in keys]

    def _step(self, step: DeckStep, *, first):
        lines = self.writer.step(step.name, _INCREMENTS, first=first)
        lines += [f"HELD_{axis + 1}, {axis + 1}, {axis + 1}" for axis in range(3) if len(self._held(axis))]
        plane = self.body.mesh.geometry != "solid"
        for (frame, axis), displacement in step.displacements.items():
            if not (plane and axis == 2):
                lines += [f"{self.reference[frame]}, {axis + 1}, {axis + 1}, {keywords.number(displacement)}"]
        if self.writer.facets_are_rigid:
            lines += [f"{self.reference[k]}, 4, 6" for k, frame in enumerate(self.body.frames) if frame.nodes.min() >= self.soft]
        if step.loads:
            lines += ["*CLOAD"] + [f"{self.reference[frame]}, {axis + 1}, {keywords.number(value)}"
                                   for (frame, axis), value in step.loads.items()]
        for face, pressure in zip(self.body.pressures, step.pressures, strict=True):
            value = keywords.number(pressure)
            lines += ["*DLOAD"] + [f"{element}, P{side}, {value}" for element, side in self._faces(face.surface)]
        return [*lines, *self._output(), "*END STEP"]

    def _output(self):
        names, fields = [name_of(frame.name) for frame in self.body.frames], self.writer.fields
        if self.writer.facets_are_rigid:
            histories = [line for name in names for line in (f"*NODE OUTPUT, NSET={name}_REFERENCE", "U, RF")]
            return [*fields, *self.writer.contact_fields, *histories]
        tables = [line for name in names for line in (f"*NODE PRINT, NSET={name}_REFERENCE, FREQUENCY=1000", "U",
                                                      f"*NODE PRINT, NSET={name}_NODES, TOTALS=ONLY, FREQUENCY=1000", "RF")]
        return [*tables, *fields, *(self.writer.contact_fields if self.body.pairs else ())]


def _refuse_items(body):
    if others := [item for item in body.items if not isinstance(item, (ContactPair, FacePressure))]:
        raise InputError(f"The body has an item {type(others[0]).__name__}, which decks do not take; leave it out, or put a "
                         "contact pair or a pressure in its place.")


def _refuse_equal_names(body):
    """Refuse regions and rigid objects, or frames, whose names are one in a deck: the second would take the place of the first."""
    rigid = [frame.name for frame in body.frames if frame.nodes.min() >= len(body.mesh.points)]
    for names in ([*body.mesh.regions, *rigid], [frame.name for frame in body.frames]):
        first: dict[str, str] = {}
        for name in names:
            if name_of(name) in first:
                raise InputError(f"The names {first[name_of(name)]!r} and {name!r} of regions and frames are both "
                                 f"{name_of(name)} in a deck; rename one.")
            first[name_of(name)] = name


def _normals(points, facets):
    a, b, c = (points[facets[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1)[:, None]


def name_of(name: str) -> str:
    """A name in the form of decks: capitals, digits and underscores, a letter first."""
    text = re.sub(r"\W", "_", name.upper(), flags=re.ASCII)
    return text if text[:1].isalpha() else f"N{text}"
