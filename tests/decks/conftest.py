"""Fixtures of the deck tests."""

import pytest
from deck_study import run_ccx

from softtact.decks.export import write_deck


@pytest.fixture
def solve(tmp_path):
    """Write a `DeckModel` for ccx, run it, give its tables."""

    def run(model, **elements):
        path = tmp_path / "deck.inp"
        write_deck(path, model, dialect="calculix", **elements)
        return run_ccx(path)

    return run
