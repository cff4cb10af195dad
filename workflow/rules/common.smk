# What all rules share: the checked study, where results lie, and the one command line that runs a stage.

import fcntl
import json
import os
import re
import sys
from pathlib import Path

from softtact.studies.code_closure import code_closure
from softtact.studies.hybrid.config import load_study
from softtact.studies.cost import cost_lines, read_costs, study_costs
from softtact.errors import InputError
from softtact.files import read_yaml

try:
    for _file in workflow.configfiles:     # Snakemake's own reader keeps the last of two equal keys
        read_yaml(_file, missing="there is no such configuration.")
    STUDY = load_study(config)
except InputError as error:
    sys.exit(f"softtact: {error}")

RESULTS = f"results/{STUDY.name}"

_there = next(path for path in (Path(RESULTS), *Path(RESULTS).parents) if path.exists())
if not _there.is_dir() or not os.access(_there, os.W_OK):
    sys.exit(f"softtact: {RESULTS}: cannot be written to; {_there} is no folder, or not yours to write in: correct that.")

# The running interpreter, activated or not. It reaches the shell by the environment, for where it lies is no reason to
# run anything again.
os.environ["SOFTTACT_PYTHON"] = sys.executable
os.environ.setdefault("SOFTTACT_RUNNER", "-m softtact.studies.hybrid.stages")


wildcard_constraints:
    set="|".join(STUDY.items_of),
    item="[a-z0-9_-]+",
    model="[a-z0-9_]+",
    material="[a-z0-9_]+",


def code(stage):
    """The source files whose edit is a reason to run a stage again."""
    return code_closure(f"softtact.studies.hybrid.stages.{stage}") if Path(f"src/softtact/studies/hybrid/stages/{stage}.py").exists() else []


def log_of(stage, part="all"):
    """Where a rule's jobs write what their stage says; `part` tells them apart."""
    return f"{RESULTS}/logs/{stage}/{part}.log"


def benchmark_of(stage, part="all"):
    """Where Snakemake writes a job's time and memory."""
    return f"{RESULTS}/benchmarks/{stage}/{part}.tsv"


def rule_name(*parts):
    """The name of a rule that a loop makes."""
    return re.sub(r"\W", "_", "_".join(parts))


def run_stage(stage):
    """The shell line of a rule: its stage on the job's files, with its settings, heard on screen and in the log."""
    libraries = ("OMP", "MKL", "OPENBLAS", "NUMBA")
    threads = " ".join(f"{library}_NUM_THREADS={{threads}}" for library in libraries)
    settings = "--settings {params.settings:q} --threads {threads}"
    command = f'"$SOFTTACT_PYTHON" $SOFTTACT_RUNNER {stage}'
    return f"{threads} {command} {{params.files:q}} {settings} 2>&1 | tee {{log:q}} >&2"


def files(wildcards, input, output):
    """A job's named inputs and outputs as the runner takes them; `code` is a reason to run, not an input."""
    named = {key: paths for key, paths in input.items() if key != "code"}
    return _arguments("--in", named) + _arguments("--out", dict(output.items()))


def _arguments(option, named):
    """[option, name=path, ...]; a list of paths is marked as one, however short."""
    arguments = []
    for name, paths in named.items():
        single = isinstance(paths, str)
        for path in [paths] if single else paths:
            arguments += [option, f"{name}={path}" if single else f"{name}[]={path}"]
    return arguments


def as_settings(**values):
    """A stage's settings: JSON of just the values that it uses, for only their change reruns it."""
    return json.dumps(values, sort_keys=True)


def card_of(layer):
    """The fitted card of the material of one of the sensor's layers."""
    return f"{RESULTS}/materials/{STUDY.sensor[layer]['material']}.json"


def model_files(wildcards):
    """The prepared files that a model's presses start from, as the configuration lists them under `needs`."""
    return needs_of(wildcards.model)


def needs_of(model):
    """The same of a model by its name."""
    return _prepared(model, STUDY.values.models[model].needs)


def compliance_files(wildcards):
    """The prepared files that a model's compliance is computed from."""
    return _prepared(wildcards.model, STUDY.values.models[wildcards.model].prepared_from)


def _prepared(model, names):
    """Prepared files of a model by their names."""
    prepared = {
        "mesh": f"{RESULTS}/sensor/{model}/mesh.vtu",
        "frustum_law": f"{RESULTS}/sensor/{model}/frustum_law.npz",
        "compliance": f"{RESULTS}/sensor/{model}/compliance.npz",
        "card_dielectric": card_of("dielectric"),
        "card_cover": card_of("cover"),
    }
    return {name: prepared[name] for name in names}


def press_settings(item):
    """What a press uses of an item; its label, say, is none of a solver's business."""
    return {"name": item.id, "set": item.set, "unit": item.unit, "pose": item.pose}


def mesh_of(model):
    """Mesh settings of a model, as far as the configuration states them."""
    return STUDY.values.models[model].mesh.model_dump(mode="json", exclude_none=True)


def friction_of(model):
    """A model's own coefficients of friction; None where it takes the sensor's."""
    friction = STUDY.values.models[model].friction
    return friction and friction.model_dump(mode="json")


def plain(section):
    """A section of the configuration as JSON values."""
    return section.model_dump(mode="json")


def pressed_with(model, items, forces_n):
    """The settings of a press of an item, or of several in one job, with a model of the configuration."""
    chosen = STUDY.values.models[model]
    pressed = [press_settings(item) for item in items]
    return as_settings(
        **({"items": pressed} if len(pressed) > 1 else {"item": pressed[0]}),
        sensor=STUDY.sensor,
        model=model,
        kind=chosen.kind,
        laws=chosen.laws,
        mesh=mesh_of(model),
        friction=friction_of(model),
        device=chosen.device,
        forces_n=forces_n,
    )


def presses(models):
    """The press files of some models, in the study's order."""
    return [f"{RESULTS}/presses/{item.set}/{item.id}/{model}.nc" for model in models for item in STUDY.items()]


def everything(workflow):
    """All files of the study: one that went missing is made again, though what was made from it is still there."""
    without = ("compare_policies", "draw_fig7_maps", "draw_fig8_policies") if STUDY.archive else ()
    rules_asked = [rule for rule in workflow.rules if not rule.has_wildcards() and rule.name not in ("all", *without)]
    fixed = [path for rule in rules_asked for path in rule.output]
    models = () if STUDY.archive else STUDY.pressed_with
    sensor = [path for model in models for path in needs_of(model).values()]
    materials = [path for name in STUDY.values.materials for path in (*data_of_material(name), *figure_files(f"material_{name}").values())]
    learning = [path for name in ("model.pt", "history.csv", "timing.csv") for path in learned(name)]
    learning += [f"{RESULTS}/learning/{model}/{name}" for model in STUDY.tested for name in ("search.csv", "best.json")]
    readings = [] if STUDY.archive else [f"{RESULTS}/tactile/{item.set}/{item.id}.nc" for item in STUDY.items()]
    return sorted({*fixed, *sensor, *materials, *learning, *presses(models), *readings})


def samples_of():
    """What data sets are built from, as inputs: a file for each press and reading, or what the archive was turned into."""
    if STUDY.archive:
        return {name: f"{RESULTS}/{name}" for name in ("presses", "tactile")} | {"item_list": f"{RESULTS}/published/items.json"}
    tactile = [f"{RESULTS}/tactile/{item.set}/{item.id}.nc" for item in STUDY.items()]
    return {"presses": presses(STUDY.learnt_from), "tactile": tactile}


HELD = []  # open as long as this process lives


def hold_study():
    """Keep a second run of this study out.

    The system drops this lock when its holder dies, however it dies; Snakemake's own would stay behind.
    """
    Path(RESULTS).mkdir(parents=True, exist_ok=True)
    HELD.append(open(f"{RESULTS}/.running", "w"))
    try:
        fcntl.flock(HELD[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise WorkflowError(f"{RESULTS}: another run of this study is at work; wait for its end.") from None


def tell_cost():
    """Say what the whole study takes, before it starts; an archive's size is not known then."""
    if not STUDY.archive:
        measured = read_costs()
        print(*cost_lines(STUDY, study_costs(STUDY, measured), measured, cores=workflow.cores), sep="\n", file=sys.stderr)


onstart:
    hold_study()
    tell_cost()
