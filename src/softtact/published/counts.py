"""What the archive holds against the three counts in print, which contradict each other."""

import pandas as pd

PRINTED = [  # what is counted, where it is printed, how many
    ("real maps", "abstract", 53400),
    ("real maps", "repository", 15400),
    ("maps of hyperelastic", "repository", 15400),
    ("maps of elastic", "repository", 15400),
    ("real maps", "text", 15400),
    ("real maps of indenters to train on", "text", 13000),
    ("real maps of unseen indenters", "text", 400),
    ("real maps of objects", "text", 2000),
]


def counts_table(found: dict[str, int]) -> pd.DataFrame:
    """A row per printed count: what, where, printed, found, meets.  found {what: number}; what is not found was not there."""
    rows = [(what, where, printed, found.get(what), found.get(what) == printed) for what, where, printed in PRINTED]
    return pd.DataFrame(rows, columns=["what", "where", "printed", "found", "meets"])


def counts_sentence(table: pd.DataFrame) -> str:
    """Which of the three counts in print the archive meets."""
    verdicts = []
    for where, rows in table.groupby("where", sort=False):
        misses = [f"{row.what}: {row.printed} printed, {'no file' if pd.isna(row.found) else int(row.found)} found"
                  for row in rows[~rows.meets].itertuples()]
        verdicts.append(f"the count of the {where} is {'met' if not misses else 'not met (' + ', '.join(misses) + ')'}")
    return f"{'; '.join(verdicts)}.".capitalize()
