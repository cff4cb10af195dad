"""`softtact press` on a sensor of kind solid: its options, what is pressed, and what is told of it."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.commands import press_soft
from softtact.commands.common import origin, pairs, read_object, sensor_path
from softtact.commands.press_each import Column, last
from softtact.errors import ConvergenceError, InputError

if TYPE_CHECKING:
    from softtact.commands.press_each import Files
    from softtact.models.solid.result import SolidResult
    from softtact.sensors.solid import SolidSpec

# Options of the layered models, with their defaults and what serves in their place.
_LAYERED = {"policy": ("error", "leave it out"), "tolerance": (0.01, "leave it out"),
            "mesh_quality": ("default", "give a finer mesh to the sensor's file"),
            "plot": (None, "write --vtu, or --out and draw it with `softtact view --save`"), "full_scale": (False, "leave it out")}



def _force(axis: str) -> Column:
    place = "xyz".index(axis)
    return Column(f"force_{axis}_n", f"force {axis}, N", "12.4g", lambda summary: float(summary["load"][-1][place]))


COLUMNS = (*map(_force, "xyz"),
           Column("largest_displacement_mm", "most moved, mm", "16.4f", last("largest_displacement_mm")),
           Column("largest_pressure_mpa", "pressure, MPa", "15.4g", last("largest_pressure_mpa")))


def is_solid(sensor: str) -> bool:
    """Whether a sensor, by its name or its file, is of kind solid."""
    from softtact.sensors.solid import kind_of

    return bool(kind_of(sensor_path(sensor)) == "solid")


def spec_of(sensor: str) -> "SolidSpec":
    """What the file of such a sensor says."""
    from softtact.sensors.solid import SolidSpec

    return SolidSpec.from_yaml(sensor_path(sensor))


def refuse_idle(options: argparse.Namespace) -> None:
    """Refuse options that have no effect on a solid."""
    if options.model not in ("auto", "solid"):
        raise InputError(f"--model {options.model}: the solid model alone presses {options.sensor}, a sensor of kind solid; leave "
                         "it out.")
    for name, (default, remedy) in _LAYERED.items():
        if getattr(options, name) != default:
            raise InputError(f"--{name.replace('_', '-')} {getattr(options, name)}: it has no effect on a sensor of kind solid; "
                             f"{remedy}.")


def press_one(path: Path, files: "Files", label: str = "press", *, options: argparse.Namespace, spec: "SolidSpec", pose: Any,
              how: dict[str, Any], sensors: dict[str, Any]) -> tuple[dict[str, Any], BaseException | None]:
    """Summary of a mesh's press, whose files are written, and the error that ended it before its last load step or None.

    sensors: holds the sensor from the first press on
    """
    from dataclasses import replace

    import softtact
    from softtact.materials.cards import law_from_card, load_card

    mesh, repairs = read_object(options, path)
    if not sensors:
        laws = {region: law_from_card(load_card(card)) for region, card in pairs("--card", options.card)}
        sensors["own"] = softtact.load_solid_sensor(options.sensor, laws=laws, device=options.device)
    facts = {"sensor": spec.name, "mesh_repairs": "; ".join(repairs), **origin(options, path)}
    on_step = None if files.out is None else lambda result: replace(result, attributes=facts).write(files.out)
    pressed = press_soft.soft_object(options, mesh) if options.object_law else mesh
    error = None
    try:
        result = sensors["own"].press(pressed, pose=pose, **how, label=label, time_limit_s=options.time_limit, on_step=on_step)
    except (ConvergenceError, KeyboardInterrupt) as stop:
        result, error = getattr(stop, "result", None), stop
        if result is None:
            raise
    result = replace(result, attributes=facts)
    if files.out:
        result.write(files.out)
    if files.vtu:
        result.write_vtu(files.vtu)
    return _summary(result) | {"repairs": repairs, "written": [str(path) for path in (files.out, files.vtu) if path]}, error


def _summary(result: "SolidResult") -> dict[str, Any]:
    """What a press gave at each load step, as plain JSON values; what there is none of, nan, as null."""
    import numpy as np

    own = {"load": result.load("object"), "way_mm": result.frame_way_mm[:, result.frames.index("object")],
           "largest_displacement_mm": np.nanmax(np.linalg.norm(result.displacement_mm, axis=2), axis=1),
           "largest_pressure_mpa": np.nanmax(result.contact_pressure_mpa, axis=(1, 2))}
    names = ("volume_ratio_range", "stretch_range", "extrapolated_volume_fraction", "penetration_mm", "residual_n", "iterations",
             "increments", "reading_points_mm", "reading_displacement_mm", "reading_pressure_mpa", "wall_time_s")
    values = own | {name: getattr(result, name) for name in names}
    return {"model": "solid"} | {name: _plain(value.tolist()) for name, value in values.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if value != value else value


def lines(summary: dict[str, Any]) -> Iterator[str]:
    """What is printed of a summary."""
    yield f"{'force x, y, z, N':>33}{'way x, y, z, mm':>33}{'most moved, mm':>16}{'pressure, MPa':>15}"
    names = ("load", "way_mm", "largest_displacement_mm", "largest_pressure_mpa")
    for load, way, moved, pressure in zip(*(summary[name] for name in names), strict=True):
        yield "".join(f"{value:11.3g}" for value in (*load[:3], *way)) + f"{moved:16.4f}{pressure:15.4g}"
    if summary["reading_points_mm"]:
        yield "readings at the last step:"
        yield f"{'point x, y, z, mm':>33}{'displacement x, y, z, mm':>33}{'pressure, MPa':>15}"
        read = (summary[f"reading_{name}"][-1] for name in ("displacement_mm", "pressure_mpa"))
        for point, moved, pressure in zip(summary["reading_points_mm"], *read, strict=True):
            told = "-" if pressure is None else f"{pressure:.4g}"
            yield "".join(f"{value:11.3g}" for value in (*point, *moved)) + f"{told:>15}"
    yield f"iterations: {sum(summary['iterations'])}; deepest overlap in a contact: {1e3 * max(summary['penetration_mm']):.2g} um"
    yield f"largest unbalanced force: {max(summary['residual_n']):.2g} N"
    if None not in summary["extrapolated_volume_fraction"]:
        yield f"strained beyond the data behind its law: {max(summary['extrapolated_volume_fraction']):.1%} of a region"
    yield from (f"written: {path}" for path in summary["written"])
