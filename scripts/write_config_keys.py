"""Write config/README.md: every key of every kind of study, from the models that check them.

    python scripts/write_config_keys.py            # writes the page; a test compares it with the code
"""

import types
import typing
from pathlib import Path

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from softtact.probe.design import PalpationDesign
from softtact.skin.design import SkinDesign
from softtact.studies.decide.config import DecideValues
from softtact.studies.grasps.config import GraspValues
from softtact.studies.hybrid.keys import Values
from softtact.studies.markers.config import MarkerValues
from softtact.studies.real.config import RealValues

ROOT = Path(__file__).resolve().parents[1]
MODELS = {"hybrid": (Values, "config.yaml", "tiny.yaml"), "skin": (SkinDesign, "skin.yaml", "tiny_skin.yaml"),
          "palpation": (PalpationDesign, "probe.yaml", "tiny_probe.yaml"),
          "grasps": (GraspValues, "grasps.yaml", "tiny_grasps.yaml"),
          "decide": (DecideValues, "decide.yaml", "tiny_decide.yaml"),
          "markers": (MarkerValues, "markers.yaml", "tiny_markers.yaml"),
          "real": (RealValues, "real.yaml", "tiny_real.yaml")}
HEAD = """# The keys of all studies

Written by `scripts/write_config_keys.py` from the models that check them; edit those.

A file of this folder is one study: `snakemake --cores all --configfile config/NAME.yaml`. `study` names its folder below
`results/`, `kind` says which kind it is (without it: hybrid). What a study of kind hybrid, grasps, decide, markers or real does not
state is as in `config.yaml`, `grasps.yaml`, `decide.yaml`, `markers.yaml` or `real.yaml`. A value that is not printed in a paper
may be written `{value: ..., assumed: true, reason: ...}`.
`objects/` holds the meshes and their catalogue, `costs.yaml` the times that `softtact cost` tells.
"""


def page() -> str:
    """The text of config/README.md."""
    parts = [HEAD]
    for kind, (model, default, tiny) in MODELS.items():
        parts.append(f"\n## kind: {kind}\n\nDefault study: `{default}`; smallest form: `{tiny}`.\n")
        waiting, seen = [("", model)], set()
        while waiting:
            where, section = waiting.pop(0)
            if section in seen:
                continue
            seen.add(section)
            parts.append(f"\n### {where or 'at the top'}\n\n{_first_line(section)}\n\n| key | default | meaning |\n|---|---|---|")
            for name, field in section.model_fields.items():
                below = list(_models(field.annotation))
                waiting += [(f"{where}.{name}".lstrip("."), one) for one in below]
                parts.append(f"| `{field.alias or name}` | {_default(field)} | {_meaning(field, below)} |")
    return "\n".join(parts) + "\n"


def _first_line(section):
    return (section.__doc__ or "").strip().split("\n")[0]


def _default(field):
    if field.is_required():
        return "required"
    value = field.default if field.default is not PydanticUndefined else field.default_factory()
    if isinstance(value, BaseModel):
        return "see below"
    return f"`{value}`".replace("|", "\\|") if value not in ({}, [], None, "") else "none"


def _meaning(field, below):
    text = field.description or " ".join(_first_line(one) for one in below[:1])
    return text.replace("|", "\\|").replace("\n", " ")


def _models(annotation):
    """The models that an annotation names, in its order."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias) and issubclass(annotation, BaseModel):
        if not annotation.__name__.startswith("Stated"):
            yield annotation
    for one in typing.get_args(annotation):
        yield from _models(one)


if __name__ == "__main__":
    (ROOT / "config/README.md").write_text(page(), encoding="utf-8")
