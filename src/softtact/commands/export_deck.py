"""`softtact export-deck`: a press as an input file of another solver."""

import argparse
from pathlib import Path

import softtact
from softtact.commands.common import (
    add_command,
    add_mesh,
    add_repair,
    any_sensor_spec,
    check_forces,
    pose_of,
    read_object,
    sensor_path,
    sensor_spec,
    show,
)
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

EXAMPLES = """
  softtact export-deck part.stl --unit mm --force 5 --format calculix --out press.inp
  softtact export-deck part.stl --unit mm --force 5 --force 20 --format abaqus --out press.inp
"""
DECK_FORMATS = ("calculix", "abaqus")


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "export-deck", _export_deck,
                           "Write the hyperelastic press of a mesh, or one on a solid, as an input deck for another solver.",
                          EXAMPLES)
    add_mesh(command)
    add_repair(command)
    command.add_argument("--force", type=float, action="append", required=True, metavar="N",
                         help="force in N; repeat it for several steps")
    command.add_argument("--format", choices=DECK_FORMATS, required=True, help="the solver that is to read the deck")
    command.add_argument("--control", choices=("force", "indentation"), default="force",
                         help="push with the forces (default), or follow the indentations that softtact finds at them, "
                              "which it solves first")
    command.add_argument("--out", type=Path, required=True, metavar="DECK.inp", help="the deck to write")


def _export_deck(options):
    spec = any_sensor_spec(options.sensor)
    if not spec.has_layers and spec.kind != "solid":
        raise InputError(f"{spec.name} is a sensor of kind {spec.kind}, of which there is no deck; name one of layers, or of kind "
                         "solid.")
    return (_export_layered if spec.has_layers else _export_solid)(options)


def _export_solid(options):
    """The deck of a press on a sensor of kind solid."""
    from softtact.contact.motion import Motion
    from softtact.decks.solid import export_solid
    from softtact.press.solid import body_of

    spec, forces, pose = any_sensor_spec(options.sensor), sorted(set(options.force)), pose_of(options)
    check_forces(forces, spec)
    check_outputs(options.out)
    refuse_overwriting([options.mesh, sensor_path(options.sensor), *spec.paths], {"--out": options.out})
    mesh, repairs = read_object(options, options.mesh)
    sensor, motion = softtact.load_sensor(options.sensor), Motion().press(force_n=forces)
    if options.control == "indentation":
        found = sensor.press(mesh, pose=pose, motion=motion, label="export-deck").frame_way_mm[:, 0, 2]
        motion = Motion().press(depth_mm=(-found).tolist())
    body = body_of(sensor, mesh, pose, motion)
    export_solid(options.out, body, {"object": motion}, dialect=options.format, title=f"{options.mesh.name} on {spec.name}")
    result = {"deck": str(options.out), "format": options.format, "nodes": len(body.mesh.points),
              "elements": {region: sum(len(nodes) for name, _, nodes in body.mesh.cells if name == region)
                           for region in body.mesh.regions},
              "facets": {"object": len(body.surface_nodes("object"))},
              "steps": [f"step_{number}" for number in range(1, len(forces) + 1)], "repairs": repairs}
    _show(result, options)


def _export_layered(options):
    """The deck of the hyperelastic press on layers."""
    from softtact.geometry.meshes import check_over_sensor, place

    spec, forces, pose = sensor_spec(options.sensor), sorted(set(options.force)), pose_of(options)
    spec.need_frusta("export-deck", "name a sensor of kind frusta")
    check_forces(forces, spec)
    check_outputs(options.out)
    refuse_overwriting([options.mesh, sensor_path(options.sensor)], {"--out": options.out})
    mesh, repairs = read_object(options, options.mesh)
    check_over_sensor(place(mesh, pose=pose), spec.footprint_mm, name=str(options.mesh))
    from softtact.decks.sensor import export_press

    model = export_press(softtact.load_sensor(options.sensor), mesh, pose=pose, force_n=forces, control=options.control,
                         dialect=options.format, path=options.out, name=options.mesh.name)
    result = {"deck": str(options.out), "format": options.format, "nodes": len(model.points),
              "elements": {part.name: len(part.elements) for part in model.parts}, "tied_nodes": len(model.ties),
              "facets": {body.name: len(body.facets) for body in model.rigid}, "steps": [step.name for step in model.steps],
              "repairs": repairs}
    _show(result, options)


def _show(result, options):
    lines = [f"{name}: {value}" for name, value in result.items() if name != "deck" and value != []]
    show(result, as_json=options.json, lines=[*lines, f"written: {options.out}"])
