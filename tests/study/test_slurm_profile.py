"""The cluster's profile gives a time and memory to every rule of every kind of study."""

from pathlib import Path

import yaml

from softtact.studies.jobs import stages_of
from softtact.studies.registry import KINDS

ROOT = Path(__file__).resolve().parents[2]
RULES_OF_ONE_STAGE = {"repeat_press", "train_beside"}     # a second rule of simulate_press and of train_cnn


def test_every_rule_has_a_time_and_memory():
    given = yaml.safe_load((ROOT / "workflow/profiles/slurm/config.yaml").read_text())["set-resources"]
    stages = {stage.partition(".")[2] for kind in KINDS for stage in stages_of(kind)}
    assert set(given) == stages | RULES_OF_ONE_STAGE
    assert all(set(one) == {"runtime", "mem_mb"} for one in given.values())
