"""The pressed objects of a study: the catalogue, and each chosen object in its poses."""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.inputs import check_input
from softtact.studies.configuration import refuse_named_twice, refuse_unknown, validated
from softtact.studies.hybrid.keys import CENTRED, CatalogueEntry, ItemSet

if TYPE_CHECKING:
    from softtact.sensors.specification import SensorSpec


@dataclass(frozen=True)
class Item:
    """One object in one pose, i.e. one press."""

    id: str
    """Its name in paths."""
    set: str
    """indenters, unseen or grasps."""
    object: str
    """The object's name in the catalogue."""
    file: str
    """Its mesh."""
    unit: str
    """Of the mesh."""
    label: str
    """Its name for readers."""
    pose: list[float] | None
    """Six values as of `Pose.from_values`; None centres it over the sensor."""
    first: bool
    """Whether this is the object's first pose."""


def read_catalogue(path: Path) -> dict[str, CatalogueEntry]:
    """{name: CatalogueEntry} with paths of mesh files from the working folder. Raises InputError for a missing mesh."""
    lines = read_yaml(path, missing="there is no such catalogue of objects; correct 'objects.catalogue'.")
    if not isinstance(lines or [], list):
        raise InputError(f"{path}: it holds {lines!r:.40}; write a list of objects, as in config/objects/catalogue.yaml.")
    entries = [validated(CatalogueEntry, line, where=str(path)) for line in lines or []]
    entries = [entry.model_copy(update={"file": str(path.parent / entry.file)}) for entry in entries]
    catalogue = {entry.name: entry for entry in entries}
    if len(catalogue) < len(entries):
        names = [entry.name for entry in entries]
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path}: the object {twice!r} is listed twice; rename or remove one of the two.")
    return catalogue


def items_of_set(set_name: str, chosen: ItemSet, catalogue: dict[str, CatalogueEntry], *, spec: "SensorSpec",
                 seed: int) -> dict[str, Item]:
    """{id: Item} of one set: each object in its listed and drawn poses."""
    known = [name for name, entry in catalogue.items() if entry.set == set_name]
    names = known if chosen.names == "all" else chosen.names
    where = f"the configuration, at 'objects.{set_name}'"
    for name in names:
        refuse_unknown(name, known, kind=f"object of set {set_name}", where=where)
    refuse_named_twice(names, where=where)
    drawn = _dealt(chosen, len(names), where=where)
    items: dict[str, Item] = {}
    for entry, count in zip((catalogue[name] for name in names), drawn, strict=True):
        poses = chosen.poses | _drawn(entry, count, spec=spec, seed=seed)
        made = [make_item(entry, pose_name, pose, first=k == 0) for k, (pose_name, pose) in enumerate(poses.items())]
        items |= {item.id: item for item in made}
    return items


def make_item(entry: CatalogueEntry, pose_name: str, pose: list[float] | None, *, first: bool) -> Item:
    """The `Item` of a catalogue's entry in a named pose (6,), or None for the centred one."""
    _check_mesh(entry)
    suffix = "" if pose_name == CENTRED else f"-{pose_name}"
    return Item(entry.name + suffix, entry.set, entry.name, entry.file, entry.unit, entry.label + suffix, pose,
                first)


def check_shapes(items_of: dict[str, dict[str, Item]]) -> None:
    """Refuse a mesh in two sets, even under two names: a test must not contain a shape of the training."""
    seen: dict[bytes, Item] = {}
    for item in (item for items in items_of.values() for item in items.values() if item.first):
        check_input(item.file, "mesh")
        other = seen.setdefault(Path(item.file).read_bytes(), item)
        if other.set != item.set:
            raise InputError(f"{item.file}: {item.object!r} of the set {item.set} has the same mesh as {other.object!r} of the set "
                             f"{other.set}; leave one of the two out.")


def _dealt(chosen, objects, *, where):
    """Number of drawn poses of each object of a set, so that the set has the stated number of presses."""
    listed = objects * len(chosen.poses)
    more = (chosen.presses or listed) - listed
    if more < 0:
        raise InputError(f"{where}: presses is {chosen.presses}, and {objects} objects in {len(chosen.poses)} listed poses are "
                         f"{listed}; give that many or more, or leave 'presses' out.")
    return [more // objects + (k < more % objects) for k in range(objects)]


def _drawn(entry, count, *, spec, seed):
    """{"1": pose, ...} with `count` drawn poses of an object, which depend on the seed, its name and its mesh."""
    if not count:
        return {}
    from softtact.geometry.meshes import read_triangles
    from softtact.geometry.pose import draw_poses

    _check_mesh(entry)
    poses = draw_poses(read_triangles(entry.file, unit=entry.unit), count=count, footprint_mm=spec.footprint_mm,
                       seed=[seed, zlib.crc32(entry.name.encode())])
    return {str(k): pose for k, pose in enumerate(poses, start=1)}


def _check_mesh(entry):
    if not Path(entry.file).is_file():
        raise InputError(f"{entry.file}: there is no such mesh, which the catalogue lists for {entry.name!r}; "
                         "put it there or correct the line.")
