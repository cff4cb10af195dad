"""The report page.

inputs: table1, contradictions, table2, table3, networks, claims, summary, ftir, figures (list of PNG), and policies, or
    inventory and counts of the published archive;  outputs: page;  settings: study facts
"""

from softtact.files import atomic_path
from softtact.reporting.page import render_page


def run(*, inputs, outputs, settings, threads=1):
    """Write the page, whole."""
    with atomic_path(outputs["page"]) as temporary:
        temporary.write_text(render_page(inputs, settings, folder=outputs["page"].parent), encoding="utf-8")
