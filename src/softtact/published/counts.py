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

# Mean SSIM that the paper prints (sec. 4.2), by set and model.
PRINTED_SSIM = {"validation": {"hyperelastic": 0.87, "elastic": 0.86}, "unseen": {"hyperelastic": 0.81, "elastic": 0.82},
                "grasps": {"hyperelastic": 0.72, "elastic": 0.63}}
# Maps as the paper counts them: 13,000 to train, 400 unseen cases, 2,000 grasps of 20 maps each, from closing to held.
SETS, MAPS_OF_A_GRASP, ALL_MAPS = (13_000, 400, 2_000), 20, 53_400


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
