"""Convert the archive to the files that data sets are built from: for each object, maps of each model and their readings.

A test is one value of `Path`, i.e. one loading. Its k-th row in the file of real readings belongs to its k-th map, of 57 rows, in
the simulation's file. This is inferred, not documented, so it is checked: a test must have 57 simulated rows for each real one.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray

from softtact.errors import InputError
from softtact.published.archive import ARRANGEMENTS, MODELS, SETS, SOURCE, Archive, arrange, correlations
from softtact.published.table import Outliers, Table, read_table
from softtact.sensors.base import BaseSpec

MAP_ROWS, MAP_COLUMNS, TAXELS = 57, 33, 28
# A test outside these limits is left out. The layered sensor is 2.5 mm thick. Counts reach 2400 in the paper's figures, and raw
# values of the converter in a file of the share are 10,067 to 37,865, so 5000 separates them; an unloaded sensor may read below 0.
LARGEST_DEFORMATION_MM = 2.5
COUNTS = (-240.0, 5000.0)
PAPERS_COUNTS = 2400.0
FORCES_N = (-1.0, 75.0)     # the paper presses with 0 to 50 N
SOLVERS = {model: solver.capitalize() for solver, model in MODELS.items()}
COUNTED_AS = {"indenters": "real maps of indenters to train on", "unseen": "real maps of unseen indenters",
              "grasps": "real maps of objects"}
SAMPLED = 500               # maps for the arrangement of the taxels
LEAST_DEPTH_MM = 0.005      # an archive without any deeper map is probably in metres


@dataclass(frozen=True)
class PairedTest:
    """One usable test: path, object (snake_case), readings (n,) rows of the real table, maps {model: (n * 57,) rows}."""

    path: str
    object: str
    readings: np.ndarray
    maps: dict


def object_name(path: str) -> str:
    """The text before the first slash in snake_case, e.g. CircleG/... -> circle_g; '' if there is none."""
    text = re.split(r"[/\\]", path.strip(), maxsplit=1)[0]
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])", "_", text)
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")


def pair(reals: Sequence[Table], simulated: dict[str, Table], *, outliers: Outliers) -> list[PairedTest]:
    """The usable `PairedTest`s of one set.

    reals: tables of readings, of which the first is used and the others must agree;  simulated: {model: table}
    """
    real, *others = reals
    tables = [real, *others, *simulated.values()]
    rows = {id(table): table.rows_of_tests() for table in tables}
    tests = []
    for path in dict.fromkeys(path for table in tables for path in table.paths):
        rows_of: dict[int, Any] = {id(table): rows[id(table)].get(path) for table in tables}
        if _in_all(path, tables, rows_of, outliers):
            _check_readings(path, real, others, rows_of, outliers)
            for table in simulated.values():
                _check_maps(path, real, table, rows_of, outliers)
        if not outliers.leaves_out(path, files={table.file for table in tables}):
            of_models = {model: rows_of[id(table)] for model, table in simulated.items()}
            tests.append(PairedTest(path, object_name(path), rows_of[id(real)], of_models))
    return tests


def _in_all(path, tables, rows_of, outliers):
    """Whether each table has the test, and it names an object."""
    here = [table for table in tables if rows_of[id(table)] is not None]
    first = here[0].line[rows_of[id(here[0])][0]]
    for table in tables:
        if rows_of[id(table)] is None:
            outliers.leave_out(here[0].file, first, path, f"the test is not in {table.file}")
    if not object_name(path):
        outliers.leave_out(here[0].file, first, path, "the test names no object")
    return len(here) == len(tables)


def _check_readings(path, real, others, rows_of, outliers):
    rows = rows_of[id(real)]
    _check_common(path, real, rows, outliers)
    _check_range(path, real, rows, real.values, COUNTS, "counts", outliers)
    _check_range(path, real, rows, real.force_n[:, None], FORCES_N, "N", outliers)
    high = rows[(real.values[rows] > PAPERS_COUNTS).any(axis=1)]
    if len(high):
        outliers.keep(real.file, real.line[high[0]], path,
                      f"readings above {PAPERS_COUNTS:g} counts, where the paper's figures end",
                 count=len(high))
    for other in others:
        theirs = rows_of[id(other)]
        if not _alike(other.force_n[theirs], real.force_n[rows]) or not _alike(other.values[theirs], real.values[rows]):
            outliers.leave_out(other.file, other.line[theirs[0]], path, f"other readings than in {real.file}")


def _alike(ours, theirs):
    """Whether two columns or tables are equal up to rounding."""
    return ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=1e-3, atol=1e-2, equal_nan=True)


def _check_maps(path, real, table, rows_of, outliers):
    rows, readings = rows_of[id(table)], len(rows_of[id(real)])
    _check_common(path, table, rows, outliers)
    _check_range(path, table, rows, table.values, (-LARGEST_DEFORMATION_MM, LARGEST_DEFORMATION_MM), "mm", outliers)
    if len(rows) % MAP_ROWS:
        outliers.leave_out(table.file, table.line[rows[0]], path,
                           f"{len(rows)} rows are no whole number of maps of {MAP_ROWS} rows")
    elif len(rows) != readings * MAP_ROWS:
        outliers.leave_out(table.file, table.line[rows[0]], path,
                           f"{len(rows) // MAP_ROWS} maps and {readings} readings in {real.file}")


def _check_common(path, table, rows, outliers):
    """Report missing numbers, surplus fields and a test whose rows are not contiguous."""
    bad = ~np.isfinite(table.values[rows])
    per_row = bad.any(axis=1)
    if per_row.any():
        line = table.line[rows[np.argmax(per_row)]]
        text = f"{table.texts[int(line)]!r} in place of a number" if int(line) in table.texts else "a value is missing or infinite"
        outliers.leave_out(table.file, line, path, text, count=bad.sum())
    surplus = rows[table.surplus[rows]]
    if len(surplus):
        outliers.leave_out(table.file, table.line[surplus[0]], path, "more fields than columns", count=len(surplus))
    gaps = [k for k in np.flatnonzero(np.diff(rows) > 1) if (table.test[rows[k] + 1:rows[k + 1]] >= 0).any()]
    if gaps:
        outliers.keep(table.file, table.line[rows[gaps[0] + 1]], path,
                      "the test goes on after rows of another; joined in their order",
                 count=len(gaps))


def _check_range(path, table, rows, values, limits, unit, outliers):
    checked = values[rows]
    outside = (checked < limits[0]) | (checked > limits[1])
    if unit == "N":
        outside |= ~np.isfinite(checked)
    per_row = outside.any(axis=1)
    if per_row.any():
        at = np.argmax(per_row)
        worst = checked[at][outside[at]][0]
        raw = "; raw values of the converter?" if unit == "counts" and worst > limits[1] else ""
        outliers.leave_out(table.file, table.line[rows[at]], path,
                      f"{worst:g} {unit} is not within {limits[0]:g} to {limits[1]:g}{raw}", count=outside.sum())


@dataclass(frozen=True)
class Tables:
    """The tables read. real {set: [table, ...]};  simulated {model: {set: table}};  tests {set: [PairedTest, ...]};  outliers"""

    real: dict
    simulated: dict
    tests: dict
    outliers: Outliers

    def maps_mm(self, model: str, set_name: str, test: PairedTest) -> np.ndarray:
        """Maps (n, y, x) of a test, as in the file."""
        return self.simulated[model][set_name].values[test.maps[model]].reshape(-1, MAP_ROWS, MAP_COLUMNS)

    def readings(self, set_name: str, test: PairedTest) -> np.ndarray:
        """Counts (n, taxel) of a test."""
        return self.real[set_name][0].values[test.readings]

    def paths(self) -> dict[str, list[str]]:
        """All tests by set, usable or not: {set: [path, ...]}."""
        return {name: list(dict.fromkeys(path for table in self._of_set(name) for path in table.paths)) for name in SETS}

    def _of_set(self, name):
        return [*self.real[name], *(of_set[name] for of_set in self.simulated.values())]


def read_archive(archive: Archive) -> Tables:
    """The `Tables` of an `Archive`, paired and checked."""
    outliers = Outliers()
    real = {name: [read_table(file.path, columns=TAXELS, force=True, outliers=outliers) for file in archive.real[name]]
            for name in SETS}
    simulated = {model: {name: read_table(file.path, columns=MAP_COLUMNS, force=False, outliers=outliers) for name,
                         file in of_set.items()}
                 for model, of_set in archive.simulated.items()}
    tests = {name: pair(real[name], {model: of_set[name] for model, of_set in simulated.items()}, outliers=outliers)
             for name in SETS}
    tests["curved"] = _only_grasped(tests, real["curved"][0], outliers)
    tables = Tables(real, simulated, tests, outliers)
    report_decreasing_readings(tables)
    return tables


def report_decreasing_readings(tables: Tables) -> None:
    """Report tests whose readings fall while their maps deepen, so that their orders may differ. The tests are kept."""
    for model in tables.simulated:
        sign = sign_towards_pcb(tables, model)
        for name in SETS:
            for test in tables.tests[name]:
                follows = order_correlation(sign * tables.maps_mm(model, name, test), tables.readings(name, test))
                if follows < 0:
                    table = tables.real[name][0]
                    tables.outliers.keep(table.file, table.line[test.readings[0]], test.path,
                                         "the readings do not rise with the maps "
                                    f"of {SOLVERS[model]} (correlation {follows:.2f}); other order?")


def order_correlation(maps: np.ndarray, counts: np.ndarray) -> float:
    """Correlation over a test's frames of the means of map (n, y, x) and counts (n, taxel); 1 for fewer than 3 frames."""
    depth, count = maps.mean(axis=(1, 2), dtype=float), counts.mean(axis=1, dtype=float)
    if len(maps) < 3 or depth.std() == 0 or count.std() == 0:
        return 1.0
    return float(np.corrcoef(depth, count)[0, 1])


def _only_grasped(tests, table, outliers):
    """The grasps of objects that are not also indenters, which the training includes."""
    indenters = {test.object for test in tests["flat"]}
    for test in tests["curved"]:
        if test.object in indenters:
            outliers.leave_out(table.file, table.line[test.readings[0]], test.path, "its object stands among the indenters too")
    return [test for test in tests["curved"] if test.object not in indenters]


def items_of(tables: Tables, *, unseen: Collection[str],
             without: Collection[str] = ()) -> dict[tuple[str, str], list[tuple[str, PairedTest]]]:
    """{(set, item): tests}: an item is an object with all its tests.

    unseen: indenters that the training must not include;  without: paths of tests, or objects, to leave out
    """
    _check_known(tables, without)
    known = sorted({test.object for test in tables.tests["flat"]})
    for name in unseen:
        if name not in known:
            raise InputError(f"the configuration, at 'data.unseen': no usable test of the archive is of an indenter {name!r}; "
                             f"name some of {', '.join(known) or 'none'}.")
    items: dict[tuple[str, str], list[tuple[str, PairedTest]]] = {}
    for set_name in SETS:
        for test in tables.tests[set_name]:
            if {test.path, test.object} & set(without):
                continue
            name = "grasps" if set_name == "curved" else "unseen" if test.object in unseen else "indenters"
            items.setdefault((name, test.object), []).append((set_name, test))
    return items


def _check_known(tables, without):
    every = [test for tests in tables.tests.values() for test in tests]
    for name in without:
        if name not in {test.path for test in every} | {test.object for test in every}:
            raise InputError(f"the configuration, at 'data.without': the archive has no usable test and no object "
                             f"{name!r}; correct it.")


def sign_towards_pcb(tables: Tables, model: str) -> int:
    """+1, or -1 if the maps are mostly negative; ours are positive towards the PCB. Raises InputError for maps in metres."""
    of_tests = [tables.maps_mm(model, name, test) for name in SETS for test in tables.tests[name]]
    deepest = max((float(np.abs(maps).max()) for maps in of_tests), default=0.0)
    if of_tests and deepest < LEAST_DEPTH_MM:
        raise InputError(f"the maps of {SOLVERS[model]}: none is deeper than {deepest:g} mm, so they may be in metres; "
                         "write them in mm.")
    return 1 if sum(float(maps.sum(dtype=float)) for maps in of_tests) >= 0 else -1


def judge_arrangement(tables: Tables, *, shape: tuple[int, int], seed: int) -> dict[str, float]:
    """{arrangement: correlation} over a sample of all usable maps of the first model."""
    model = next(iter(tables.simulated))
    pairs = [(name, test) for name in SETS for test in tables.tests[name]]
    chosen = np.random.default_rng([seed, 28]).permutation(len(pairs))
    maps, counts, size = [], [], 0
    for k in chosen:
        maps.append(tables.maps_mm(model, *pairs[k]))
        counts.append(tables.readings(*pairs[k]))
        size += len(counts[-1])
        if size >= SAMPLED:
            break
    if not maps:
        return dict.fromkeys(ARRANGEMENTS, 0.0)
    return correlations(sign_towards_pcb(tables, model) * np.concatenate(maps), np.concatenate(counts), shape=shape)


def press_dataset(tables: Tables, key: tuple[str, str], tests: Sequence[tuple[str, PairedTest]], *, model: str, sensor: BaseSpec,
                  sign: int) -> xarray.Dataset:
    """Maps of one item and model in the form of `simulate_press`; `path` names the test of each map."""
    maps = sign * np.concatenate([tables.maps_mm(model, *test) for test in tests])
    ones = np.ones(len(maps), dtype=np.int8)
    return xarray.Dataset(
        {"deformation_map_mm": (("step", "y", "x"), maps.astype(np.float32), {"units": "mm"}),
         "normal_force_n": ("step", _forces(tables, tests), {"units": "N"}), "path": ("step", _paths(tests)),
         "converged": ("step", ones), "within_validity": ("step", ones)},
        coords={"y": sensor.map_y_mm, "x": sensor.map_x_mm},
        attrs={"model": model, "set": key[0], "item": key[1], "source": SOURCE, "solver": SOLVERS[model]})


def tactile_dataset(tables: Tables, key: tuple[str, str], tests: Sequence[tuple[str, PairedTest]], *, shape: tuple[int, int],
                    arrangement: str) -> xarray.Dataset:
    """Readings of one item, one trial each, because the archive does not state which readings are repetitions."""
    counts = np.concatenate([tables.readings(*test) for test in tests])
    return xarray.Dataset(
        {"tactile_map": (("trial", "force", "row", "column"), arrange(counts, arrangement, shape=shape)[None], {"units": "counts"}),
         "force_n": ("force", _forces(tables, tests), {"units": "N"}), "path": ("force", _paths(tests))},
        attrs={"source": SOURCE, "set": key[0], "item": key[1]})


def _forces(tables, tests):
    return np.concatenate([tables.real[name][0].force_n[test.readings] for name, test in tests])


def _paths(tests):
    return np.concatenate([np.full(len(test.readings), test.path, dtype=object) for _, test in tests])


def found_counts(tables: Tables, items: dict[tuple[str, str], list[tuple[str, PairedTest]]]) -> dict[str, int]:
    """{what: number} by the names of `archive.PRINTED`: rows and maps in the files, and usable ones per set."""
    found = {"real maps": sum(len(tables.real[name][0].test) for name in SETS)}
    found |= {f"maps of {model}": sum(len(table.test) for table in of_set.values()) // MAP_ROWS
              for model, of_set in tables.simulated.items()}
    for (set_name, _), tests in items.items():
        found[COUNTED_AS[set_name]] = found.get(COUNTED_AS[set_name], 0) + sum(len(test.readings) for _, test in tests)
    return found


def files_table(tables: Tables) -> list[dict[str, Any]]:
    """[{file, rows, tests, objects}] of all files."""
    every = [table for name in SETS for table in tables.real[name]] + [
        table for of_set in tables.simulated.values() for table in of_set.values()]
    return [{"file": table.file, "rows": len(table.test), "tests": len(table.paths),
             "objects": len({object_name(path) for path in table.paths})} for table in every]
