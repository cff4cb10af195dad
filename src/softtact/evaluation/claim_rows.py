"""Columns and verdicts of the tables of a paper's claims."""

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
UNDECIDED, MEASUREMENTS = "undecided", "needs the paper's measurements"
CONSISTENT = "consistent in print"      # the paper's numbers agree with each other; nothing of ours was compared
FACTOR = 2.0                            # between times of two machines and solvers that count as equal, up or down; assumed
COLUMNS = ["claim", "where", "paper", "ours", "uncertainty", "verdict", "rule", "evidence"]


def row(claim: str, where: str, paper: str | float, ours: str | float, verdict: str, rule: str, evidence: str, *,
        uncertainty: str = "not told") -> dict[str, str]:
    """One row of a table of claims, by COLUMNS; all but the verdict is text for readers."""
    values = (claim, where, str(paper), str(ours), uncertainty, verdict, rule, evidence)
    return dict(zip(COLUMNS, values, strict=True))


def verdict_of(condition: bool) -> str:
    """The verdict `reproduced` or `not reproduced`."""
    return REPRODUCED if condition else NOT


def within(ours: float, printed: float, *, factor: float = FACTOR) -> bool:
    """Whether a positive number is within a factor of the printed one, up or down."""
    return bool(printed / factor <= ours <= printed * factor)
