"""One object pressed in several places with a fast model, each through all forces: what is loaded and started serves them all.

inputs: object (STL), compliance
outputs: press, a list;  settings: as for `simulate_press`, with `items`, one for each output, in place of `item`
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from softtact.errors import InputError, SofttactError
from softtact.geometry.meshes import read_mesh
from softtact.studies.hybrid.stages.simulate_press import make_sensor, names_of, pose_of, press_label


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press all, and write each as `simulate_press` would; nothing is written where one fails, which is named."""
    each = [{**_shared(settings), "item": item} for item in settings["items"]]
    if len(outputs["press"]) != len(each):
        raise InputError(f"{len(outputs['press'])} outputs 'press' for {len(each)} items; give one for each.")
    results = press_items(inputs, each, threads=threads)
    _refuse_failed(results, each)
    for path, result, one in zip(outputs["press"], results, each, strict=True):
        replace(result, attributes=result.attributes | names_of(one)).write(path, settings=one)


def press_items(inputs: dict[str, Any], each: Sequence[dict[str, Any]], *, threads: int) -> list[Any]:
    """A `PressResult`, or the error in its place, of each press; `each` differs from the first by its pose and name alone."""
    first = each[0]
    mesh = read_mesh(inputs["object"], unit=first["item"]["unit"])
    return make_sensor(inputs, first).press_many(
        mesh, [pose_of(one["item"]) for one in each], force_n=first["forces_n"], model=first["kind"], workers=threads,
        failures="keep", label=f"{press_label(first)} and {len(each) - 1} more")


def _shared(settings):
    return {name: value for name, value in settings.items() if name != "items"}


def _refuse_failed(results, each):
    failed = [number for number, result in enumerate(results) if isinstance(result, SofttactError)]
    if failed:
        error, more = results[failed[0]], f" ({len(failed) - 1} more of {len(each)} failed)" if failed[1:] else ""
        raise type(error)(f"{press_label(each[failed[0]])}: {error}{more}")
