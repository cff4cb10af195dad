"""Fixtures of the deck tests."""

import hashlib
import lzma
import os
from pathlib import Path

import pytest
from deck_study import Tables, run_ccx

from softtact.decks.sensor import write_deck

# Tables that CalculiX takes minutes for, by the digest of their deck. SOFTTACT_CALCULIX=run runs all decks, whatever is kept, and
# SOFTTACT_CALCULIX=keep keeps what takes more than half a minute.
KEPT = Path(__file__).parent / "kept"
LONG_S = 30.0


@pytest.fixture
def solve(tmp_path):
    """Write a `DeckModel` for ccx, run it, give its tables: the kept ones where the deck is the same to the last digit."""

    def run(model, **elements):
        write_deck(tmp_path / "deck.inp", model, dialect="calculix", **elements)
        return tables_of(tmp_path / "deck.inp")

    return run


def tables_of(path):
    """The tables of a deck, kept or by ccx."""
    said = "\n".join(line for line in path.read_text().splitlines() if not line.startswith("**"))
    kept = KEPT / f"{hashlib.sha256(said.encode()).hexdigest()[:16]}.dat.xz"
    wish = os.environ.get("SOFTTACT_CALCULIX", "")
    if kept.exists() and wish != "run":
        path.with_suffix(".dat").write_bytes(lzma.decompress(kept.read_bytes()))
        return Tables(path.with_suffix(".dat"))
    before = os.times().children_user
    tables = run_ccx(path)
    if wish == "keep" and os.times().children_user - before > LONG_S:
        KEPT.mkdir(exist_ok=True)
        kept.write_bytes(lzma.compress(path.with_suffix(".dat").read_bytes()))
    return tables


@pytest.fixture
def solve_lines(tmp_path):
    """Write the lines of a deck for ccx, run it, give its tables: the kept ones where the deck is the same to the last digit."""

    def run(lines):
        (tmp_path / "deck.inp").write_text("\n".join(lines) + "\n")
        return tables_of(tmp_path / "deck.inp")

    return run
