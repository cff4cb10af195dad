"""`softtact predict`: taxel counts from deformation maps with a trained network."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from softtact.commands.common import add_command, check_pictures, show
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

if TYPE_CHECKING:
    import numpy as np

    from softtact.learning.prediction import Maps

EXAMPLES = """
  softtact press part.stl --unit mm --force 5 --force 20 --model elastic --out press.nc
  softtact predict press.nc --network results/default/learning/elastic/model.pt --plot taxels.png
  softtact predict map.csv --network model.pt --out counts.csv --json
"""
WRITTEN = (".nc", ".csv")


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "predict", _predict, "Predict the taxels' counts from deformation maps with a trained network.",
                          EXAMPLES)
    command.add_argument("maps", metavar="MAP_OR_PRESS", type=Path,
                         help="NetCDF of a press (all its forces), or .npy or .csv of one map in mm, rows along y")
    command.add_argument("--network", type=Path, required=True, metavar="MODEL.pt",
                         help="a trained network; loading it runs no code of the file")
    command.add_argument("--out", type=Path, metavar="FILE.nc|csv", help="write the counts")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw maps and taxels")


def _predict(options):

    check_outputs(options.out, options.plot)
    refuse_overwriting([options.maps, options.network], {"--out": options.out, "--plot": options.plot})
    check_pictures(options.plot)
    if options.out and options.out.suffix not in WRITTEN:
        raise InputError(f"{options.out}: taxels are written as {' or '.join(WRITTEN)}; give a name with such an ending.")
    from softtact.learning.network import load_network, predict
    from softtact.learning.prediction import outside_training, read_maps

    network, facts = load_network(options.network)
    maps = read_maps(options.maps, shape=tuple(network.options["map_shape"]))
    counts = predict(network, maps.maps_mm)
    warnings = outside_training(maps, facts)
    for sentence in warnings:
        print(f"softtact predict: {sentence}", file=sys.stderr)
    _write(maps, counts, facts, options)
    result = {"force_n": None if maps.force_n is None else maps.force_n.tolist(), "tactile_map": counts.tolist(),
              "network": {"architecture": network.architecture} | facts, "warnings": warnings}
    show(result, as_json=options.json, lines=_lines(maps, counts, network, facts))


def _write(maps, counts, facts, options):
    if options.out:
        from softtact.learning.prediction import write_counts

        write_counts(options.out, maps, counts, facts=facts)
    if options.plot:
        plot_prediction(maps, counts, options.plot)


def _lines(maps, counts, network, facts):
    yield (f"network: {network.architecture}, trained on maps of the model {facts.get('model', 'unknown')} "
           f"and readings of: {facts.get('source', 'unknown')}")
    for k, taxels in enumerate(counts):
        force = "" if maps.force_n is None else f" at {maps.force_n[k]:g} N"
        yield f"counts{force} (deepest {maps.maps_mm[k].max():.4f} mm), row y and column x rising:"
        yield from ("".join(f"{count:8.0f}" for count in row) for row in taxels)


MOST = 8     # maps in one picture, evenly chosen


def plot_prediction(maps: "Maps", counts: "np.ndarray", path: str | Path) -> None:
    """Draw `Maps` and counts (n, row, column) as PNG or SVG: a column for each map, with the map in mm above its counts."""
    from softtact.press.plot import around_points
    from softtact.reporting.style import pyplot, save

    plt = pyplot()
    shown = [round(k * (len(counts) - 1) / max(1, min(MOST, len(counts)) - 1)) for k in range(min(MOST, len(counts)))]
    x, y, unit = _grid(maps)
    figure, axes = plt.subplots(2, len(shown), figsize=(1.2 + 2.3 * len(shown), 7.2), squeeze=False, layout="constrained")
    most = max(1.0, float(counts.max()))          # over the whole range of 2400 counts light presses would be dark
    low, high = min(0.0, float(maps.maps_mm.min())), float(maps.maps_mm.max())
    for column, k in enumerate(shown):
        image = axes[0, column].imshow(maps.maps_mm[k], origin="lower", extent=around_points(x, y), vmin=low, vmax=high,
                                       cmap="viridis")
        taxels = axes[1, column].imshow(counts[k], origin="lower", extent=(x[0], x[-1], y[0], y[-1]), vmin=0.0, vmax=most,
                                        cmap="viridis")
        axes[0, column].set_title("" if maps.force_n is None else f"{maps.force_n[k]:g} N")
        axes[1, column].set_xlabel(f"x ({unit})")
    for axis, name in zip(axes[:, 0], ("deformation", "predicted taxels"), strict=True):
        axis.set_ylabel(f"{name}: y ({unit})")
    figure.colorbar(image, ax=axes[0], label="towards the PCB (mm)")
    figure.colorbar(taxels, ax=axes[1], label="counts, predicted")
    save(figure, path)


def _grid(maps):
    """Points x (n,) and y (m,) of a map, and their unit: mm if the file has the grid, else they are counted."""
    if maps.x_mm is None or maps.y_mm is None:
        height, width = maps.maps_mm.shape[1:]
        return range(width), range(height), "points"
    return maps.x_mm, maps.y_mm, "mm"
