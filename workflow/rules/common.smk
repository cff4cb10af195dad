# What the rules of every kind of study share: the checked study, where results lie, and the one command line that runs a stage.

import json
import os
import sys
from pathlib import Path

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.outputs import held
from softtact.studies.code_closure import code_closure, code_digest
from softtact.studies.cost import cost_lines, origin_of, read_costs
from softtact.studies.jobs import stage_source, stages_of
from softtact.studies.registry import checked_study

try:
    for _file in workflow.configfiles:  # Snakemake's own reader keeps the last of two equal keys
        read_yaml(_file, missing="there is no such configuration.")
    OPENED = checked_study(config, next(iter(workflow.configfiles), None))
except InputError as error:
    sys.exit(f"softtact: {error}")

STUDY, KIND = OPENED.study, OPENED.kind
RESULTS = f"results/{STUDY.name}"

_there = next(path for path in (Path(RESULTS), *Path(RESULTS).parents) if path.exists())
if not _there.is_dir() or not os.access(_there, os.W_OK):
    sys.exit(f"softtact: {RESULTS}: cannot be written to; {_there} is no folder, or not yours to write in: correct that.")

# The running interpreter, activated or not. It reaches the shell by the environment, for where it lies is no reason to
# run anything again.
os.environ["SOFTTACT_PYTHON"] = sys.executable
os.environ.setdefault("SOFTTACT_RUNNER", "-m softtact.studies")
os.environ["SOFTTACT_WORKFLOW"] = str(os.getpid())  # a stage ends with this process, also if it is killed


def code_files(stage):
    """The source files that a stage runs: those of this folder, where it has them."""
    source = Path("src")
    return code_closure(stage_source(f"{KIND}.{stage}", source=source), source=source) if (source / "softtact").exists() else []


def code(stage):
    """Digest of the source files that a stage runs, a parameter of its rule: an edit is a reason to run it again, a checkout that
    changes their dates alone is none."""
    source = Path("src")
    return code_digest(stage_source(f"{KIND}.{stage}", source=source), source=source) if (source / "softtact").exists() else ""


def log_of(stage, part="all"):
    """Where a rule's jobs write what their stage says; `part` tells them apart."""
    return f"{RESULTS}/logs/{stage}/{part}.log"


def benchmark_of(stage, part="all"):
    """Where Snakemake writes a job's time and memory."""
    return f"{RESULTS}/benchmarks/{stage}/{part}.tsv"


def run_stage(stage):
    """The shell line of a rule: its stage on the job's files, with its settings, heard on screen and in the log."""
    libraries = ("OMP", "MKL", "OPENBLAS", "NUMBA")
    threads = " ".join(f"{library}_NUM_THREADS={{threads}}" for library in libraries)
    settings = "--settings {params.settings:q} --threads {threads}"
    command = f'"$SOFTTACT_PYTHON" $SOFTTACT_RUNNER {KIND}.{stage}'
    return f"{threads} {command} {{params.files:q}} {settings} 2>&1 | tee {{log:q}} >&2"


def files(wildcards, input, output):
    """A job's named inputs and outputs as the runner takes them."""
    return _arguments("--in", dict(input.items())) + _arguments("--out", dict(output.items()))


def _arguments(option, named):
    """[option, name=path, ...]; a list of paths is marked as one, however short, and `name[]=` is an empty one."""
    arguments = []
    for name, paths in named.items():
        single = isinstance(paths, str)
        for path in [paths] if single else paths or [""]:
            arguments += [option, f"{name}={path}" if single else f"{name}[]={path}"]
    return arguments


def as_settings(**values):
    """A stage's settings: JSON of just the values that it uses, for only their change reruns it."""
    return json.dumps(values, sort_keys=True)


def shown(path):
    """An output as `snakemake --report` shows it: the page, the tables, the figures; other files as they are."""
    place = Path(path)
    kind = {"figures": "figure", "tables": "table"}.get(place.parent.name) or ("page" if place.name == "report.html" else None)
    if kind is None or place.suffix not in (".png", ".html", ".csv"):
        return path
    special = Path(workflow.basedir, "report", f"{place.stem}.rst")
    caption = f"../report/{special.name if special.exists() else f'{kind}.rst'}"
    return report(path, caption=caption, category=f"{STUDY.name}: {kind}s", labels={"file": place.name})


def all_shown(named):
    """The same of named outputs."""
    return {name: shown(path) for name, path in named.items()}


HELD = []  # open as long as this process lives


def hold_study():
    """Keep a second run of this study out."""
    HELD.append(held(RESULTS))
    try:
        HELD[-1].__enter__()
    except InputError as error:
        raise WorkflowError(str(error)) from None


def tell_cost():
    """Say what the whole study takes, before it starts, where that is known."""
    measured = read_costs()
    try:
        costs = OPENED.costs(measured, RESULTS)
    except InputError:  # an archive's size is known after its import
        return
    print(*cost_lines(STUDY.name, costs, origin=origin_of(OPENED, measured), cores=workflow.cores), sep="\n", file=sys.stderr)


onstart:
    hold_study()
    tell_cost()
