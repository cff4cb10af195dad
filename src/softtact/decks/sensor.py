"""A press on a sensor, or on any layered body, as an input deck on disk.

    export_press(sensor, mesh, force_n=[5, 20], dialect="calculix", path="press.inp")
    write_deck("cell.inp", deck_model(body, placed, forces_n=[0.1]), dialect="abaqus")

The object moves along z only. Friction is written where the sensor has it: CalculiX's stick slope lets a point slide after our slip
tolerance at 1 MPa, earlier at less. Each step repeats the held nodes, so that a force can release the object.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.decks import keywords
from softtact.decks.dialects import STIFF_MATERIAL, Dialect, contact_pair, dialect_of, tetrahedra_behind
from softtact.decks.model import DeckModel, ObjectStep, RigidSurface, deck_model
from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

CONTROLS = ("force", "indentation")
_INCREMENTS = f"{0.1}, 1, {1e-6}, {0.25}"     # of a step: the first, the whole, the smallest, the largest
_STICK_PRESSURE_MPA = 1.0                     # pressure at which friction in CalculiX is as stiff as ours
_TABLES = {"calculix": ("*NODE PRINT, NSET=OBJECT_REFERENCE, FREQUENCY=1000", "U",
                        "*NODE PRINT, NSET=OBJECT_NODES, TOTALS=ONLY, FREQUENCY=1000", "RF",
                        "*NODE PRINT, NSET=BOARD_NODES, TOTALS=ONLY, FREQUENCY=1000", "RF",
                        "*NODE PRINT, NSET=INTERFACE, FREQUENCY=1000", "U"),
           "abaqus": ("*NODE OUTPUT, NSET=OBJECT_REFERENCE", "U3, RF3", "*NODE PRINT, NSET=INTERFACE, FREQUENCY=1000", "U3")}


def deck_text(model: DeckModel, *, dialect: str, slab_element: str | None = None, frustum_element: str | None = None) -> str:
    """The deck of a `DeckModel`;  slab_element, frustum_element: types of bricks in place of the dialect's choice."""
    writer = dialect_of(dialect)
    for kind in (slab_element, frustum_element):
        if kind not in (None, *writer.elements):
            raise InputError(f"The element {kind!r} is none for {writer.program}; use one of {', '.join(writer.elements)}.")
    slab, frusta = slab_element or writer.slab, frustum_element or writer.frusta
    kinds = {part.name: frusta if part.name == "FRUSTA" else slab for part in model.parts}
    lines = keywords.heading(model.title, writer.program, model.remarks) + _rubber(model, kinds, writer)
    lines += keywords.equations((tie.slave, tie.masters, tie.weights) for tie in model.ties)
    rigid, reference, fixed = _rigid_bodies(model, writer)
    lines += rigid + _contacts(model, writer)
    fixed = [f"{node + 1}, {component + 1}, {component + 1}" for node, component in model.held] + fixed
    tables = _TABLES[dialect]
    output = ([*writer.fields, *writer.contact_fields, *tables] if writer.facets_are_rigid
              else [*tables, *writer.fields, *writer.contact_fields])
    for k, step in enumerate(model.steps):
        lines += [*writer.step(step.name, _INCREMENTS, first=k == 0), *fixed, *_drive(step, reference), *output, "*END STEP"]
    return "\n".join(lines) + "\n"


def _rubber(model: DeckModel, kinds: dict[str, str], writer: Dialect) -> list[str]:
    """Nodes, elements, sets, laws and surfaces of the rubber; kinds: type of the bricks by part."""
    lines = keywords.nodes(model.points, 1, name="RUBBER")
    for part in model.parts:
        lines += keywords.elements(kinds[part.name], part.name, part.hex_elements + 1, part.hexes + 1)
        if len(part.wedges):
            lines += keywords.elements(writer.wedge, part.name, part.wedge_elements + 1, part.wedges + 1)
    for name, members in model.node_sets.items():
        lines += keywords.node_set(name, np.asarray(members) + 1)
    for part in model.parts:
        card = keywords.law_card(part.law, no_term=writer.no_term, dialect=writer.program)
        lines += keywords.material(f"RUBBER_{part.name}", card)
        lines += [f"*SOLID SECTION, ELSET={part.name}, MATERIAL=RUBBER_{part.name}"]
    for name, faces in model.surfaces.items():
        lines += keywords.surface(name, np.asarray(faces) + [1, 0])
    return lines


def _rigid_bodies(model: DeckModel, writer: Dialect) -> tuple[list[str], int | None, list[str]]:
    """Lines of the rigid bodies, the number of the moving one's reference node, and *BOUNDARY rows of fixed nodes."""
    lines: list[str] = [] if writer.facets_are_rigid else list(STIFF_MATERIAL)
    fixed: list[str] = []
    moving, node, element = None, len(model.points) + 1, sum(len(part.elements) for part in model.parts) + 1
    for body in model.rigid:
        rows, reference, count = _rigid_body(body, node, element, writer)
        lines += rows
        if writer.facets_are_rigid:
            fixed += [f"{reference}, 1, 2", f"{reference}, 4, 6"] if body.moves else [f"{reference}, 1, 6"]
        else:
            fixed += [f"{body.name}_NODES, 1, 2", f"{reference}, 1, 2"] if body.moves else [f"{body.name}_NODES, 1, 3"]
        moving = reference if body.moves else moving
        node, element = node + count, element + len(body.facets)
    return lines, moving, fixed


def _rigid_body(body: RigidSurface, node: int, element: int, writer: Dialect) -> tuple[list[str], int, int]:
    """Lines of a rigid body whose nodes and elements are numbered from `node` and `element`, its reference node, its node count."""
    points, facets = (body.points, body.facets) if writer.facets_are_rigid else tetrahedra_behind(body.points, body.facets)
    numbers, reference = np.arange(element, element + len(facets)), node + len(points)
    lines = keywords.nodes(points, node, name=f"{body.name}_NODES")
    named = keywords.nodes([points.mean(axis=0)], reference, name=f"{body.name}_REFERENCE")
    elements = writer.rigid_facets(body.name, numbers, facets + node, reference)
    if writer.facets_are_rigid:
        return lines + named + elements, reference, len(points) + 1
    if not body.moves:
        return lines + elements, reference, len(points)
    return lines + elements + named + keywords.moving_along(range(node, reference), reference, 3), reference, len(points) + 1


def _contacts(model: DeckModel, writer: Dialect) -> list[str]:
    """Contact laws and pairs. A rigid body NAME has the surface NAME_SURFACE."""
    lines, rigid = [], {body.name for body in model.rigid}
    for pair in model.contacts:
        laws, law = writer.contact(pair.contact), pair.friction
        if law:
            slope = law.coefficient * _STICK_PRESSURE_MPA / law.slip_tolerance_mm
            laws += writer.friction(law.coefficient, stick_slope=slope, slip_mm=law.slip_tolerance_mm)
        lines += contact_pair(pair.name, laws, pair.slave, f"{pair.master}_SURFACE" if pair.master in rigid else pair.master)
    return lines


def _drive(step: ObjectStep, reference: int | None) -> list[str]:
    """Lines that move or load the object's reference node in a step."""
    value = keywords.number(-step.value)
    return [f"{reference}, 3, 3, {value}"] if step.control == "indentation" else ["*CLOAD", f"{reference}, 3, {value}"]


def write_deck(path: str | Path, model: DeckModel, *, dialect: str, **elements: str) -> None:
    """Write the deck whole, or not at all."""
    text = deck_text(model, dialect=dialect, **elements)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="ascii")


def export_press(sensor: "Sensor", mesh: trimesh.Trimesh, *, force_n: float | Sequence[float], dialect: str, path: str | Path,
                 pose: Pose | None = None, control: str = "force", name: str = "object", **elements: str) -> DeckModel:
    """Write the hyperelastic press of a mesh (trimesh, mm) on a `Sensor` as a deck, and return its `DeckModel`.

    force_n: N, one or an increasing list. control: "force" loads with these forces; "indentation" prescribes the indentations of
    our solution at these forces, which is solved first, so that the forces can be compared.
    """
    if control not in CONTROLS:
        raise InputError(f"The control {control!r} is unknown; use one of {', '.join(CONTROLS)}.")
    forces: Any = sensor.checked_forces(force_n)
    placed = place(mesh, pose=pose)
    check_over_sensor(placed, sensor.spec.footprint_mm, name=name)
    steps = {"forces_n": forces}
    if control == "indentation":
        result = sensor.press(mesh, pose=pose, force_n=forces, model="hyperelastic", label="export-deck")
        steps = {"indentations_mm": result.indentation_mm}
    title = f"{_ascii(name)} on sensor {_ascii(sensor.spec.name)}"
    model = deck_model(sensor.body(surface=HeightField(placed)), placed, title=title, **steps)
    write_deck(path, model, dialect=dialect, **elements)
    return model


def _ascii(text):
    return text.encode("ascii", "replace").decode()
