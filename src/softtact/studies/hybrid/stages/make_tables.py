"""Tables 1 to 3 and the claims.

inputs: cards (list), complexity, ftir, ssim, summary, per_item, ceiling, timing, scores, taxels, searches (best.json of each
    model); if objects were pressed also features, and pressed and repeated (lists of the same presses, made twice)
outputs: table1, contradictions, table2, table3, claims
settings: rule, thresholds {total, overlap}, source (of the readings), models (of the searches), reference (the model that the
    virtual sensor reads), sensor (its name)
"""

from typing import Any

from softtact.files import read_csv, read_dataset, read_json, write_csv
from softtact.geometry.complexity import choose_model
from softtact.learning.dataset import object_of
from softtact.studies.hybrid.claims.table import Evidence, claims
from softtact.studies.hybrid.tables import (
    PRINTED_COUNTS,
    PRINTED_TIMES,
    contradictions,
    table1_materials,
    table2_complexity,
    table3_timing,
)


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read the study's results and write its tables."""
    cards = [read_json(path) for path in inputs["cards"]]
    complexity, ssim, timing = (read_csv(inputs[name]) for name in ("complexity", "ssim", "timing"))

    def choose(*counts, rule=settings["rule"]):
        return choose_model(*counts, rule=rule, **settings["thresholds"])

    complexity = complexity[~complexity.object.map(object_of).duplicated()]     # each object in its first pose
    ssim = ssim.assign(item=ssim["item"].map(object_of))
    write_csv(outputs["table1"], table1_materials(cards))
    write_csv(outputs["contradictions"], contradictions(cards))
    write_csv(outputs["table2"], table2_complexity(complexity, choose))
    write_csv(outputs["table3"], table3_timing(timing))
    scores = {name: read_csv(inputs[name]) for name in ("summary", "per_item", "ceiling", "features", "scores", "taxels")
              if name in inputs}
    searches = dict(zip(settings["models"], map(read_json, inputs["searches"]), strict=True))
    write_csv(outputs["claims"], claims(Evidence(
        cards=cards, complexity=complexity, ftir=read_json(inputs["ftir"]), ssim=ssim, timing=timing, choose=choose,
        printed_counts=PRINTED_COUNTS, printed_times=PRINTED_TIMES, source=settings["source"], sensor=settings["sensor"],
        reference=settings["reference"], searches=searches, repeated=_differences(inputs), **scores)))


def _differences(inputs):
    """{model: largest difference in mm between the maps of a repeated press}; None without presses."""
    if "repeated" not in inputs:
        return None
    second, first = (list(map(read_dataset, inputs[name])) for name in ("repeated", "pressed"))
    return {one.attrs["model"]: float(abs(one.deformation_map_mm.values - other.deformation_map_mm.values).max())
            for one, other in zip(second, first, strict=True)}
