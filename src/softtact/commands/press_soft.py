"""The options of `softtact press` for a soft object: its law, the size of its elements, and what holds it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.errors import InputError

if TYPE_CHECKING:
    import trimesh

    from softtact.press.soft_object import SoftObject

_HELD = 0.3     # default share of the height


def add_options(command: argparse.ArgumentParser) -> None:
    """Add the options to the command."""
    soft = command.add_argument_group("soft objects")
    soft.add_argument("--object-law", type=Path, metavar="CARD.json",
                      help="card of `softtact fit` of the object, which then bends as the sensor does (model solid)")
    soft.add_argument("--object-size", type=float, metavar="MM", help="length of the object's elements in mm")
    soft.add_argument("--object-held", type=float, default=_HELD, metavar="SHARE",
                      help=f"share of the object's height, from the top, that a rigid holder carries (default: {_HELD:g})")


def check(options: argparse.Namespace, *, solid: bool = False) -> None:
    """Refuse options of a soft object that lack each other, or that the solid model does not know.

    solid: whether the sensor is a solid itself, on which rigid objects are pressed by the same model
    """
    if options.object_law is None:
        if options.object_size is not None or options.object_held != _HELD:
            raise InputError("--object-size and --object-held have no effect on a rigid object; add --object-law CARD.json.")
        if options.model == "solid" and not solid:
            raise InputError("--model solid: it presses soft objects; add --object-law CARD.json, or choose another model.")
        return
    if options.object_size is None:
        raise InputError(f"--object-law {options.object_law}: give --object-size MM, the length of the object's elements.")
    if options.model not in ("auto", "solid"):
        raise InputError(f"--model {options.model}: a soft object is pressed by the solid model alone; leave it out.")
    for name, default in (("mesh_quality", "default"), ("device", "cpu"), ("policy", "error")):
        if getattr(options, name) != default and not (solid and name == "device"):
            given = f"--{name.replace('_', '-')} {getattr(options, name)}"
            raise InputError(f"{given}: it has no effect on a soft object; leave it out.")


def arguments(options: argparse.Namespace, mesh: "trimesh.Trimesh", *, keep_body: bool) -> tuple[Any, dict[str, Any]]:
    """What `Sensor.press` presses, and the arguments that only a rigid or only a soft object has."""
    if options.object_law is None:
        return mesh, {"keep_body": keep_body, "keep_object": True}
    return soft_object(options, mesh), {"keep_body": keep_body}


def soft_object(options: argparse.Namespace, mesh: "trimesh.Trimesh") -> "SoftObject":
    """The `SoftObject` of a mesh (mm) with the law, size and held share of the command line."""
    from softtact.fem.body_mesh import mesh_body
    from softtact.materials.cards import law_from_card, load_card
    from softtact.press.soft_object import SoftObject

    body = mesh_body(mesh, size_mm=options.object_size)
    return SoftObject(body, law_from_card(load_card(options.object_law)), held_share=options.object_held)
