"""Write docs/results/STUDY.md from finished runs of studies other than the default one: claims, figures and small tables.

    python scripts/write_study_results.py results/real results/markers      (`make results`: all that are there)
"""

import argparse
import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path

import pandas as pd
from keep_presses import commits
from write_results import FOLDER, ROOT, git, markdown, small

from softtact.errors import InputError
from softtact.reporting.run_record import run_record, run_sentence

CLAIMS, LARGEST = "tables/claims.csv", 100_000     # bytes of a table that is kept
UP_TO_DATE = "Nothing to be done"     # what Snakemake says of a study whose results follow from its files, code and settings
TITLES = {"real": "Gels with a camera on measured data", "markers": "Marker images of a gel",
          "decide": "Do the paper's claims hold?", "skin": "Robot skins", "probe": "A palpation sensor",
          "grasps": "Grasps by a robot"}


def keep(run: Path) -> dict[str, str]:
    """Copy what the page shows into docs/results/STUDY; what the run is. Raises InputError where it is not finished."""
    _refuse_outdated(run)
    kept = FOLDER / run.name
    shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True)
    for table in sorted((run / "tables").glob("*.csv")):
        if table.stat().st_size <= LARGEST:
            shutil.copy(table, kept)
    for picture in sorted((run / "figures").glob("*.png")):
        small(picture, kept / picture.name)
    return {"date": date.today().isoformat(), "commit": git("rev-parse", "HEAD"),
            "run": run_sentence(run_record(run / "benchmarks")) + _sittings(run.name)}


def _sittings(study):
    """What is to be said of presses that were kept over several sittings."""
    kept = commits(study)
    return "" if not kept else " Its hyperelastic presses were made over several sittings and kept at the commits " + ", ".join(
        f"`{commit}` ({count})" for commit, count in kept.most_common()) + "."


def _refuse_outdated(run: Path) -> None:
    """Refuse what is no finished run of this checkout: then the page's commit is that of the run.

    Presses that were kept at several commits are not made again for a later one; the page names them.
    """
    triggers = ["--rerun-triggers", "mtime"] if commits(run.name) else []
    said = subprocess.run([sys.executable, "-m", "snakemake", "--configfile", f"config/{run.name}.yaml", "--dry-run", *triggers],
                          cwd=ROOT, capture_output=True, text=True)
    if run.resolve() != ROOT / "results" / run.name or UP_TO_DATE not in said.stdout + said.stderr:
        raise InputError(f"{run}: is not a finished run of this checkout and its sources; run `make {run.name}` first.")


def page(name: str, made: dict[str, str]) -> str:
    """The page's text, from what docs/results/STUDY keeps."""
    kept = FOLDER / name
    claims = pd.read_csv(kept / Path(CLAIMS).name, keep_default_na=False)
    parts = [f"# {TITLES.get(name, name)}\n",
             f"`make results` writes this page from a finished run of `make {name}`. Do not edit it. Made on {made['date']} at "
             f"commit `{made['commit'][:12]}`. {made['run']}\n", "## Claims\n",
             f"Rule and evidence of each: [claims.csv]({name}/claims.csv).\n",
             markdown(claims[["claim", "paper", "ours", "uncertainty", "verdict"]]) + "\n", "## Figures\n"]
    parts += [f"![{picture.stem.replace('_', ' ')}]({name}/{picture.name})\n" for picture in sorted(kept.glob("*.png"))]
    tables = ", ".join(f"[{table.stem.replace('_', ' ')}]({name}/{table.name})" for table in sorted(kept.glob("*.csv")))
    return "\n".join([*parts, f"## Tables\n\n{tables}.\n"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="results/STUDY")
    try:
        for given in parser.parse_args().runs:
            (FOLDER / f"{given.name}.md").write_text(page(given.name, keep(given)), encoding="utf-8")
    except InputError as error:
        sys.exit(str(error))
