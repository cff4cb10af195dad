"""What every row of the paper's claims is made of: its columns and the words for its verdict."""

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
UNDECIDED, MEASUREMENTS = "undecided", "needs the paper's measurements"
COLUMNS = ["claim", "where", "paper", "ours", "uncertainty", "verdict", "rule", "evidence"]


def row(claim, where, paper, ours, verdict, rule, evidence, *, uncertainty="not told"):
    """One claim by COLUMNS; all but the verdict is text for readers."""
    values = (claim, where, str(paper), str(ours), uncertainty, verdict, rule, evidence)
    return dict(zip(COLUMNS, values, strict=True))


def verdict_of(condition):
    """Reproduced or not."""
    return REPRODUCED if condition else NOT
