"""The project's own studies, as the tests take and change them; their paths are those of the project's folder."""

import copy
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = yaml.safe_load((ROOT / "config/config.yaml").read_text())


def changed(path, value):
    """The default configuration with the value at a dotted path replaced."""
    values = copy.deepcopy(DEFAULT)
    *parents, last = path.split(".")
    section = values
    for key in parents:
        section = section[key]
    section[last] = value
    return values


def merged(name):
    """A study's configuration as Snakemake merges it over the default one."""

    def merge(base, over):
        return base | {key: merge(base[key], value) if isinstance(base.get(key), dict) and isinstance(value, dict)
                       else value for key, value in over.items()}

    return merge(DEFAULT, yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text()))
