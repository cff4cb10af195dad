"""What every row of the paper's claims is made of: its columns and the words for its verdict."""

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
UNDECIDED, MEASUREMENTS = "undecided", "needs the paper's measurements"
CONSISTENT = "consistent in print"      # the paper's numbers agree with each other; nothing of ours was compared
FACTOR = 2.0                            # of times of two machines and solvers that count as the same, on both sides; assumed
COLUMNS = ["claim", "where", "paper", "ours", "uncertainty", "verdict", "rule", "evidence"]


def row(claim: str, where: str, paper: str | float, ours: str | float, verdict: str, rule: str, evidence: str, *,
        uncertainty: str = "not told") -> dict[str, str]:
    """One claim by COLUMNS; all but the verdict is text for readers."""
    values = (claim, where, str(paper), str(ours), uncertainty, verdict, rule, evidence)
    return dict(zip(COLUMNS, values, strict=True))


def verdict_of(condition: bool) -> str:
    """Reproduced or not."""
    return REPRODUCED if condition else NOT


def within(ours: float, printed: float, *, factor: float = FACTOR) -> bool:
    """Whether a positive number is the printed one within a factor, on both sides."""
    return bool(printed / factor <= ours <= printed * factor)
