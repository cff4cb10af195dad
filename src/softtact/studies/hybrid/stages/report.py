"""Write the report page, and the configuration and code that it was made with.

inputs: table1, contradictions, table2, table3, networks, scores, levels, verdicts, claims, summary, ftir, figures (list of PNG and
    HTML), sources (list of source files), and policies and gains, or inventory and counts of the published archive
outputs: page, sources, config, named, run, gaps
settings: study facts, config (all values), named (what these name), benchmarks (folder), sources {figure: {data, code}}
"""

from typing import Any

import pandas as pd
import yaml

from softtact.files import atomic_path, write_csv
from softtact.reporting.run_record import run_record
from softtact.studies.hybrid.page import missing, render_page, render_sources


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the configuration, the sources, the record of the run, the differences from the paper, and the page."""
    config, named = (yaml.safe_dump(settings[name], sort_keys=False, allow_unicode=True, width=120) for name in ("config", "named"))
    record = run_record(settings["benchmarks"])
    write_csv(outputs["run"], record)
    write_csv(outputs["gaps"], pd.DataFrame({"sentence": missing(settings, archive="inventory" in inputs)}))
    _write(outputs["config"], config)
    _write(outputs["named"], named)
    _write(outputs["sources"], render_sources(inputs["sources"], study=settings["study"], config=config, named=named,
                                              page=outputs["page"].name))
    _write(outputs["page"], render_page(inputs, settings, folder=outputs["page"].parent, run=record))


def _write(path, text):
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
