"""The figures, each a stage with the name of its rule. Each function imports its figure's module, so that an edit redraws only it.

outputs: png, svg, or html of an interactive view
"""

from typing import Any

import numpy as np
import pandas as pd

from softtact.files import read_csv

Named = dict[str, Any]
_LIFTED_MM = 6.0     # of the object above the surface, so that its imprint is visible


def draw_material(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """The plot of a material's card: data, fits, residuals, stable ranges.

    inputs: card, curves (CSV, one per mode)
    """
    from softtact.materials.cards import load_card
    from softtact.materials.readers import read_curves
    from softtact.studies.hybrid.figures.material_plot import plot_material

    plot_material(load_card(inputs["card"]), read_curves(inputs["curves"]), outputs["png"], outputs["svg"])


def draw_fig2_section(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 2: the pressed body, cut through the row of frusta under the load.

    inputs: body (VTU), summary (JSON), object (mesh);  settings: sensor, unit, pose
    """
    from softtact.files import read_json
    from softtact.press.vtu import read_vtu
    from softtact.reporting.style import save
    from softtact.sensors.specification import SensorSpec
    from softtact.studies.hybrid.figures.fig2_section import draw
    from softtact.studies.hybrid.figures.section import row_under_load, section

    spec, summary, body = SensorSpec.from_dict(settings["sensor"]), read_json(inputs["summary"]), read_vtu(inputs["body"])
    y = row_under_load(body, spec)
    placed = _placed(inputs["object"], settings)
    figure = draw(section(body, y), _outline(placed, y, summary["indentation_mm"]), spec=spec, summary=summary, y_mm=y)
    save(figure, outputs["png"], outputs["svg"])


def draw_pressed_sensor(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """The sensor's surface at rest and pressed, with the object above it, as an interactive view for a browser.

    inputs: body (VTU), summary (JSON), object (mesh);  outputs: html;  settings: unit, pose
    """
    from softtact.files import atomic_path, read_json
    from softtact.press.vtu import read_vtu
    from softtact.reporting.view3d import html_view
    from softtact.studies.hybrid.figures.section import top_surface

    body, summary = read_vtu(inputs["body"]), read_json(inputs["summary"])
    lifted = _placed(inputs["object"], settings)
    at = np.asarray(lifted.vertices) + [0.0, 0.0, _LIFTED_MM]
    rest, moved, triangles = top_surface(body)
    points = np.stack([np.vstack([rest, at]), np.vstack([rest + moved, at - [0.0, 0.0, summary["indentation_mm"]]])])
    grey = np.full(len(at), np.nan)
    values = np.stack([np.append(np.zeros(len(rest)), grey), np.append(-moved[:, 2], grey)])
    view = html_view(points, np.vstack([triangles, np.asarray(lifted.faces) + len(rest)]), values, unit="mm towards the PCB",
                     title=f"{summary['model']} model: {summary['item']} pressed with {summary['force_n']:g} N",
                     labels=["at rest", f"{summary['force_n']:g} N"])
    with atomic_path(outputs["html"]) as temporary:
        temporary.write_text(view, encoding="utf-8")


def draw_fig4_complexity(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 4: the complexity of the grasped objects.

    inputs: complexity, objects (list of meshes)
    settings: thresholds, objects [{name, unit, pose}, ...], footprint_mm, reach_mm
    """
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig4_complexity import Placed, draw

    placed = {entry["name"]: Placed(_placed(path, entry), tuple(settings["footprint_mm"]), settings["reach_mm"])
              for path, entry in zip(inputs["objects"], settings["objects"], strict=True)}
    save(draw(read_csv(inputs["complexity"]), placed, thresholds=settings["thresholds"]), outputs["png"], outputs["svg"])


def draw_fig5_ftir(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 5: contact area against force, of the model and of the virtual specimen.

    inputs: area, orientations, summary
    """
    from softtact.files import read_json
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig5_ftir import draw

    figure = draw(read_csv(inputs["area"]), read_json(inputs["summary"]), orientations=read_csv(inputs["orientations"]))
    save(figure, outputs["png"], outputs["svg"])


def draw_fig6_ssim(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 6: SSIM of each object, over its presses at all places.

    inputs: ssim, ceiling, baselines;  settings: ssim {window, data_range}
    """
    from softtact.learning.dataset import object_of
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig6_ssim import draw

    tables = (read_csv(inputs[name]) for name in ("ssim", "ceiling", "baselines"))
    together = (table.assign(item=table["item"].map(object_of)) for table in tables)
    save(draw(*together, choices=settings["ssim"]), outputs["png"], outputs["svg"])


def draw_fig7_maps(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 7: maps of the grasped objects at the largest force.

    inputs: predictions, complexity, objects (list of meshes), presses (list: every model of every object)
    settings: units [[object, unit], ...], trials (of each object), largest_counts
    """
    from softtact.files import read_dataset
    from softtact.geometry.meshes import read_mesh
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig7_maps import draw

    predictions = read_dataset(inputs["predictions"])
    chosen = read_csv(inputs["complexity"]).set_index("object").model
    presses = {(press.attrs["item"], press.attrs["model"]): press for press in map(read_dataset, inputs["presses"])}
    objects = [_object(name, read_mesh(path, unit=unit), chosen[name], presses, predictions) | {"trials": trials}
               for path, (name, unit), trials in zip(inputs["objects"], settings["units"], settings["trials"], strict=True)]
    save(draw(objects, largest_counts=settings["largest_counts"]), outputs["png"], outputs["svg"])


def draw_fig8_policies(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 8: error and cost of the policies that choose a model.

    inputs: policies, presses
    """
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig8_policies import draw

    save(draw(read_csv(inputs["policies"]), read_csv(inputs["presses"])), outputs["png"], outputs["svg"])


def draw_fig9_networks(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 9: the networks compared, and their trainings.

    inputs: networks (CSV), histories (of each of its networks, in its order);  settings: ssim {window, data_range}
    """
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig9_networks import draw

    networks = read_csv(inputs["networks"])
    kinds = list(networks.groupby(["model", "architecture"], sort=False).groups)
    histories = dict(zip(kinds, map(read_csv, inputs["histories"]), strict=True))
    save(draw(networks, histories, choices=settings["ssim"]), outputs["png"], outputs["svg"])


def draw_fig10_learning_curve(*, inputs: Named, outputs: Named, settings: Named, threads: int = 1) -> None:
    """Figure 10: SSIM against the number of training maps.

    inputs: curves (list of CSV, one per model), ceiling;  settings: ssim {window, data_range}
    """
    from softtact.reporting.style import save
    from softtact.studies.hybrid.figures.fig10_learning_curve import draw

    curves = pd.concat(map(read_csv, inputs["curves"]))
    save(draw(curves, read_csv(inputs["ceiling"]), choices=settings["ssim"]), outputs["png"], outputs["svg"])


def _outline(mesh, y, depth):
    """Polygons (k, 2), x and z, of the object in the plane y, lowered by `depth` mm."""
    cut = mesh.section(plane_origin=(0.0, y, 0.0), plane_normal=(0.0, 1.0, 0.0))
    return [] if cut is None else [loop[:, [0, 2]] - np.array([0.0, depth]) for loop in cut.discrete]


def _placed(path, entry):
    """The mesh of a file in the unit and pose of a mapping; without a pose it is centred over the sensor."""
    from softtact.geometry.meshes import read_placed

    return read_placed(path, unit=entry["unit"], pose=entry["pose"])


def _object(name, mesh, chosen, presses, predictions):
    models = [str(model) for model in predictions.model.values]
    first = presses[name, models[0]]
    last = predictions.sel(item=name).isel(force=-1)
    return {"name": name, "mesh": mesh, "chosen": chosen, "force": float(first.normal_force_n.values[-1]),
            "deformation": {model: presses[name, model].deformation_map_mm.values[-1] for model in models},
            "tactile": {model: last.tactile_map.sel(model=model).values for model in models},
            "sensor": last.sensor_map.values, "source": predictions.attrs["source"],
            "extent": (*first.x.values[[0, -1]], *first.y.values[[0, -1]])}
