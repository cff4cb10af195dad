"""`softtact calibrate`: a calibrated sensor from recordings of known presses."""

import argparse
import math
import sys
from pathlib import Path

from softtact.commands.common import (
    add_command,
    add_unit,
    check_names,
    check_pictures,
    report_reading,
    sensor_path,
    sensor_spec,
    show,
)
from softtact.errors import InputError
from softtact.inputs import refuse_twice
from softtact.outputs import check_outputs, refuse_overwriting

EXAMPLES = """
  softtact calibrate plate.csv --press plate.stl --unit mm --force 20 --out mine.yaml --report mine.html
  softtact calibrate plate.csv ball.csv --press plate.stl --press ball.stl --unit mm --force f1.csv --force f2.csv \\
      --place 0,0,0 --place 3,6,0 --fit placement,relaxation,modulus --out mine.yaml --report mine.html
  softtact press part.stl --unit mm --force 20 --sensor mine.yaml     # presses on the calibrated sensor
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "calibrate", _calibrate, "Calibrate a sensor from recordings of known presses.", EXAMPLES)
    command.add_argument("recordings", metavar="RECORDING", type=Path, nargs="+",
                         help="recordings of the maker's recorder (.csv), or ROS 2 bags (.mcap, folder), one press each")
    command.add_argument("--press", action="append", required=True, type=Path, metavar="OBJECT.stl",
                         help="what was pressed, lowest side down: one for all recordings, or one for each")
    add_unit(command)
    command.add_argument("--force", action="append", required=True, metavar="N|FILE",
                         help="N of a weight that is laid on and held, a log with time_s and force_n, or a ROS 2 bag (may be that "
                              "of the taxels); one for all, or for each")
    command.add_argument("--place", action="append", metavar="x,y,angle",
                         help="where the object lay over the sensor's middle, mm and degrees (default: 0,0,0); one for all, or for "
                              "each")
    command.add_argument("--topic", action="append", metavar="/NAME",
                         help="of a bag: the topic of the taxels, or of the force, where several fit; repeat it")
    command.add_argument("--finger", type=int, choices=(0, 1), default=0, help="which finger was pressed (default: 0)")
    command.add_argument("--baseline", choices=("auto", "subtracted", "kept"), default="auto",
                         help="how the recorder wrote it (default: found from the lowest readings)")
    command.add_argument("--fit", default="placement,relaxation", metavar="NAMES",
                         help="what is unknown beside gains and zeros: some of placement,relaxation,modulus,cover,friction, or "
                              "none (default: placement,relaxation); cover and friction are of the foundation model; cover "
                              "computes two more sensors, friction presses each object five times by the hyperelastic model (some "
                              "ten minutes each)")
    command.add_argument("--sensor", default="coro", help="name or YAML file of the sensor (default: coro)")
    command.add_argument("--model", choices=("foundation", "elastic"), default="foundation", help="model of the presses")
    command.add_argument("--candidate", action="append", type=Path, metavar="OBJECT.stl",
                         help="an object that could be pressed next: shows in which of five places it would help most; repeat it")
    command.add_argument("--hyperelastic-check", action="store_true",
                         help="press each object once by the hyperelastic model, too, and show how far its counts lie from the "
                              "calibrated ones (a minute each)")
    command.add_argument("--out", required=True, type=Path, metavar="SENSOR.yaml", help="the calibrated sensor's file to write")
    command.add_argument("--report", type=Path, metavar="FILE.html", help="a page with residuals of each taxel")


def _calibrate(options):
    given = _checked(options)
    spec = sensor_spec(options.sensor)
    fitted = () if options.fit == "none" else tuple(options.fit.split(","))
    from softtact.calibration.checks import check_recordings, check_result, quarters, rank
    from softtact.calibration.fit import calibrate, hyperelastic_differences
    from softtact.calibration.ladder import Presses, uncalibrated
    from softtact.calibration.problem import Problem
    from softtact.geometry.meshes import read_mesh

    sensor = uncalibrated(sensor_path(options.sensor))
    objects = [mesh for _, mesh, _, _ in given] + (options.candidate or [])
    meshes = {path: read_mesh(path, unit=options.unit) for path in dict.fromkeys(objects)}
    for path, mesh in meshes.items():
        report_reading(options, path, mesh.metadata["notes"])
    read = [_experiment(path, meshes[mesh], force, _place(place), options, spec) for path, mesh, force, place in given]
    experiments, notes = [one for one, _ in read], [note for _, notes_of_one in read for note in notes_of_one]
    problem = Problem(Presses(sensor, model=options.model), experiments, fitted)
    checks = check_recordings(problem)
    result = calibrate(problem)
    check_result(result)
    notes += _notes(problem, checks)
    candidates = [one for path in options.candidate or () for one in quarters(path.name, meshes[path], spec.footprint_mm)]
    advice = rank(result, candidates, largest_n=max(float(one.force_n.max()) for one in experiments)) if candidates else []
    differences = hyperelastic_differences(result) if options.hyperelastic_check else None
    _write(options, result, notes, advice)
    written = [str(path) for path in (options.out, options.report) if path]
    summary = _summary(result, notes, advice, differences) | {"written": written}
    show(summary, as_json=options.json, lines=_lines(summary))


def _checked(options):
    """(recording, mesh, force, place) of each recording as stated. Raises InputError for outputs that would overwrite an input."""

    check_outputs(options.out, options.report)
    check_names({options.out: (".yaml", ".yml"), options.report: (".html",)})
    check_pictures(options.report)
    refuse_twice(options.recordings)
    count = len(options.recordings)
    meshes, forces, places = (_for_each(name, getattr(options, name), count) for name in ("press", "force", "place"))
    logs = [force for force in forces if not _is_number(force)]
    refuse_overwriting([*options.recordings, *meshes, *logs, *(options.candidate or ()), sensor_path(options.sensor)],
                       {"--out": options.out, "--report": options.report})
    return list(zip(options.recordings, meshes, forces, places, strict=True))


def _write(options, result, notes, advice):
    """Write the calibrated sensor's file and, if requested, the page; print the notes."""
    from softtact.calibration.fit import write_calibrated

    write_calibrated(options.out, sensor_path(options.sensor), result)
    if options.report:
        from softtact.reporting.calibration_page import write_page

        write_page(options.report, result, notes=notes, advice=advice)
    for note in notes:
        print(f"softtact calibrate: {note}", file=sys.stderr)


def _for_each(name, values, count):
    """One value for each recording; a single value applies to all."""
    values = values or ["0,0,0"]
    if len(values) not in (1, count):
        raise InputError(f"--{name} was given {len(values)} times for {count} recordings; give it once for all, or once for each.")
    return values * count if len(values) == 1 else values


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def _place(text):
    try:
        x, y, angle = map(float, text.split(","))
        if not all(map(math.isfinite, (x, y, angle))):
            raise ValueError(text)
    except ValueError:
        raise InputError(f"--place {text}: it is not three finite numbers; write x,y,angle in mm and degrees.") from None
    return x, y, angle


def _experiment(path, mesh, force, place, options, spec):
    """The `Experiment` of a recording, and sentences on its faults."""
    from softtact.calibration.experiment import experiment
    from softtact.readout.checks.finding import left_out, refuse_unsafe, zeroed
    from softtact.readout.checks.recording import check_recording
    from softtact.readout.sources import recording_of, with_force_of

    recording = recording_of(path, baseline=options.baseline, topics=options.topic or ())
    held = float(force) if _is_number(force) else None
    if held is None:
        recording = with_force_of(recording, force, topics=options.topic or ())
    found = [one for one in check_recording(recording, largest=spec.largest_counts) if options.finger in one.fingers]
    refuse_unsafe(found)
    if held is None:
        recording = zeroed(recording, found)
    top = spec.force_range_n[1]
    largest = held if held is not None else float(recording.force_n.max())
    if not 0 < largest <= top:
        raise InputError(f"--force {force}: its largest force is {largest:g} N, and the sensor {spec.name} bears up to {top:g} N; "
                         "is it in grams or another unit? Give it in newtons.")
    made = experiment(recording, mesh, finger=options.finger, force_n=held, place=place, largest_counts=spec.largest_counts,
                      left_out=left_out(recording, found))
    return made, [*recording.attrs.get("notes", ()), *(one.sentence for one in found)]


def _notes(problem, checks):
    """Sentences on readings that are left out, and on an orientation that the recordings do not show."""
    for one, valid in zip(problem.experiments, problem.used_up_to_n, strict=True):
        if one.force_of_bins.max() > valid:
            yield (f"{one.name}: readings above {valid:.3g} N are left out, for which the {problem.presses.model} model is not "
                   "valid.")
    if not any(check.tells_orientation for check in checks):
        yield ("no press shows whether rows or columns are turned round; record one off the middle to be sure.")


def _summary(result, notes, advice, differences):
    shares, times = result.problem.creep(result.vector)
    return {"common_gain": result.linear.scale, "gain": (result.linear.gain / result.linear.scale).tolist(),
            "zero_counts": result.linear.zero.tolist(), "gain_deviation": result.gain_deviation.tolist(),
            "zero_deviation_counts": result.zero_deviation.tolist(), "relaxation": shares, "relaxation_s": times,
            "modulus_scale": result.modulus_scale if "ln modulus" in result.problem.names else None,
            "cover_mm": result.problem.value(result.vector, "cover", 1.0) * result.problem.presses.sensor.spec.cover.thickness_mm
            if "cover" in result.problem.names else None,
            "friction": result.problem.value(result.vector, "friction", 0.0) if "friction" in result.problem.names else None,
            "places": [result.problem.place(result.vector, k) for k in range(len(result.problem.experiments))],
            "misfit_over_noise": result.misfit, "not_identifiable": result.not_identifiable, "notes": notes,
            "hyperelastic_difference_counts": differences,
            "next_press": [{"object": one.candidate.name, "place": one.candidate.place, "force_n": one.largest_n,
                            "information_nats": one.information, "gain_deviation": one.gain_deviation} for one in advice]}


def _lines(summary):
    gains = [value for row in summary["gain"] for value in row]
    yield (f"common gain: {summary['common_gain']:.1f} counts at dC/C0 = 1; the taxels' gains are {min(gains):.3f} to "
           f"{max(gains):.3f} of it")
    if summary["modulus_scale"] is not None:
        yield f"modulus scale: {summary['modulus_scale']:.3f}"
    if summary["cover_mm"] is not None:
        yield f"cover: {summary['cover_mm']:.3f} mm thick"
    if summary["friction"] is not None:
        yield f"friction of the object on the cover: {summary['friction']:.2f}"
    for share, time in zip(summary["relaxation"], summary["relaxation_s"], strict=True):
        yield f"creep: a share of {share:.3f} in {time:.2f} s"
    for k, (x, y, angle) in enumerate(summary["places"], 1):
        yield f"press {k} lay at {x:.2f}, {y:.2f} mm, {angle:.1f} degrees"
    yield f"misfit: {summary['misfit_over_noise']:.2f} times the noise"
    yield from (f"left open by these presses: {sentence}" for sentence in summary["not_identifiable"])
    for press, counts in enumerate(summary["hyperelastic_difference_counts"] or (), 1):
        yield (f"the hyperelastic model lies {counts:.1f} counts away from press {press} (root mean square)" if counts is not None
               else f"press {press} was not checked: the hyperelastic model does not reach a force for which the other is valid")
    for one in summary["next_press"][:3]:
        place = ", ".join(f"{value:g}" for value in one["place"])
        yield (f"next press: {one['object']} at {place} up to {one['force_n']:.3g} N adds {one['information_nats']:.2f} nats; "
               f"gains then within {one['gain_deviation']:.2%}")
    yield from (f"written: {path}" for path in summary["written"])
