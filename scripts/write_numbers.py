"""Write the numbers that change into the documentation: docs/reference/numbers.md, and tables of other pages (`pages`).

    python scripts/write_numbers.py            (`make numbers`; `make docs` runs it first)

Sources: the records in benchmarks/results/, and pytest's collection for the number of tests. Other pages link to these numbers.
"""

import json
import re
import subprocess
import sys
from itertools import pairwise
from math import log
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
NUMBERS = ROOT / "docs" / "reference" / "numbers.md"
PERFORMANCE = ROOT / "docs" / "performance.md"
EDGE, FAST, SOLID, VIRTUAL = (ROOT / "docs" / "explanation" / f"{name}.md"
                               for name in ("edge", "fast_models", "solid", "virtual_sensor"))
LEARN = ROOT / "docs" / "how-to" / "learn_with_the_environment.md"
POSE, DECIDE, CALIBRATE = (ROOT / "docs" / "how-to" / f"{name}.md"
                           for name in ("find_a_pose_from_taxels", "decide_the_claims", "calibrate"))
MESHES = {"draft": "draft", "production": "default", "fine": "fine"}     # name in the records, name of the preset
BLOCK = r"(<!-- numbers: {} -->\n).*?(<!-- end of numbers -->)"
HEAD = """\
# Numbers that change

`make numbers` writes this page. Do not edit it. Each table names its record in `benchmarks/results/`, which holds the machine, the
versions and every single number. Times depend on the machine, so compare numbers of one table only. Times of single presses:
[what a press costs](../performance.md).
"""


def record(name: str) -> dict:
    """One record of benchmarks/results/."""
    return json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))


def table(head: str, rows: list[list[object]]) -> str:
    """A table in Markdown; `head` separates its columns by commas."""
    lines = [head.split(", "), ["---"] * len(head.split(", ")), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def source(name: str) -> str:
    """The sentence that names a record, its date and its machine."""
    read = record(name)
    machine = read["machine"]
    processor = machine["processor"].replace("(R)", "").removesuffix(" Processor")
    return f"`{name}.json`, {read['date'][:10]}, {machine['cores']} cores of an {processor} processor."


def count_tests() -> dict[str, int]:
    """Folder of tests/ to its number of tests, as `make test` runs them."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-qq", "-o", "addopts=-m 'not gold'"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        sys.exit(f"pytest cannot collect the tests; correct this first:\n{done.stdout[-2000:]}")
    counts: dict[str, int] = {}
    for path, number in re.findall(r"^tests/(\S+): (\d+)$", done.stdout, flags=re.MULTILINE):
        folder = path.partition("/")[0] if "/" in path else "(top)"
        counts[folder] = counts.get(folder, 0) + int(number)
    return dict(sorted(counts.items()))


def tests(counts: dict[str, int]) -> str:
    """The number of tests by folder."""
    rows = [[folder, number] for folder, number in counts.items()] + [["**all**", sum(counts.values())]]
    return "Counted by pytest, without the tests marked `gold`.\n\n" + table("folder of `tests/`, tests", rows)


def whole_runs() -> str:
    """Minutes of make's targets."""
    read = record("whole_runs")
    rows = [[f"`{row['run']}`", row["what"], row["minutes"]] for row in read["rows"]]
    return (f"{source('whole_runs')} {read['note'].capitalize()}. Jobs and time of the default study (`make`) are those of its "
            "last run, in its [results](../results.md).\n\n" + table("run, what, minutes", rows))


def presses() -> str:
    """Time and memory of a hyperelastic press on each mesh."""
    rows = [[MESHES[row["mesh"]], row["levels"], row["threads"], f"{row['seconds']:.0f}", row["iterations"],
             f"{row['memory_gb']:.1f}"] for row in record("press")["rows"]]
    return f"{source('press')}\n\n" + table("mesh, load steps, threads, seconds, iterations, peak memory (GB)", rows)


def fast_presses() -> str:
    """Time of a press with the two fast models, over all indenters."""
    read = record("fast_models")
    most, rows = max(entry["batch"] for entry in read["many"]), []
    for model in ("elastic", "foundation"):
        seconds = sorted(row[model] for row in read["seconds"])
        rate = {entry["workers"]: f"{entry['per_second']:.2g}" for entry in read["many"]
                if entry["model"] == model and entry["batch"] == most}
        rows.append([model, f"{median(seconds):.2f}", f"{seconds[0]:.2f} to {seconds[-1]:.2f}", rate[1], rate[2]])
    head = "model, median (s), range (s), presses per second with 1 process, with 2 processes"
    return f"{source('fast_models')} One process, {read['load_steps']} load steps to 50 N; {most} presses.\n\n{table(head, rows)}"


def batch_on_gpu() -> str:
    """Presses per second of the elastic model as one batch on a GPU, and beside it on the processor."""
    read = record("fast_models_cuda")
    most = max(row["batch"] for row in read["many"])
    one, many, gpu = (row for row in read["many"] if row["batch"] == most)
    rows = [["one process", f"{one['per_second']:.0f}"], [f"{many['workers']} processes", f"{many['per_second']:.0f}"],
            ["one batch on the GPU", f"{gpu['per_second']:.0f}"]]
    return (f"`fast_models_cuda.json`, {read['date'][:10]}, {read['device']} and {read['machine']['cores']} cores. "
            f"{most:,} presses; maps within {read['largest_difference_mm']:.0e} mm of each other.\n\n"
            + table("elastic model, presses per second", rows))


def batches() -> str:
    """Presses per second of batches on the processor, their ratio to presses one by one, and where an elastic batch's time goes."""
    read = record("batch")
    rows = [[row["model"], f"{row['batch']:,}", f"{row['per_second']:.3g}", f"{row['alone_per_second']:.3g}", f"{row['ratio']:.2g}"]
            for row in read["rows"]]
    parts = read["parts_s"]["cpu"]
    shares = "; ".join(f"{name} {seconds / parts['whole']:.0%}" for name, seconds in parts.items() if name != "whole")
    return (f"{source('batch')} One core's own time, while {read['machine']['load']:.0f} programs asked for the cores: compare the "
            f"ratios.\n\n{table('model, presses at once, a second, one by one a second, ratio', rows)}\n\n"
            f"Of an elastic batch of 256: {shares}.")


def growth() -> str:
    """How the cost of a hyperelastic press grows with the number of frusta, on one and two threads."""
    by_size: dict[int, dict[int, dict]] = {}
    for row in record("scaling")["rows"]:
        by_size.setdefault(row["frusta"], {})[row["threads"]] = row
    rows = []
    for frusta, threads in by_size.items():
        pair = [threads[1], threads[2]]
        parts = [" / ".join(f"{row[name]:.2g}" for row in pair)
                 for name in ("condense_s", "factor_s", "solve_s", "residual_s", "press_s")]
        rows.append([frusta, f"{pair[0]['unknowns_all']:,}", f"{pair[0]['unknowns_global']:,}", *parts, pair[0]["iterations"],
                     f"{pair[0]['memory_gb']:.1f}"])
    head = ("frusta, unknowns, of the matrix, all cells condensed (s), factor (s), solve (s), residual (s), whole press (s), "
            "iterations, memory (GB)")
    return (f"{source('scaling')} A flat punch of 2 mm radius at 4 N, default mesh, one / two threads.\n\n" + table(head, rows))


def mesh_errors() -> str:
    """Error of the map on each mesh against a much finer one."""
    rows = []
    for mesh, name in MESHES.items():
        cells = [max(row[key]) for key in ("rms_error_percent", "largest_error_percent")
                 for row in record("mesh_error")["rows"] if row["mesh"] == mesh]
        rows.append([name, f"{min(cells[:3]):.1f} to {max(cells[:3]):.1f}", f"{min(cells[3:]):.1f} to {max(cells[3:]):.1f}"])
    head = "mesh, root mean square (% of the map's maximum), largest at a point (%)"
    return (f"{source('mesh_error')} 36 frusta; flat punch, sphere and ridges, each at its worst force.\n\n" + table(head, rows))


def overhang() -> str:
    """Counts of objects over the rim by edge and mesh, and how far the models are apart."""
    by_case: dict[tuple[str, str], dict[str, dict]] = {}
    for row in record("overhang")["rows"]:
        if len(row["force_n"]) == 1:
            by_case.setdefault((row["object"], row["edge"]), {})[row["mesh"]] = row
    rows = []
    for (name, edge), meshes in by_case.items():
        cells = [f"{meshes['default']['foundation_counts'][0]:.0f}"]
        for mesh in ("default", "fine"):
            own = meshes.get(mesh)
            cells += ["", ""] if own is None else [f"{own['hyperelastic_counts'][0]:.0f}", f"{100 * own['apart'][0]:.1f}"]
        rows.append([name, f"`{edge}`", *cells])
    head = ("object, edge, counts of the foundation model, of the hyperelastic on the default mesh, error (%), on the fine mesh, "
            "error (%)")
    return f"{source('overhang')}\n\n" + table(head, rows)


def choice() -> str:
    """What each policy of choosing a model takes, costs and errs by."""
    read, rows = record("choice"), []
    for row in read["policies"]:
        counts = [round(row["presses"] * row[f"share_{model}"]) or "" for model in ("elastic", "foundation", "hyperelastic")]
        rows.append([row["policy"], *counts, f"{1e3 * row['mean_error_mm']:.1f}", f"{1e3 * row['largest_error_mm']:.1f}",
                     f"{row['time_per_press_s']:.2g}" if row["time_per_press_s"] < 10 else f"{row['time_per_press_s']:.0f}"])
    by_name = {row["policy"]: row for row in read["policies"]}
    paper, error = by_name["paper"], by_name["error, 20 um"]
    told = read["told_over_true"]
    words = ", ".join(f"{model} {told[model]['lowest']:.2f} to {told[model]['highest']:.2f} (median {told[model]['median']:.2f})"
                      for model in ("elastic", "foundation"))
    return (f"{source('choice')}\n\n"
            + table("policy, elastic, foundation, hyperelastic, mean error (um), worst (um), time a press (s)", rows)
            + f"\n\nThe paper's rule takes {paper['time_per_press_s'] / error['time_per_press_s']:.0f} times the time of the error "
              f"policy at 20 um, for {paper['mean_error_mm'] / error['mean_error_mm']:.0f} times its error. Expected over true "
              f"errors on these objects: {words}.")


def environment() -> str:
    """Observations a second of the environment for learning."""
    words = {"slide": "slides through new places", "again": "slides through known places", "held": "holds the object",
             "reset": "starts an episode", "episodes": "plays whole episodes at random"}
    rows = [[row["model"], words[row["case"]], row["places_pressed"], row["per_processor_s"], row["per_wall_s"]]
            for row in record("environment")["rows"]]
    head = "model, the hand, places pressed, a second of one core, a second by the clock with other work beside"
    off = [[row["model"], row["object"], row["step_mm"], row["mean_counts"], row["largest_counts"], row["largest_reading"],
            f"{row['mean_largest_share']:.1%}", f"{row['largest_share']:.1%}"] for row in record("environment")["errors"]]
    of_errors = ("model, object, step of places (mm), mean error (counts), largest error (counts), largest reading (counts), "
                 "largest error of a place in its largest reading: mean, at most")
    return f"{source('environment')}\n\n{table(head, rows)}\n\n{table(of_errors, off)}"


def vector_environment() -> str:
    """Observations a second of many hands, in one batch and as single environments."""
    words = {"slide": "slide through new places", "again": "slide through known places", "held": "hold their objects",
             "episodes": "play whole episodes at random", "later": "play the same episodes again"}
    rows = record("vector_environment")["rows"]
    found = {(row["mode"], row["case"]): row["per_second_of_two_cores"] for row in rows}
    hands = rows[0]["hands"]
    lines = [[f"all {hands} {text}", found["sync", case], found["vector_entry_point", case]] for case, text in words.items()]
    return f"{source('vector_environment')}\n\n{table('the hands, single environments (sync), one batch', lines)}"


def expected_error() -> str:
    """How well the error of the fast models is told for objects that nothing was fitted to."""
    read = record("expected_error")
    of = lambda name, digits=2: ", ".join(f"{value:.{digits}f}" for value in read[name])  # noqa: E731
    fit, test = read["fit"], read["test"]
    rows = [["fitted to, tested on: objects", f"{fit['objects']}, {test['objects']}"],
            ["their load steps for which the hyperelastic model holds", f"{fit['load_steps']}, {test['load_steps']}"],
            ["those of them for which the foundation model holds, too", f"{fit['presses']}, {test['presses']}"],
            ["true over expected error, each object left out in turn: 10, 90 %", of("interval")],
            ["share of the unseen presses between these (0.8 would be right), above (0.1)",
             f"{read['coverage_unseen']:.2f}, {read['above_unseen']:.2f}"],
            ["true over expected error of the unseen: 5, 25, 50, 75, 95 %", of("true_over_expected_unseen")],
            ["elastic model: true over expected (both models' difference): 5, 25, 50, 75, 95 %", of("elastic_true_over_expected")],
            ["the same: 90 %; share of the unseen above it",
             f"{read['elastic_interval'][1]:.3f}, {read['elastic_above_unseen']:.2f}"],
            ["elastic model alone: error over its map's root mean square: 5, 25, 50, 75, 95 %", of("elastic_relative")]]
    return f"{source('expected_error')}\n\n{table('what, value', rows)}"


def other_sensors() -> str:
    """Whether the 90 % bound of the expected error holds on sensors that it was not fitted to."""
    read, rows = record("expected_error_elsewhere"), []
    for model, sensors in read["summary"].items():
        for sensor, found in sensors.items():
            ratio = ", ".join(f"{value:.2f}" for value in found["error_over_bound_5_50_95"])
            rows.append([model, sensor, found["contacts"], found["load_steps"], f"{found['within_bound']:.3f}", ratio])
    head = "model, pad, contacts, load steps, share within the bound, error over bound: 5; 50; 95 %"
    return (f"{source('expected_error_elsewhere')} {read['contacts_done']} of {read['contacts_planned']} random contacts, in "
            f"order, each drawn from its own seed; {read['failed']} of them failed.\n\n{table(head, rows)}")


def anchors() -> str:
    """Presses of the study `decide` on a piece of the sensor: CalculiX at the same indentation."""
    read, rows = record("decide_anchors"), []
    for row in sorted(read["rows"], key=lambda row: (row["truth"], row["object"])):
        head = [row["truth"], row["object"].replace("_", " ")]
        if "failed" in row:
            rows.append([*head, *[""] * 5, "CalculiX stopped"])
            continue
        shares = " and ".join(f"{share[0]:.3f}" for share in row.get("lower_share", []))
        missed = [key.replace("_", " ") for key, met in row["within"].items() if not met]
        rows.append([*head, f"{row['force_n'][0]:g}", f"{row['indentation_mm'][0]:.3f}", f"{row['force'][0]:+.1%}",
                     f"{row['map_rms'][0]:.1%}; {row['map_largest'][0]:.1%}", shares, ", ".join(missed) or "all met"])
    head = ("truth, object, our force (N), indentation (mm), force of CalculiX over ours, interface's difference: rms; largest, "
            "lower feature's share: ours; CalculiX', missed")
    limits = ", ".join(f"{key.replace('_', ' ')} {limit:g}" for key, limit in read["tolerances"].items())
    return (f"{source('decide_anchors')} {len(read['rows'])} of {read['planned']} presses. Tolerances, stated before: {limits}.\n\n"
            f"{table(head, rows)}")


def solid_races() -> str:
    """A press of two solids by us and by others: processor time, and what of ours goes where."""
    rows = []
    for row in record("solid_races")["rows"]:
        ours, shares = row["ours"], row["ours"]["shares"]
        others = [row.get(name) for name in ("calculix", "ngsolve")]
        ratios = [_ratio(other, ours) if other else "" for other in others]
        apart = max((other["difference"] for other in others if other and not other.get("stopped")), default=None)
        rows.append([f"{ours['unknowns']:,}", row["increments"], ours["iterations"], f"{ours['cpu_seconds']:.3g}", *ratios,
                     "" if apart is None else f"{apart:.1%}", *(f"{shares[part] / ours['seconds']:.0%}"
                                                                for part in ("solution", "assembly")), f"{ours['peak_gb']:.1f}"])
    head = ("unknowns, increments, Newton steps, ours (s), CalculiX / ours, NGSolve / ours, forces apart, solution of our time, "
            "assembly of our time, memory (GB)")
    told = "Seconds are of the processor; empty: not run; above: stopped there."
    return f"{source('solid_races')} {told}\n\n{table(head, rows)}\n\n{_growth_of_solids()}"


def _growth_of_solids() -> str:
    """With which power of the unknowns processor time and memory of the first increment grow."""
    ours = [row["ours"] for row in record("solid_races")["rows"] if row["increments"] == 1]

    def power(what, small, large):
        return log(large[what] / small[what]) / log(large["unknowns"] / small["unknowns"])

    steps = ", ".join(f"{power('cpu_seconds', *pair):.2f} from {pair[0]['unknowns']:,} to {pair[1]['unknowns']:,}"
                      for pair in pairwise(ours))
    return (f"Time of the first increment grows with the power {steps}; memory over all with the power "
            f"{power('peak_gb', ours[0], ours[-1]):.2f}.")


def _ratio(other: dict, ours: dict) -> str:
    """Another program's processor time over ours, a lower bound where it was stopped."""
    return ("above " if other.get("stopped") else "") + f"{other['cpu_seconds'] / ours['cpu_seconds']:.2g}"


def solid_kernels() -> str:
    """Warp's kernels over the compiled loops: times on the processor, and on a GPU."""
    rows = []
    for name, where in (("solid_kernels", "processor"), ("solid_kernels_cuda", "GPU")):
        for row in record(name)["rows"]:
            ratios = [f"{row[f'{what}_ratio']:.2g}" for what in ("forces", "tangents", "matrix")]
            rows.append([where, row["threads"], row["elements"], f"{row['unknowns']:,}", *ratios,
                         f"{max(row['difference'], row['matrix_difference']):.0e}"])
    gpu = record("solid_kernels_cuda")
    head = "Warp on, threads of the loops, elements, unknowns, forces, tangents, matrix, largest difference"
    return (f"{source('solid_kernels')} `solid_kernels_cuda.json`, {gpu['date'][:10]}, {gpu['device']}.\n\n{table(head, rows)}")


def electrode_field() -> str:
    """What the gap formula and the assumed edges leave out of the field of the electrode grid."""
    read = record("electrode_field")
    rest, rows = read["rest"], []
    for row in read["rows"]:
        cells = [f"{row[way][f'{kind}_counts']:.3g}" for way in ("gap", "assumed") for kind in ("rms", "largest")]
        alone = row["alone"]
        rows.append([row["object"], f"{row['force_n']:g}", f"{row['largest']:.4g}", *cells, f"{alone['gain']:.2f}",
                     f"{alone['rms_counts_left']:.3g}"])
    head = ("object, N, largest reading, gap: rms, largest, assumed edges: rms, largest, grounded neighbours: gain, rms beside it")
    shares, over = rest["share_of_a_free_edge"], rest["over_plates"]
    said = (f"At rest a corner, side and inner electrode hold {over[0]:.3f}, {over[1]:.3f} and {over[2]:.3f} of the charge of "
            f"plates of their size; edges have {shares['inner']:.2f} (between neighbours) and {shares['outer']:.2f} (border) of a "
            "free edge's share, where 0.1 and 1 are assumed. Elements half as large again change a charge by up to "
            f"{read['mesh_error']:.1%}.\n\nDifferences in counts from the field with all electrodes driven together, over the 28 "
            "taxels; grounded neighbours: the gain that is left, and what it leaves:")
    return f"{source('electrode_field')} Counts at a gain of {read['gain']:g}.\n\n{said}\n\n{table(head, rows)}"


def random_presses() -> str:
    """Outcomes of random presses."""
    outcomes = ["presses", "reached", "outside", "flagged", "stopped", "refused", "nonsense", "hung", "crashed"]
    models = record("random_presses")["models"]
    rows = [[model, *(counts[outcome] for outcome in outcomes)] for model, counts in models.items()]
    return f"{source('random_presses')}\n\n" + table("model, " + ", ".join(outcomes), rows)


def hard_contacts() -> str:
    """Random presses under tilted edges and over the rim: how many reach their forces in three minutes, and how soon."""
    contacts = [row for row in record("contacts")["rows"] if row["set"] == "hard"]
    rows: list[list[object]] = []
    for said, own in (("one", [row for row in contacts if row["threads"] == 1]),
                      ("two, what stopped on one", [row for row in contacts if row["threads"] == 2]), ("in all", contacts)):
        reached = [row for row in own if row["steps"] == row["asked"]]
        rows.append([said, len(own), len(reached), f"{median(row['seconds'] for row in own):.0f}",
                     sum(row["flagged"] > 0 for row in reached), ", ".join(row["name"][5:] for row in own if row not in reached)])
    head = "threads, contacts, reached 20 N in 180 s, median (s), flagged at a load step, stopped by the time limit"
    return f"{source('contacts')} Seconds of one thread are the processor's, of two the clock's.\n\n{table(head, rows)}"


def poses() -> str:
    """Errors of poses that were found from taxels, with gradients and without."""
    read = record("pose_from_taxels")
    columns = ("median_mm", "median_degrees", "ninth_decile_mm", "ninth_decile_degrees", "median_presses", "mean_process_s")
    rows = [[name, *(f"{row[column]:.2g}" for column in columns)] for name, row in read["ways"].items()]
    head = "way, median (mm), median (degrees), nine in ten below (mm), nine in ten below (degrees), presses, processor (s)"
    return (f"{source('pose_from_taxels')} {read['poses']} poses, {read['force_n']:g} N, noise of {read['noise_counts']:g} counts, "
            f"at most {read['budget']} presses.\n\n{table(head, rows)}")


def pose_gradients() -> str:
    """Errors and times of the foundation model's derivatives by the pose."""
    rows = [[row["object"], *(f"{row[by]:.2f} ({row[f'{by}_steps_apart']:.2f})" for by in ("x", "y", "rx", "ry")),
             row["press_s"], row["gradient_s"]] for row in record("pose_gradients")["rows"]]
    return f"{source('pose_gradients')}\n\n{table('object, x, y, rx, ry, press (s), gradient (s)', rows)}"


def calibration_places() -> str:
    """What differences of presses and gradients cost, and how well they tell the map at a place beside."""
    rows = [[row["model"], row["object"], *(f"{row[column]:.2g}" if row[column] is not None else ""
             for column in ("differences_s", "gradient_s", "differences_left", "gradient_left"))]
            for row in record("calibration_places")["rows"]]
    head = "model, object, differences (s), gradient (s), differences: left, gradient: left"
    return f"{source('calibration_places')}\n\n{table(head, rows)}"


def numbers_page(counts: dict[str, int]) -> str:
    """The text of docs/reference/numbers.md."""
    parts = {"Tests": tests(counts), "Whole runs": whole_runs(), "Growth of a hyperelastic press with the sensor": growth(),
             "Error of the meshes": mesh_errors(), "Random presses": random_presses(),
             "Presses under tilted edges and over the rim": hard_contacts()}
    return HEAD + "".join(f"\n## {title}\n{text}\n" for title, text in parts.items())


def pages() -> dict[Path, str]:
    """Texts of the pages whose named tables come from the records."""
    tables = {PERFORMANCE: {"presses": presses(), "fast presses": fast_presses()}, EDGE: {"overhang": overhang()},
              FAST: {"batches": batches(), "batch": batch_on_gpu(), "choice": choice(), "expected error": expected_error(),
                     "other sensors": other_sensors()},
              DECIDE: {"anchors": anchors()}, CALIBRATE: {"calibration places": calibration_places()},
              SOLID: {"races": solid_races(), "kernels": solid_kernels()},
              VIRTUAL: {"electrode field": electrode_field()}, POSE: {"poses": poses(), "pose gradients": pose_gradients()},
              LEARN: {"environment": environment(), "vector environment": vector_environment()}}
    return {page: _with_tables(page.read_text(encoding="utf-8"), own) for page, own in tables.items()}


def _with_tables(text, tables):
    for name, content in tables.items():
        text = re.sub(BLOCK.format(name), lambda found, new=content: f"{found[1]}{new}\n{found[2]}", text, flags=re.DOTALL)
    return text


if __name__ == "__main__":
    NUMBERS.write_text(numbers_page(count_tests()), encoding="utf-8")
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")
