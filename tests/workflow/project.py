"""A copy of the project on which tests run Snakemake and read its plan."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("workflow", "profiles", "config", "src")
PRESSES = "results/*/presses/*/*/*.nc"
STUB = f"-S {Path(__file__).with_name('stub_runner.py')}"


class Project:
    """A project folder; the stages are stood in for by `stub_runner.py`."""

    def __init__(self, folder, *, configfile="config/tiny.yaml"):
        self.folder, self.configfile = Path(folder), configfile

    @classmethod
    def of_sources(cls, folder):
        """The project as it stands in the repository, without results."""
        ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
        for part in PARTS:
            shutil.copytree(ROOT / part, Path(folder) / part, ignore=ignored)
        shutil.copy2(ROOT / "Snakefile", folder)
        return cls(folder)

    def copy(self, folder):
        """A copy with times and Snakemake's records, so that what is finished here is finished there."""
        shutil.copytree(self.folder, folder)
        return type(self)(folder)

    def snakemake(self, *arguments, check=True, environment=None):
        """Run Snakemake to its end; the completed process with its output."""
        done = subprocess.run(self._command(*arguments), cwd=self.folder, env=self._environment(environment),
                              text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=900)
        assert done.returncode == 0 or not check, done.stdout
        return done

    def start(self, *arguments, environment=None):
        """Start Snakemake in a process group of its own."""
        return subprocess.Popen(self._command(*arguments), cwd=self.folder, env=self._environment(environment),
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)

    def plan(self, *arguments):
        """What Snakemake would run now: {rule: [wildcards of each job]}."""
        output = self.snakemake("--dry-run", *arguments).stdout
        return read_plan(output)

    def wait_for(self, count, pattern, *, within_s=600):
        """Wait until there are so many files whose path in the project follows a pattern."""
        end = time.monotonic() + within_s
        while len(list(self.folder.glob(pattern))) < count:
            assert time.monotonic() < end, f"fewer than {count} files {pattern} after {within_s} s"
            time.sleep(0.05)

    def presses(self):
        """The press files that are there."""
        return list(self.folder.glob(PRESSES))

    def edit(self, path, old, new):
        """Replace one piece of text in a file of the project."""
        text = (self.folder / path).read_text()
        assert text.count(old) >= 1, f"{path} no longer contains {old!r}"
        (self.folder / path).write_text(text.replace(old, new, 1))

    def _command(self, *arguments):
        return [sys.executable, "-m", "snakemake", "--cores", "2", "--configfile", self.configfile, *arguments]

    def _environment(self, more):
        source = os.pathsep.join([str(self.folder / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])     # the copy's own
        return os.environ | {"SOFTTACT_RUNNER": STUB, "PYTHONPATH": source} | (more or {})


def read_plan(output):
    """{rule: [{wildcard: value}]} of a dry run's output, without the target rule."""
    plan = defaultdict(list)
    for block in re.split(r"\n(?=(?:local)?rule )", output)[1:]:
        rule = re.match(r"(?:local)?rule (\w+):", block)[1]
        wildcards = re.search(r"^    wildcards: (.*)$", block, flags=re.MULTILINE)
        pairs = wildcards[1].split(", ") if wildcards else []
        if rule != "all":
            plan[rule].append(dict(pair.split("=") for pair in pairs))
    return dict(plan)
