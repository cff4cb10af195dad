"""Summary of all grasps of a study: table, the paper's claims, figures, report."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.files import read_csv, read_dataset, write_csv
from softtact.press.plot import around_points
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import trimesh
    import xarray
    from matplotlib.figure import Figure

GRIP = 1     # number of the event `grip` in `softtact.robot.events.EVENTS`
_MOST_COLUMNS = 6
_SHOWN = ["grasp", "status", "x_mm", "y_mm", "angle_deg", "trials", "force_left_n", "force_right_n", "model_grip_left",
          "model_grip_right", "deepest_left_mm", "deepest_right_mm", "counts_left", "counts_right",
          "at_range_end_left", "at_range_end_right", "trial_sd_left_counts", "trial_sd_right_counts", "message"]


def tabulate_grasps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write a row for each grasp, and the verdict on each of the paper's claims.

    inputs: events, readings, objects (lists, in the grasps' order), compared (list), sensor (YAML);  outputs: table, claims (CSV)
    settings: items [{grasp, object, unit, x_mm, y_mm, angle_deg}, ...], force_n, policy, model
    """
    from softtact.geometry.meshes import read_mesh
    from softtact.sensors.specification import read_spec
    from softtact.studies.grasps.claims import claims_of_grasps

    spec = read_spec(inputs["sensor"])
    rows = []
    files = (inputs[name] for name in ("events", "readings", "objects"))
    for item, events, readings, mesh in zip(settings["items"], *files, strict=True):
        row = {name: item[name] for name in ("grasp", "object", "x_mm", "y_mm", "angle_deg")}
        data = read_dataset(events)
        rows.append(row | ({"status": "failed", "message": data.attrs["failed"]} if "failed" in data.attrs else
                           _facts(data, read_dataset(readings), read_mesh(mesh, unit=item["unit"]), spec)))
    table = pd.DataFrame(rows)
    write_csv(outputs["table"], table)
    write_csv(outputs["claims"], claims_of_grasps(table, _compared(inputs), force_n=settings["force_n"], policy=settings["policy"],
                                                  model=settings["model"]))


def draw_grasped_objects(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the first successful grasp of each object: the hand, and maps and readings of both sensors.

    inputs: events, readings, objects (lists, in the grasps' order), sensor (YAML), materials;  outputs: png
    settings: items, mesh, scene
    """
    events, readings, files = {}, {}, {}
    for item, *paths in zip(settings["items"], inputs["events"], inputs["readings"], inputs["objects"], strict=True):
        data = read_dataset(paths[0])
        if "failed" not in data.attrs and item["object"] not in events:
            events[item["object"]], readings[item["object"]] = data, read_dataset(paths[1])
            files[item["object"]] = (paths[2], item["unit"])
    _draw_objects(outputs["png"], events, readings, dict(_pictures(events, files, inputs["sensor"], settings)))


def draw_one_event(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the maps of several models for one event: a row for each object, with one scale per row.

    inputs: compared (list);  outputs: png
    """
    compared = _compared(inputs)
    models = max(data.sizes["model"] for data in compared.values())
    figure: Figure = pyplot().figure(figsize=(2.6 * models + 0.6, 3.4 * len(compared)), layout="constrained")
    grid = figure.subplots(len(compared), models, squeeze=False)
    for axes, (name, data) in zip(grid, compared.items(), strict=True):
        extent = around_points(data.x, data.y)
        deepest = float(data.deformation_map_mm.max())
        for place, model, values, share in zip(axes, data.model.values, data.deformation_map_mm.values, data.lower_share.values,
                                               strict=True):
            image = place.imshow(values, origin="lower", extent=extent, vmin=0, vmax=deepest, cmap="viridis")
            place.set_title(f"{name.replace('_', ' ')}, {model}\nlower feature: {share:z.2f} of the raised", fontsize=8)
            place.set_xlabel("x (mm)"), place.set_ylabel("y (mm)")
        figure.colorbar(image, ax=list(axes), label="towards the PCB (mm)", shrink=0.8)
    save(figure, outputs["png"])


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page.  inputs: table, claims, figures (list);  outputs: page;  settings: study, captions, config."""
    from softtact.reporting.page import Page, counted

    grasps = read_csv(inputs["table"])
    page = Page("Grasps by a robot: the study", settings["study"], folder=outputs["page"].parent)
    claims = read_csv(inputs["claims"], keep_default_na=False)
    done, *care = _result(grasps)
    page.opening(asked="What do the two sensors of a gripper read while a robot grasps objects in simulation, and does the paper's "
                       "choice of a model hold there?",
                 found=[(done, inputs["table"]), (counted(claims), inputs["claims"])],
                 sure=[(sentence, inputs["table"]) for sentence in care] or (
                     "Every press is within what its model is valid for, and no taxel is at the end of its range."),
                 synthetic="Robot and objects move in MuJoCo. Readings are the virtual sensor's, a simulation. No score here is "
                           "the paper's.")
    page.figures(zip(inputs["figures"], settings["captions"], strict=True))
    page.claims(claims, file=inputs["claims"])
    page.section("Grasps")
    page.table(grasps[[name for name in _SHOWN if name in grasps]], file=inputs["table"],
               links=[("Each grasp in time", [("grasps", "grasps")])])
    page.configuration(settings["config"])
    page.write(outputs["page"])


def papers_model(placed: "trimesh.Trimesh", *, footprint_mm: tuple[float, float], reach_mm: float) -> str:
    """The model that the paper's rule chooses for a placed object, by the part of it over the pad."""
    from softtact.geometry.complexity import choose_model, score

    counts = score(placed.triangles, footprint_mm=footprint_mm, reach_mm=reach_mm)
    return choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)


def _compared(inputs):
    """{object: maps of several models}."""
    return {data.attrs["object"]: data for data in map(read_dataset, inputs.get("compared", []))}


def _facts(data, readings, mesh, spec):
    """The values of a row of the table, for a successful grasp."""
    from softtact.geometry.meshes import place
    from softtact.robot.events import pose_of, set_down

    contact, at = (int(data.event_row[event]) for event in (0, GRIP))
    row = {"status": "done", "message": "", "trials": readings.sizes["trial"],
           "contact_s": float(data.time_s[contact]), "grip_s": float(data.time_s[at])}
    for finger, name in enumerate(map(str, data.finger.values)):
        placed = {event: place(mesh, pose=set_down(mesh, pose_of(data.object_pose_sensor.values[record, finger])))
                  for event, record in (("contact", contact), ("grip", at))}
        spread = readings.tactile_map.values[finger].std(axis=0, ddof=1) if readings.sizes["trial"] > 1 else np.zeros(1)
        row |= {f"force_{name}_n": -float(data.force_n[at, finger, 2]), f"model_contact_{name}": data.model.values[0, finger],
                f"model_grip_{name}": data.model.values[GRIP, finger],
                **{f"rule_{event}_{name}": papers_model(one, footprint_mm=spec.footprint_mm, reach_mm=spec.thickness_mm)
                   for event, one in placed.items()},
                f"valid_{name}": int(data.within_validity[GRIP, finger]),
                f"deepest_{name}_mm": float(data.deformation_map_mm[GRIP, finger].max()),
                f"at_range_end_{name}": int((readings.tactile_map[finger] >= spec.largest_counts).any("trial").sum()),
                f"counts_{name}": float(readings.tactile_map[finger].sum(dim=("row", "column")).mean()),
                f"trial_sd_{name}_counts": float(spread.mean())}
    return row


def _pictures(events, files, sensor: Path, settings) -> Iterator[tuple[str, np.ndarray]]:
    """(object, image of the hand at the grip) of each object; none if MuJoCo cannot render."""
    from softtact.geometry.meshes import read_mesh
    from softtact.robot.settings import import_mujoco

    import_mujoco()
    from softtact.robot.events import record_of
    from softtact.robot.render import draw_rows
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import load_scene
    from softtact.sensors.specification import read_spec

    for name, data in events.items():
        path, unit = files[name]
        record = record_of(data)
        scene = build_scene(read_mesh(path, unit=unit), read_spec(sensor), load_scene(**settings["scene"]),
                            Placement(*(data.attrs[key] for key in ("x_mm", "y_mm", "angle_deg"))))
        images = draw_rows(scene, record, [record.event_row[GRIP]], view=(20.0, -20.0, 0.22), size=(300, 300))
        if images is None:
            return
        yield name, images[0]


def _draw_objects(path: Path, events: Mapping[str, "xarray.Dataset"], readings: Mapping[str, "xarray.Dataset"],
                 pictures: Mapping[str, np.ndarray]) -> None:
    """Write a PNG with a column for each object at the grip: robot, maps of both sensors, the virtual sensor's mean readings.

    pictures: {object: image (height, width, 3)}, empty if MuJoCo cannot render
    """
    names = list(events)[:2 * _MOST_COLUMNS]
    if not names:
        figure = pyplot().figure(figsize=(4, 1))
        figure.text(0.5, 0.5, "no grasp was done", ha="center", va="center")
        save(figure, path)
        return
    blocks, columns = -(-len(names) // _MOST_COLUMNS), min(len(names), _MOST_COLUMNS)
    rows = (1 if pictures else 0) + 4
    figure = pyplot().figure(figsize=(2.3 * columns + 0.6, 2.0 * rows * blocks + 0.4), layout="constrained")
    grid = figure.subplots(rows * blocks, columns, squeeze=False)
    for axes in grid.ravel():
        axes.set_axis_off()
    for number, name in enumerate(names):
        block, column = divmod(number, _MOST_COLUMNS)
        _draw_column(grid[block * rows:(block + 1) * rows, column], name, events[name], readings[name], pictures.get(name),
                     with_picture=bool(pictures), figure=figure)
    save(figure, path)


def _draw_column(axes, name, data, read, picture, *, with_picture, figure):
    first = 1 if with_picture else 0
    if picture is not None:
        axes[0].imshow(picture)
    axes[0].set_title(name.replace("_", " "), fontsize=9)
    extent = [float(data[axis][end]) for axis in ("x", "y") for end in (0, -1)]
    for finger, side in enumerate(("left", "right")):
        for offset, (values, unit) in enumerate(((data.deformation_map_mm.values[GRIP, finger], "mm"),
                                                 (read.tactile_map.values[finger].mean(axis=0), "counts"))):
            place = axes[first + 2 * finger + offset]
            place.set_axis_on()
            image = place.imshow(values, origin="lower", extent=extent, vmin=0, vmax=max(float(values.max()), 1e-9), cmap="viridis")
            place.set_xticks([]), place.set_yticks([])
            bar = figure.colorbar(image, ax=place, shrink=0.8, label=unit)
            bar.ax.tick_params(labelsize=6)
            place.set_ylabel(f"{side}, {data.model.values[GRIP, finger]}" if offset == 0 else f"{side}, mean reading", fontsize=6)


def _result(grasps):
    """Sentences on the number of successful grasps and on the validity of their models."""
    done = grasps[grasps.status == "done"]
    objects, trials = (done.object.nunique(), int(done.trials.sum())) if len(done) else (0, 0)
    result = [f"{len(done)} of {len(grasps)} grasps were done, of {objects} object{'s' * (objects != 1)}, with {trials} trials."]
    invalid = int((done[["valid_left", "valid_right"]] != 1).to_numpy().sum()) if len(done) else 0
    if invalid:
        result.append(f"{invalid} presses at the grip are beyond what their model is valid for: do not rely on their maps.")
    full = int((done[["at_range_end_left", "at_range_end_right"]] > 0).to_numpy().sum()) if len(done) else 0
    if full:
        result.append(f"Taxels of {full} pad{'s' * (full != 1)} are at the end of the converter's range: they read less than "
                      "they feel.")
    return result
