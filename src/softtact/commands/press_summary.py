"""What `softtact press` tells of a press: the numbers for --json, and lines for people, those of the solver with --verbose."""

from collections.abc import Iterator
from typing import Any

from softtact.commands.press_gel import gel_lines
from softtact.words import plain


def summary_on_layers(result: Any) -> dict[str, Any]:
    """The results of a press on layers at each load step, as plain JSON values."""
    load_steps = {"normal_force_n": result.normal_force_n, "force_n": result.force_n, "indentation_mm": result.indentation_mm,
                  "contact_area_mm2": result.contact_area_mm2,
                  "largest_deformation_mm": result.deformation_map_mm.max(axis=(1, 2))}
    if "taxels" in result.readings:
        load_steps |= {"tactile_map": result.tactile_map, "taxels_at_range_end": result.taxels_at_range_end}
    names = ("penetration_mm", "frustum_compression_mm", "residual_n", "extrapolated_volume_fraction", "expected_error_mm",
             "within_validity", "validity_reason", "iterations", "wall_time_s", "torque_nmm", "hyperelastic_counts",
             "expected_error_counts")
    load_steps |= {name: getattr(result, name) for name in names}
    facts = {name: getattr(result, name) for name in ("model", "solver", "selection_reason", "sensor", "largest_counts")}
    facts["expected_error_interval"] = ([result.attributes[f"expected_error_times_{end}"] for end in ("low", "high")]
                                        if "expected_error_times_low" in result.attributes else None)
    facts["expected_error_calibrated_on"] = result.attributes.get("expected_error_calibrated_on")
    if result.edge_radius_mm is not None:
        load_steps["edge_radius_mm"] = result.edge_radius_mm
    return facts | _times(result) | {name: or_none(values) for name, values in load_steps.items()}


def summary_on_solids(result: Any) -> dict[str, Any]:
    """The results of a press on a sensor of kind solid at each load step, as plain JSON values."""
    import numpy as np

    values = {"load": result.load("object"), "way_mm": result.frame_way_mm[:, result.frames.index("object")],
              "largest_displacement_mm": np.nanmax(np.linalg.norm(result.displacement_mm, axis=2), axis=1),
              "largest_pressure_mpa": np.nanmax(result.contact_pressure_mpa, axis=(1, 2))}
    names = ("volume_ratio_range", "stretch_range", "extrapolated_volume_fraction", "penetration_mm", "residual_n", "iterations",
             "increments", "reading_points_mm", "reading_displacement_mm", "reading_pressure_mpa", "wall_time_s", "normal_force_n",
             "within_validity", "validity_reason")
    numbers = values | {name: getattr(result, name) for name in names}
    facts = {"model": result.model, "solver": result.solver, "sensor": result.sensor}
    return facts | _times(result) | {name: or_none(value) for name, value in numbers.items()}


def or_none(values: Any) -> list[Any]:
    """Numbers as lists, with null for nan, which JSON does not have; nan marks values that a model does not compute."""
    if values.ndim > 1:
        return [or_none(row) for row in values]
    return [None if value != value else value for value in values.tolist()]


def _times(result):
    """The steps' times, where they have durations."""
    return {} if result.time_s is None else {"time_s": or_none(result.time_s)}


def lines_on_layers(summary: dict[str, Any], *, verbose: bool) -> Iterator[str]:
    """Lines for people of a summary of a press on layers."""
    yield f"{summary['model']} model on {summary['sensor']}"
    if summary["selection_reason"]:
        yield f"chosen because: {summary['selection_reason']}"
    yield from _table_on_layers(summary) if "tactile_map" in summary else gel_lines(summary)
    yield from _sure_lines(summary)
    if verbose:
        yield from _solver_lines(summary)
    yield from (f"written: {path}" for path in summary["written"])


def _table_on_layers(summary):
    """A line a load step: force, depth, contact, counts, those of the hyperelastic model where they are foreseen, validity."""
    head, times = _time_column(summary)
    foreseen = None not in [one[1] for one in summary["hyperelastic_counts"]]
    yield (f"{head}{'force, N':>10}{'depth, mm':>12}{'contact, mm2':>14}{'most deformed, mm':>19}{'counts':>9}"
           + f"{'counts if hyperelastic':>26}" * foreseen + f"{'valid':>7}")
    names = ("normal_force_n", "indentation_mm", "contact_area_mm2", "largest_deformation_mm", "within_validity")
    for step, time in enumerate(times):
        force, depth, area, deepest, valid = (summary[name][step] for name in names)
        total, (low, middle, high) = sum(map(sum, summary["tactile_map"][step])), summary["hyperelastic_counts"][step]
        expected = f"{f'{middle:.0f} ({low:.0f} to {high:.0f})':>26}" if foreseen else ""
        yield (f"{time}{plain(force, 4):>10}{depth:12.3f}{area:14.1f}{deepest:19.3f}{total:9.0f}{expected}"
               f"{'yes' if valid else 'no':>7}")


def _time_column(summary):
    """Head and cells of a column of the steps' times; without durations empty."""
    times = summary.get("time_s")
    return (f"{'time, s':>10}", [f"{plain(time, 4):>10}" for time in times]) if times else ("", [""] * len(summary["iterations"]))


def _sure_lines(summary):
    """How sure the numbers are."""
    if None not in summary["expected_error_mm"]:
        yield from error_line(summary)
    yield from range_line(summary)
    yield from edge_line(summary)
    yield from validity_lines(summary)
    yield from _extrapolated_line(summary, of="a layer")


def error_line(summary: dict[str, Any]) -> Iterator[str]:
    """The expected error of a fast model against the hyperelastic model, with an interval for the true error."""
    interval, expected = summary["expected_error_interval"], max(summary["expected_error_mm"])
    if interval is None:
        return
    low, high = (plain(factor * expected, 2) for factor in interval)
    known_of = summary["expected_error_calibrated_on"]
    other = f"; calibrated on the sensor {known_of}, not on {summary['sensor']}" if known_of != summary["sensor"] else ""
    yield (f"error to expect against the hyperelastic model: {plain(expected, 2)} mm ({low} to {high}), root mean square over the "
           f"map{other}")


def range_line(summary: dict[str, Any]) -> Iterator[str]:
    """The load steps at which taxels read the end of the converter's range: there the true change is larger than the counts."""
    numbers = summary.get("taxels_at_range_end", [])
    if any(numbers):
        steps = ", ".join(f"{number:g} at {plain(force, 4)} N"
                          for number, force in zip(numbers, summary["normal_force_n"], strict=True) if number)
        yield f"taxels at the end of the converter's range ({summary['largest_counts']:g} counts), which read too little: {steps}"


def edge_line(summary: dict[str, Any]) -> Iterator[str]:
    """The load steps in which the object's edges were rounded, and by how much."""
    radii = summary.get("edge_radius_mm", [])
    if any(radii):
        forces = ", ".join(plain(force, 4) for force, radius in zip(summary["normal_force_n"], radii, strict=True) if radius)
        yield (f"edges of the object rounded by {plain(max(radii), 3)} mm at {forces} N: sharper ones would have folded the "
               "cover's elements; a finer mesh may bear them. Under corners the cover may have several balances: by other load "
               "steps single points of a map came out up to 21 % of its maximum apart, counts 2 %")


def validity_lines(summary: dict[str, Any]) -> Iterator[str]:
    """The forces of the flagged load steps, a line for each reason."""
    from softtact.press.validity import by_reason

    for reason, forces in by_reason(*(summary[name] for name in ("normal_force_n", "within_validity", "validity_reason"))).items():
        yield f"beyond what the model is valid for: {', '.join(plain(force, 4) for force in forces)} N: {reason}"


def _extrapolated_line(summary, *, of):
    shares = summary["extrapolated_volume_fraction"]
    if None not in shares and max(shares) > 0:
        yield f"strained beyond the data behind its law: {max(shares):.1%} of {of}"


def _solver_lines(summary):
    """How the solver did, as the worst of the load steps."""
    yield f"linear solver: {summary['solver']}; iterations: {sum(summary['iterations'])}"
    yield f"deepest overlap in a contact: {plain(max(summary['penetration_mm']), 2)} mm"
    if None not in summary["residual_n"]:
        yield f"largest unbalanced force of a node: {plain(max(summary['residual_n']), 2)} N"
    if None not in summary.get("frustum_compression_mm", [None]):
        yield f"most compressed frustum: {max(summary['frustum_compression_mm']):.3f} mm"


def lines_on_solids(summary: dict[str, Any], *, verbose: bool) -> Iterator[str]:
    """Lines for people of a summary of a press on a sensor of kind solid."""
    yield f"{summary['model']} model on {summary['sensor']}"
    head, times = _time_column(summary)
    yield f"{head}{'force x, y, z, N':>33}{'displacement x, y, z, mm':>33}{'most moved, mm':>16}{'pressure, MPa':>15}"
    names = ("load", "way_mm", "largest_displacement_mm", "largest_pressure_mpa")
    for time, load, displacement, moved, pressure in zip(times, *(summary[name] for name in names), strict=True):
        yield time + _row((*load[:3], *displacement)) + f"{moved:16.4f}{plain(pressure, 4):>15}"
    if summary["reading_points_mm"]:
        yield "readings at the last step:"
        yield f"{'point x, y, z, mm':>33}{'displacement x, y, z, mm':>33}{'pressure, MPa':>15}"
        read = (summary[f"reading_{name}"][-1] for name in ("displacement_mm", "pressure_mpa"))
        for point, displacement, pressure in zip(summary["reading_points_mm"], *read, strict=True):
            yield _row((*point, *displacement)) + f"{'-' if pressure is None else plain(pressure, 4):>15}"
    for name, values in summary["readings"].items():
        if not isinstance(values[-1], list) or not isinstance(values[-1][0], list):
            numbers = values[-1] if isinstance(values[-1], list) else [values[-1]]
            yield f"{name} at the last step: {', '.join('-' if one is None else plain(one, 4) for one in numbers)}"
    yield from validity_lines(summary)
    yield from _extrapolated_line(summary, of="a region")
    if verbose:
        yield from _solver_lines(summary)
    yield from (f"written: {path}" for path in summary["written"])


def _row(values):
    """Numbers in columns of 11, those that are only rounding as 0."""
    return "".join(f"{plain(value, 3) if abs(value) > 5e-7 else '0':>11}" for value in values)
