"""Import the published archive as press files and readings, with an inventory.

inputs: files (CSV, only for the workflow; `settings.folder` is read)
outputs: presses, tactile (folders), item_list (JSON), inventory (JSON), counts, outliers (CSV)
settings: folder, variant, models, unseen, without, taxel_order, outliers, largest_outlier_share, sensor, seed
"""

import shutil
from typing import TYPE_CHECKING, Any

from softtact.errors import InputError
from softtact.files import write_csv, write_dataset, write_json
from softtact.progress import announce
from softtact.published.archive import counts_sentence, counts_table, find_archive
from softtact.published.importing import (
    MAP_COLUMNS,
    MAP_ROWS,
    TAXELS,
    PairedTest,
    Tables,
    files_table,
    found_counts,
    items_of,
    judge_arrangement,
    press_dataset,
    read_archive,
    sign_towards_pcb,
    tactile_dataset,
)
from softtact.sensors.specification import SensorSpec

if TYPE_CHECKING:
    from softtact.published.table import Outliers

LISTED = 20   # most outliers in the log; the table has all


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read, pair and check the archive, report outliers, and write the usable tests."""
    sensor = SensorSpec.from_dict(settings["sensor"])
    check_sensor(sensor)
    tables = read_archive(find_archive(settings["folder"], models=settings["models"], variant=settings["variant"]))
    announce_outliers(tables.outliers)
    tests = sum(map(len, tables.paths().values()))
    tables.outliers.refuse(tests, outliers=settings["outliers"], largest_share=settings["largest_outlier_share"])
    items = items_of(tables, unseen=settings["unseen"], without=settings["without"])
    facts = inventory(tables, items, tests=tests, sensor=sensor, settings=settings)
    write_items(outputs, tables, items, sensor=sensor, settings=settings, signs=facts["sign"])
    write_csv(outputs["outliers"], tables.outliers.table())
    write_csv(outputs["counts"], counts_table(found_counts(tables, items)))
    write_json(outputs["item_list"], [{"set": name, "item": item} for name, item in items])
    write_json(outputs["inventory"], facts)


def check_sensor(sensor: SensorSpec) -> None:
    """Refuse a sensor with another grid than the paper's, which the archive has."""
    shape = sensor.taxels.rows * sensor.taxels.columns, *sensor.map_shape
    if shape != (TAXELS, MAP_ROWS, MAP_COLUMNS):
        raise InputError(f"sensor {sensor.name}: it has {shape[0]} taxels and maps of {shape[1]} x {shape[2]}; the archive is of "
                         f"{TAXELS} taxels and maps of {MAP_ROWS} x {MAP_COLUMNS}: use the sensor 'coro'.")


def announce_outliers(outliers: "Outliers") -> None:
    """Print the outliers on stderr."""
    for finding in outliers.findings[:LISTED]:
        announce(f"{finding} ({finding.done})")
    if len(outliers.findings) > LISTED:
        announce(f"and {len(outliers.findings) - LISTED} more outliers")


def inventory(tables: Tables, items: dict[tuple[str, str], list[tuple[str, PairedTest]]], *, tests: int, sensor: SensorSpec,
              settings: dict[str, Any]) -> dict[str, Any]:
    """The contents of the archive, the arrangement of its taxels, and the comparison with the printed counts."""
    found = found_counts(tables, items)
    matches = judge_arrangement(tables, shape=_grid(sensor), seed=settings["seed"])
    best, chosen = max(matches, key=matches.__getitem__), settings["taxel_order"]
    sentence = counts_sentence(counts_table(found))
    announce(sentence)
    if best != chosen:
        announce(f"the taxels' order is set to {chosen!r}, and readings follow the maps better as {best!r} (correlation "
                 f"{matches[best]:.2f} over {matches[chosen]:.2f}); consider 'data.taxel_order: {best}'")
    return {"files": files_table(tables), "found": found, "sentence": sentence, "tests": tests,
            "tests_used": sum(map(len, items.values())), "tests_left_out": len(tables.outliers.left_out()),
            "items": {name: sorted(item for of_set, item in items if of_set == name) for name in ("indenters", "unseen", "grasps")},
            "sign": {model: sign_towards_pcb(tables, model) for model in tables.simulated},
            "taxel_order": {"read_as": chosen, "best": best, "correlation": matches}}


def write_items(outputs: dict[str, Any], tables: Tables, items: dict[tuple[str, str], list[tuple[str, PairedTest]]], *,
                sensor: SensorSpec, settings: dict[str, Any], signs: dict[str, int]) -> None:
    """Write maps for each item and model and readings for each item; remove the files of an earlier import."""
    for name in ("presses", "tactile"):
        shutil.rmtree(outputs[name], ignore_errors=True)
        outputs[name].mkdir(parents=True)
    for (set_name, item), tests in items.items():
        key = set_name, item
        for model, sign in signs.items():
            write_dataset(outputs["presses"] / set_name / item / f"{model}.nc",
                          press_dataset(tables, key, tests, model=model, sensor=sensor, sign=sign), seed=None, settings=settings)
        write_dataset(outputs["tactile"] / set_name / f"{item}.nc",
                      tactile_dataset(tables, key, tests, shape=_grid(sensor), arrangement=settings["taxel_order"]),
                      seed=None, settings=settings)


def _grid(sensor):
    return sensor.taxels.rows, sensor.taxels.columns
