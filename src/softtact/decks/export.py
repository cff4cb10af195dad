"""A press on a sensor, or on any layered body, as an input deck on disk.

    export_press(sensor, mesh, force_n=[5, 20], dialect="calculix", path="press.inp")
    write_deck("cell.inp", deck_model(body, placed, forces_n=[0.1]), dialect="abaqus")
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import trimesh

from softtact.contact.height_field import HeightField
from softtact.decks import abaqus, calculix
from softtact.decks.model import DeckModel, deck_model
from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

DIALECTS = {"calculix": calculix, "abaqus": abaqus}
CONTROLS = ("force", "indentation")


def deck_text(model: DeckModel, *, dialect: str, **elements: str) -> str:
    """The deck of a `DeckModel`. `elements`: slab_element, frustum_element to replace the dialect's own choice."""
    if dialect not in DIALECTS:
        raise InputError(f"The format {dialect!r} is unknown; use one of {', '.join(DIALECTS)}.")
    writer = DIALECTS[dialect]
    for kind in elements.values():
        if kind not in writer.ELEMENTS:
            raise InputError(f"The element {kind!r} is none for {writer.PROGRAM}; use one of {', '.join(writer.ELEMENTS)}.")
    return "\n".join(writer.deck_lines(model, **elements)) + "\n"


def write_deck(path: str | Path, model: DeckModel, *, dialect: str, **elements: str) -> None:
    """Write the deck whole, or not at all."""
    text = deck_text(model, dialect=dialect, **elements)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="ascii")


def export_press(sensor: "Sensor", mesh: trimesh.Trimesh, *, force_n: float | Sequence[float], dialect: str, path: str | Path,
                 pose: Pose | None = None, control: str = "force", name: str = "object", **elements: str) -> DeckModel:
    """Write the hyperelastic press of a mesh (trimesh, mm) on a `Sensor` as a deck, and return its `DeckModel`.

    force_n: N, one or an increasing list. control: "force" pushes with these forces; "indentation" lets the object follow the
    indentations that our own solution has at them, which is solved first, and leaves the forces to be compared.
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
