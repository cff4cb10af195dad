"""What the paper's scale takes, from a share of its presses: `python benchmarks/paper_share.py [EVERY] [CORES]`.

Runs every 20th press of config/paper.yaml with all models under the workflow, in results/paper/, goes on where it was stopped, and
takes the times of `softtact cost`, which are then this study's own; some three core hours. Presses are drawn over all objects and
places. Run nothing beside it. Writes benchmarks/results/paper_share.json: `hours` of all jobs, `hours_left` of those not yet done.
"""

import subprocess
import sys
from dataclasses import asdict

import record

from softtact.studies.cost import read_costs
from softtact.studies.registry import open_study

CONFIG = "config/paper.yaml"


def targets(study, every):
    """Files of every n-th item's presses with all models."""
    return [f"results/{study.name}/presses/{item.set}/{item.id}/{model}.nc" for item in list(study.items())[::every]
            for model in study.pressed_with]


def main(every=20, cores=2):
    """Press, then print and write what the whole study takes."""
    opened = open_study(CONFIG)
    wanted = targets(opened.study, every)
    subprocess.run([sys.executable, "-m", "snakemake", "--cores", str(cores), "--keep-going", "--rerun-incomplete",
                    "--configfile", CONFIG, "--", *wanted], check=False)
    costs = opened.costs(read_costs(), f"results/{opened.name}")
    hours = [cost.jobs * cost.each_s / 3600 for cost in costs]      # of all jobs, those just pressed included
    rows = [asdict(cost) | {"hours": round(whole, 2), "hours_left": round(cost.hours, 2)}
            for cost, whole in zip(costs, hours, strict=True)]
    presses = sum(cost.jobs for cost in costs if cost.stage.startswith("simulate_press"))
    print(f"{len(wanted)} presses of {presses}: the whole study takes {sum(hours):.0f} core hours, "
          f"{sum(cost.hours for cost in costs):.0f} of them left")
    record.write("paper_share", pressed=len(wanted), rows=rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
