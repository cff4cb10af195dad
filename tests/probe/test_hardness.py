"""Verdicts on measures of hardness, from known numbers."""

from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from softtact.probe.sweep import apparent_modulus, verdict
from softtact.studies.palpation.stages.summary import _on_hardness

ROWS = [("soft", 10, 1, 1.0), ("soft", 10, 2, 1.2), ("soft", 20, 1, 0.9), ("soft", 20, 2, 1.0),
        ("hard", 10, 1, 2.0), ("hard", 10, 2, 3.0), ("hard", 20, 1, 1.5), ("hard", 20, 2, 2.5)]
TABLE = pd.DataFrame(ROWS, columns=["tissue", "tissue_height_mm", "jaw_mm", "index"])


def test_a_measure_is_judged_by_its_worst_change():
    own = verdict(TABLE, "index")
    assert own.change_with_load == pytest.approx(2.5 / 1.5 - 1)       # hard, 20 mm high
    assert own.change_with_height == pytest.approx(0.2)                # both at the largest way
    assert own.contrast == pytest.approx(2.5) and own.apart and own.heights == 2


def test_displacements_that_differ_by_round_off_are_the_same():
    """The jaw's displacement is a sum of steps, which differs by height in its last digit."""
    off = TABLE.assign(jaw_mm=TABLE.jaw_mm.where((TABLE.jaw_mm < 2) | (TABLE.tissue_height_mm == 10), np.nextafter(2, 3)))
    assert off.jaw_mm.nunique() == 3 and verdict(off, "index") == verdict(TABLE, "index")


def test_values_that_overlap_do_not_tell_tissues_apart():
    assert not verdict(TABLE.assign(index=np.where(TABLE.tissue == "hard", 0.7, 1.0) * TABLE["index"]), "index").apart


def test_the_page_says_nothing_of_heights_that_were_not_tried():
    both, one = (verdict(table, "index") for table in (TABLE, TABLE[TABLE.tissue_height_mm == 10]))
    (of_both,), (of_one,) = (list(_on_hardness({"relative_hardness_n_mm": asdict(found)})) for found in (both, one))
    assert "with the tissue's height by up to 20.0%" in of_both and "the 2 heights that were tried" in of_both
    assert "one height of the tissue, which says nothing of others" in of_one and "whatever" not in of_one


def test_stiffening_leaves_the_modulus_at_rest():
    c = np.linspace(0.1, 1, 6)
    assert apparent_modulus(4 * c + 3 * c**2, c, height_mm=15, area_mm2=500) == pytest.approx(4 * 15 / 500)
