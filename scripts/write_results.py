"""Write the page of results from a finished run of a study: docs/results.md, its tables and small pictures in docs/results/.

    python scripts/write_results.py [results/default]      (`make results`)
    python scripts/write_results.py --page                 writes the page again from docs/results/, without the run
    python scripts/write_results.py --check                warns where the code has changed since; `make docs` asks

The page names its run: study, digest of its settings, commit, machine, seeds, and a digest of every source file that made it. Where
the rules of the claims have changed since that run, the page says so and shows what the rules of today make of the kept table.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path

import pandas as pd
import yaml
from PIL import Image
from results_found import found

from softtact.errors import InputError
from softtact.evaluation.decisions import ARCHIVE, CONSISTENT, CONTRADICTION, LEAST_OBJECTS, MEASUREMENTS, UNDECIDED
from softtact.evaluation.policies import with_chance
from softtact.files import read_yaml
from softtact.reporting.run_record import run_record, run_sentence
from softtact.reporting.words import KINDS, PREDICTORS, SETS, header
from softtact.studies.code_closure import code_closure
from softtact.studies.hybrid.claims.in_print import claims_in_print
from softtact.studies.hybrid.claims.of_tests import claims_of_constants
from softtact.studies.hybrid.claims.of_times import NOT_JUDGED
from softtact.studies.hybrid.mesh_error import mesh_sentences, with_mesh_error
from softtact.studies.hybrid.tables import PRINTED_COUNTS, PRINTED_TIMES, machine
from softtact.studies.jobs import stage_source, stages_of

ROOT = Path(__file__).resolve().parents[1]
PAGE, FOLDER = ROOT / "docs" / "results.md", ROOT / "docs" / "results"
WIDTH_PX, COLOURS = 900, 64
FIGURES = {
    "fig2_section": "Figure 2. Section through the sensor, at rest and pressed.",
    "fig4_complexity": "Figure 4. Complexity of the objects, and the model that the rule chooses.",
    "fig5_ftir": "Figure 5. Contact area of the dielectric on glass.",
    "fig6_ssim": "Figure 6. SSIM of each item, with the marks of predictors that need no network.",
    "fig7_maps": "Figure 7. Deformation maps of both models, and tactile maps predicted and felt by the virtual sensor.",
    "fig8_policies": "Figure 8. What each policy of choosing a model costs, and which error it accepts against the study's own "
                     "hyperelastic model, which has 0 by definition; the error of its mesh is stated above.",
    "fig9_networks": "Figure 9. The printed network beside another, on the same split.",
    "fig10_learning_curve": "Figure 10. SSIM against the number of training maps."}
# Title, file below the run's folder, and the columns that the page shows; all columns stand in the CSV beside it.
TABLES = {
    "Scores of the networks": ("evaluation/summary.csv", None),
    "Scores beside predictors without a network": ("tables/levels.csv", None),
    "Networks": ("tables/networks.csv", ["model", "architecture", "weights", "set", "ssim", "mae_counts", "mean_reading_ssim",
                                         "quadratic_ssim", "skill", "learning_rate", "remains"]),
    "Seeds": ("tables/seeds.csv", None),
    "SSIM against the gain of the readings": ("tables/gains.csv", None),
    "Policies": ("tables/policies.csv", None),
    "Time per tactile map": ("tables/table3_timing.csv", None)}
NOTES = {
    "Policies": "Errors are distances from the study's own hyperelastic presses. That model has 0 by definition: it is the measure "
                "here and no truth; the error of its mesh follows. The row of a random choice has as many "
                "presses of each model as the paper's rule. Times are of one machine, with what else ran there.",
    "Scores of the networks": "Maps are readings of few presses: those of one press differ by noise and drift alone."}
BY_MESH = ("SSIM against the gain of the readings", "Policies")     # score the tested model in columns or by distance, not in rows
CLAIMS, GAPS = "tables/claims.csv", "tables/gaps.csv"
RULES = ("src/softtact/studies/hybrid/claims/", "src/softtact/evaluation/decisions.py")
NOT_AGAIN = "not judged again"
MATERIALS = ROOT / "src/softtact/sensors/data/materials"


def sources() -> dict[str, str]:
    """Source file to the first 16 digits of its SHA-256, for all files that any stage of a study runs."""
    source = ROOT / "src"
    stages = [stage_source(stage, source=source) for stage in stages_of("hybrid", source=source)]
    files = sorted({file for stage in stages for file in code_closure(stage, source=source)})
    return {str(Path(file).relative_to(ROOT)): digest(Path(file))[:16] for file in files}


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def changed(recorded: dict[str, str]) -> list[str]:
    """Source files that are new, gone or other than recorded."""
    now = sources()
    return sorted(file for file in recorded.keys() | now.keys() if recorded.get(file) != now.get(file))


def provenance(run: Path) -> dict[str, object]:
    """What the run is and where it was made; refused where it is not finished or older than the code."""
    config = run / "config.yaml"
    for needed in (config, run / "report.html", run / CLAIMS, run / GAPS):
        if not needed.is_file():
            raise InputError(f"{needed}: is missing, so this is no finished run of a study; run `make` first.")
    newest = max((ROOT / file).stat().st_mtime for file in sources())
    if (run / "report.html").stat().st_mtime < newest:
        raise InputError(f"{run / 'report.html'}: is older than the code; run `make` first, which makes again what depends on it.")
    values = yaml.safe_load(config.read_text(encoding="utf-8"))
    return {"study": values["study"], "settings_sha256": digest(config), "seed": values["seed"], "date": date.today().isoformat(),
            "commit": git("rev-parse", "HEAD"), "edited": bool(git("status", "--porcelain", "--untracked-files=no")),
            "machine": machine(), "processors": os.cpu_count(), "run": run_sentence(run_record(run / "benchmarks")),
            "sources": sources()}


def git(*arguments: str) -> str:
    """What git says."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def small(picture: Path, to: Path) -> None:
    """A picture as a PNG of few colours, at most `WIDTH_PX` wide."""
    image = Image.open(picture).convert("RGB")
    if image.width > WIDTH_PX:
        image = image.resize((WIDTH_PX, round(image.height * WIDTH_PX / image.width)), Image.Resampling.LANCZOS)
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(to, optimize=True)


def cell(value: object) -> str:
    """A value in a table of Markdown."""
    text = f"{value:.3g}" if isinstance(value, float) and abs(value) < 1000 else str(value)
    text = {**PREDICTORS, **KINDS, **SETS}.get(text, text)
    return "" if text == "nan" else text.replace("|", "\\|").replace("\n", " ")


def markdown(frame: pd.DataFrame) -> str:
    """A frame as a table with headings in words."""
    lines = [[header(name) for name in frame.columns], ["---"] * frame.shape[1],
             *([cell(value) for value in row] for row in frame.itertuples(index=False))]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def counts_in_words(verdicts: pd.Series) -> str:
    """How many claims have which verdict."""
    return ", ".join(f"{number} {verdict}" for verdict, number in verdicts.value_counts().items())


def claims_in_words(claims: pd.DataFrame, made: dict[str, object]) -> str:
    """How many claims have which verdict, and all of them by verdict; beside it the rules of today where they are others."""
    shown = claims.sort_values("verdict", kind="stable")
    columns = ["claim", "where", "paper", "ours", "verdict"]
    head = (f"{len(claims)} claims: {counts_in_words(claims.verdict)}. Rule, uncertainty and evidence of each: "
            "[claims.csv](results/claims.csv).")
    if not rules_changed(made):
        return f"{head}\n\n{markdown(shown[columns])}"
    printed = {row["claim"]: row for row in print_alone()}
    shown = shown.assign(today=verdicts_today(shown, made))
    new = pd.DataFrame([row for claim, row in printed.items() if claim not in set(claims.claim)])
    note = (f"**These verdicts are older than the rules.** The run is of commit `{str(made['commit'])[:12]}`, and the rules have "
            "changed since ([which rules](reference/report.md#the-claims)); it was not repeated. The last column is what the rules "
            f"of today make of the kept table: print is judged again, a claim on fewer than {LEAST_OBJECTS} objects is "
            f"{UNDECIDED}, and *{NOT_AGAIN}* stands where a run is needed. In it: {counts_in_words(shown.today)}.")
    tables = markdown(shown[[*columns, "today"]].rename(columns={"today": "by the rules of today"}))
    added = (f"\n\nClaims on print that the run did not judge:\n\n{markdown(new[columns])}" if len(new) else "")
    return f"{head}\n\n{note}\n\n{tables}{added}"


def rules_changed(made: dict[str, object]) -> bool:
    """Whether the rules of the claims are others than those of the run."""
    return any(file.startswith(RULES) for file in changed(made["sources"]))


def verdicts_today(claims: pd.DataFrame, made: dict[str, object]) -> pd.Series:
    """The verdicts of a kept table; by the rules of today where these have changed since."""
    if not rules_changed(made):
        return claims.verdict
    printed = {row["claim"]: row for row in print_alone()}
    return pd.Series([judged_today(row, printed) for row in claims.itertuples()], index=claims.index)


def print_alone() -> list[dict[str, str]]:
    """Rows of the claims that need no run: the paper's numbers and words against each other."""
    cards = [{"material": name, **read_yaml(MATERIALS / f"{name}.yaml", missing="the package is not complete.")}
             for name in ("polyurethane", "neoprene")]
    return [*(row for card in cards for row in claims_of_constants(card)),
            *claims_in_print(printed_counts=PRINTED_COUNTS, printed_times=PRINTED_TIMES)]


def judged_today(row: object, printed: dict[str, dict[str, str]]) -> str:
    """The verdict that the rules of today give to a row of a kept table of claims, as far as the row tells."""
    if row.claim in printed:
        return printed[row.claim]["verdict"]
    if row.verdict in (ARCHIVE, MEASUREMENTS, UNDECIDED, CONSISTENT, CONTRADICTION):
        return row.verdict
    if row.claim in NOT_JUDGED or re.match(r"object \d: ", row.claim):      # seconds; one object
        return UNDECIDED
    stated = [int(number) for number in re.findall(r"(\d+) objects?\b", row.uncertainty)]
    return UNDECIDED if stated and min(stated) < LEAST_OBJECTS else NOT_AGAIN


def page(made: dict[str, object]) -> str:
    """The page's text, from the tables and pictures in docs/results/."""
    edited = ", with edited files" if made["edited"] else ""
    claims = pd.read_csv(FOLDER / Path(CLAIMS).name, keep_default_na=False)
    config = yaml.safe_load((FOLDER / "config.yaml").read_text(encoding="utf-8"))
    meshes = " ".join(mesh_sentences(config))
    parts = ["# Results of the default study\n" if made["study"] == "default" else f"# Results of the study {made['study']}\n",
             "## What was found\n",
             *(f"* {sentence}" for sentence in found(FOLDER, verdicts_today(claims, made), str(made["run"]))),
             "\n## What was run\n",
             "`make results` writes this page from a finished run. Do not edit it.\n",
             f"Made on {made['date']} at commit `{str(made['commit'])[:12]}`{edited}, on {made['machine']} with "
             f"{made['processors']} processors; seed {made['seed']}; SHA-256 of the run's [settings](results/config.yaml) "
             f"`{made['settings_sha256'][:16]}`. {made['run']}\n",
             "## What is synthetic, and what is missing\n",
             "All readings are those of a virtual sensor, and the stress-strain curves are made from the paper's printed constants "
             "with stated noise. No number here was measured on a real sensor.\n"]
    parts += [f"* {sentence}" for sentence in pd.read_csv(FOLDER / Path(GAPS).name).sentence] + [""]
    for name, caption in FIGURES.items():
        if (FOLDER / f"{name}.png").is_file():
            parts.append(f"## {caption.partition('.')[0]}\n\n![{caption}](results/{name}.png)\n\n{caption}\n")
    parts += ["## Claims of the paper\n", *([meshes + "\n"] if meshes else []), claims_in_words(claims, made) + "\n"]
    for title, (file, columns) in TABLES.items():
        kept = FOLDER / Path(file).name
        if kept.is_file():
            frame = with_chance(pd.read_csv(kept)) if title == "Policies" else pd.read_csv(kept)
            chosen = frame[[name for name in columns if name in frame]] if columns else frame
            shown = with_mesh_error(chosen, config)
            notes = [NOTES[title]] if title in NOTES else []
            notes += [meshes] if meshes and title in BY_MESH else []
            note = "".join(f"{sentence}\n\n" for sentence in notes)
            parts.append(f"## {title}\n\n{note}[{kept.name}](results/{kept.name})\n\n{markdown(shown)}\n")
    return "\n".join(parts)


def write(run: Path) -> None:
    """Write page, tables and pictures of a run."""
    made = provenance(run)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for kept in FOLDER.iterdir():
        if kept.is_file() and kept.suffix != ".md":     # pages and folders are of other studies
            kept.unlink()
    for name in FIGURES:
        if (run / "figures" / f"{name}.png").is_file():
            small(run / "figures" / f"{name}.png", FOLDER / f"{name}.png")
    for file in ["config.yaml", CLAIMS, GAPS, *(file for file, _ in TABLES.values())]:
        if (run / file).is_file():
            shutil.copy(run / file, FOLDER / Path(file).name)
    (FOLDER / "run.json").write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(made), encoding="utf-8")


def write_page() -> None:
    """Write the page again from what docs/results/ keeps of a run."""
    if not (FOLDER / "run.json").is_file():
        raise InputError(f"{FOLDER / 'run.json'}: is missing, so no run is kept there; run `make` and `make results` first.")
    PAGE.write_text(page(json.loads((FOLDER / "run.json").read_text(encoding="utf-8"))), encoding="utf-8")


def check() -> None:
    """Say on stderr where the page is older than the code that made it; that is a warning and no error."""
    if not (FOLDER / "run.json").is_file():
        print("warning: docs/results.md was not made yet. Run `make` and `make results`.", file=sys.stderr)
        return
    made = json.loads((FOLDER / "run.json").read_text(encoding="utf-8"))
    files = changed(made["sources"])
    if files:
        print(f"warning: docs/results.md was made at commit {made['commit'][:12]}; {len(files)} source files have changed since "
              f"({', '.join(files[:3])}{', ...' if len(files) > 3 else ''}). Run `make` and `make results` to make it again.",
              file=sys.stderr)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", nargs="?", type=Path, default=ROOT / "results" / "default")
    parser.add_argument("--check", action="store_true", help="warn where the code has changed since the page was made")
    parser.add_argument("--page", action="store_true", help="write the page again from docs/results/, without the run")
    arguments = parser.parse_args()
    try:
        check() if arguments.check else write_page() if arguments.page else write(arguments.run)
    except InputError as error:
        sys.exit(str(error))
