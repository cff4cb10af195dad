"""The look of every report: its head, its tables in words, its links to files, and what a narrow screen shows."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from support.pages import numbers_without_a_file

from softtact.reporting.page import CONFIGURATION, Page
from softtact.reporting.words import header, in_words

TABLE = pd.DataFrame({"line_n_mm": [53.9987, np.nan], "meets_all": [True, False], "elastomer": ["ecoflex_00_30", "Somafoama"],
                      **{f"remark_{k}": ["a long sentence on this row"] * 2 for k in range(9)}})


@pytest.fixture
def page(tmp_path):
    """A page of two sections with a picture that is wider than any screen, a wide table and a claim."""
    Image.fromarray(np.zeros((900, 3000, 3), dtype=np.uint8)).save(tmp_path / "wide.png")
    page = Page("A study", "tiny", folder=tmp_path)
    page.opening(asked="Does it hold?", found=[("It holds at 5 N.", tmp_path / "tables/scores.csv"), ""], sure=["One seed."],
                 synthetic="All of it.")
    page.figures([(tmp_path / "wide.png", "A wide picture.")])
    page.section("Tables")
    page.table(TABLE, "Slopes", file=tmp_path / "tables/slopes.csv", most_rows=1)
    page.claims(pd.DataFrame({"claim": ["a < b"], "verdict": ["reproduced"], "rule": ["by eye"]}), file=tmp_path / "claims.csv")
    page.write(tmp_path / "report.html")
    return page


def test_a_page_begins_with_what_was_asked_found_how_sure_and_synthetic_and_links_its_numbers(page):
    text = page.render()
    places = [text.index(words) for words in ("What was asked", "It holds at 5 N.", "How sure", "What is synthetic", "<nav>")]
    assert places == sorted(places)
    assert '(<a href="tables/scores.csv">numbers</a>)' in text and text.count("<li>") == 0      # an empty sentence is no bullet


def test_a_number_in_the_head_without_a_link_is_found_and_a_place_of_the_page_is_a_link(tmp_path):
    page = Page("A study", "tiny", folder=tmp_path)
    page.opening(asked=[("Pressed with 5 N.", CONFIGURATION)], found="7 hold.", sure="Few do.")
    page.configuration("force_n: 5")
    text = page.render()
    assert f'Pressed with 5 N. (<a href="{CONFIGURATION}">numbers</a>)' in text and 'id="configuration"' in text
    assert numbers_without_a_file(text) == ["7 hold."]


def test_a_part_of_the_head_without_sentences_is_left_out(tmp_path):
    page = Page("Calibration", "mine", folder=tmp_path)
    page.opening(asked="Which gain?", found="7.")
    assert "How sure" not in page.render() and "synthetic</h2>" not in page.render()


def test_a_table_speaks_words_links_its_file_and_says_how_many_rows_are_left_out(page):
    text = page.render()
    for shown in ("slope of the trend line, N/mm", ">54<", ">yes<", ">ecoflex 00 30<", 'href="tables/slopes.csv"',
                  "first 1 of 2 rows"):
        assert shown in text, shown
    assert "line_n_mm" not in text and "Somafoama" not in text


@pytest.mark.parametrize(("value", "words"), [
    (0.0, "0"), (123456.7, "123500"), (0.00012345, "0.0001234"), (1e-9, "1.00e-09"), (float("nan"), ""), (None, ""),
    (94279973, "94279973"), (np.True_, "yes"), ("a_b", "a b"), ("tables/a_b.csv", "tables/a_b.csv")])
def test_values_are_written_for_readers(value, words):
    assert in_words(value) == words


def test_columns_without_a_listed_heading_get_their_unit():
    assert header("gap_n_mm") == "gap, N/mm" and header("gap_mm") == "gap, mm" and header("own_gap") == "own gap"


def test_a_page_loads_nothing_from_elsewhere(page):
    assert re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//|@import|url\(""", page.render()) == []


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium here")
@pytest.mark.parametrize("width", [400, 1400])
def test_a_page_is_never_wider_than_the_screen_and_a_figure_opens_large(page, tmp_path, width):
    from support.chromium import Chromium

    with Chromium((tmp_path / "report.html").as_uri(), width=width) as tab:
        tab.wait_for_text("All of it.")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        assert tab.evaluate("document.querySelector('.table').scrollWidth > document.querySelector('.table').clientWidth")
        assert tab.evaluate("document.querySelector('figure img').clientWidth") < width
        tab.evaluate("document.querySelector('figure button').click()")
        assert tab.evaluate("document.querySelector('dialog').open && document.querySelector('dialog img').clientWidth") == 3000
        tab.evaluate("document.querySelector('dialog').click()")
        assert not tab.evaluate("document.querySelector('dialog').open")
