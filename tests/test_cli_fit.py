"""`softtact fit` for cycles and tests over time: the blocks of the card, the figure, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from softtact.cli import main
from softtact.materials.cards import law_from_card, load_card, mullins_from_card, prony_from_card
from softtact.materials.cycles import energy_of
from softtact.materials.laws.registry import make_law
from softtact.materials.mullins import Mullins
from softtact.materials.prony import PronySeries

LAW = make_law("neo_hooke", {"c10": 0.2})
EFFECT = Mullins(1.8, 0.05, 0.2)
SERIES = PronySeries((0.2, 0.1), (0.1, 5.0))


@pytest.fixture(autouse=True)
def desk(tmp_path, monkeypatch):
    """A folder with cycles in tension, a relaxation and a sweep of frequencies, without noise."""
    stretch = np.concatenate([np.linspace(*ends, 25) for ends in ((1, 1.5), (1.49, 1.01), (1.02, 2), (1.99, 1.01))])
    energy = energy_of(LAW, "uniaxial", stretch)
    stress = EFFECT.softening(energy, np.maximum.accumulate(energy)) * LAW.nominal_stress("uniaxial", stretch)
    save(tmp_path / "cycles.csv", "stretch,nominal_stress_mpa", stretch, stress)
    times, hz = np.geomspace(0.01, 50, 40), np.geomspace(0.01, 10, 20)
    save(tmp_path / "relaxation.csv", "time_s,force_n", times, 3 * SERIES.relaxation(times))
    save(tmp_path / "dma.csv", "Frequency [Hz],storage_modulus_kpa,loss_modulus_kpa", hz, *SERIES.storage_loss(2 * np.pi * hz))
    monkeypatch.chdir(tmp_path)


def save(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.10g")


def test_a_card_holds_the_law_of_first_loading_its_softening_and_its_relaxation(capsys):
    files = ["uniaxial=cycles.csv", "relaxation=relaxation.csv", "frequency=dma.csv"]
    assert main(["fit", *files, "--column", "frequency=Frequency [Hz]", "--cycles", "mullins", "--law", "neo_hooke", "--moduli",
                 "relaxed", "--out", "card.json"]) == 0
    out = capsys.readouterr().out
    assert "Mullins effect of neo_hooke: r 1.8, m 0.05 MPa, beta 0.2" in out
    assert "Prony series: g 0.2, 0.1 of the instantaneous modulus, tau 0.1, 5 s" in out and "constants are relaxed" in out
    card = load_card("card.json")
    effect, series = mullins_from_card(card), prony_from_card(card)
    assert card["laws"]["neo_hooke"]["mu0_mpa"] == pytest.approx(0.4, rel=1e-5)
    assert (effect.r, effect.m_mpa, effect.beta) == pytest.approx((1.8, 0.05, 0.2), rel=1e-3)
    assert series.g == pytest.approx(SERIES.g, rel=1e-4) and series.tau_s == pytest.approx(SERIES.tau_s, rel=1e-4)
    assert series.moduli == "relaxed"


def test_a_prony_series_is_added_to_a_card_and_replaced(capsys):
    assert main(["fit", "uniaxial=cycles.csv", "--cycles", "first", "--law", "neo_hooke", "--out", "card.json"]) == 0
    assert main(["fit", "relaxation=relaxation.csv", "--prony", "1", "--card", "card.json", "--out", "one.json"]) == 0
    assert main(["fit", "relaxation.csv", "--card", "one.json", "--out", "two.json", "--plot", "two.png"]) == 0
    assert "neo_hooke" not in capsys.readouterr().err
    one, two = load_card("one.json"), load_card("two.json")
    assert len(one["prony"]["g"]) == 1 and one["prony"]["terms_by"] == "stated"
    assert two["prony"]["g"] == pytest.approx(SERIES.g, rel=1e-4) and two["prony"]["terms_by"] == "least AICc"
    assert one["laws"] == two["laws"] == load_card("card.json")["laws"]


@pytest.mark.parametrize(("name", "over"), [("shear_modulus_kpa", 1.0), ("young_modulus_kpa", 3.0)])
def test_a_relaxing_modulus_alone_makes_a_card_of_neo_hooke(name, over):
    times = np.geomspace(0.01, 50, 40)
    save("relaxation.csv", f"time_s,{name}", times, 400 * over * SERIES.relaxation(times))
    assert main(["fit", "relaxation=relaxation.csv", "--bulk-over-shear", "50", "--plot", "card.png", "--out", "card.json"]) == 0
    law = law_from_card(load_card("card.json"))
    assert (law.name, law.mu0, law.bulk_modulus) == ("neo_hooke", pytest.approx(0.4, rel=1e-5), pytest.approx(20, rel=1e-5))
    assert prony_from_card(load_card("card.json")).moduli == "instantaneous"


def test_a_rheometers_sweep_alone_makes_a_card():
    hz = np.geomspace(0.01, 10, 20)
    save("dma.csv", "frequency_hz,shear_storage_modulus_kpa,shear_loss_modulus_kpa", hz, *(
        400 * part for part in SERIES.storage_loss(2 * np.pi * hz)))
    assert main(["fit", "frequency=dma.csv", "--out", "card.json"]) == 0
    assert law_from_card(load_card("card.json")).mu0 == pytest.approx(0.4, rel=1e-5)


def test_the_figure_draws_cycles_and_tests_over_time_with_labels_and_units():
    files = ["uniaxial=cycles.csv", "relaxation=relaxation.csv", "frequency=dma.csv"]
    assert main(["fit", *files, "--column", "frequency=Frequency [Hz]", "--cycles", "mullins", "--law", "neo_hooke", "--plot",
                 "card.svg", "--out", "card.json"]) == 0
    drawn = Path("card.svg").read_text()
    for text in ("nominal stress (MPa)", "effect - data (kPa)", "time (s)", "frequency (Hz)", "series - data (%)"):
        assert f"<!-- {text} -->" in drawn, text


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["relaxation=relaxation.csv"], "its column tells no shear modulus, so there is no law; add a curve such as uniaxial=FILE"),
    (["relaxation=relaxation.csv", "--moduli", "relaxed"], "--moduli: it has no effect on tests over time without a curve"),
    (["relaxation=relaxation.csv", "--card", "c.json", "--material", "m"], "--material: it has no effect on tests over time"),
    (["uniaxial=cycles.csv", "--cycles", "first", "--prony", "2"], "--prony: it has no effect without a test over time"),
    (["uniaxial=cycles.csv", "--cycles", "first", "--card", "c.json"], "--card: it has no effect without a test over time"),
    (["uniaxial=cycles.csv", "relaxation=relaxation.csv", "--card", "c.json"], "a new card is fitted to uniaxial=cycles.csv"),
    (["relaxation=relaxation.csv", "--card", "c.json", "--law", "yeoh"], "--law: it has no effect on tests over time without"),
    (["relaxation=relaxation.csv", "--card", "c.json", "--area-mm2", "2"], "--area-mm2: it has no effect on tests over time"),
    (["relaxation=relaxation.csv", "--card", "c.json"], "c.json: there is no such file"),
    (["relaxation=relaxation.csv", "--card", "relaxation.csv", "--holds", "relaxed"], "--holds: it has no effect"),
    (["polyurethane", "--cycles", "mullins"], "a material's YAML names its files and options; give it without others")])
def test_options_without_effect_are_refused_and_no_card_is_written(arguments, sentence, capsys, tmp_path):
    assert main(["fit", *arguments, "--out", "card.json"]) == 1
    captured = capsys.readouterr()
    assert sentence in captured.err and captured.err.count("\n") == 1
    assert not (tmp_path / "card.json").exists()


def test_the_moduli_of_a_test_with_holds_are_those_that_were_taken(capsys):
    steps = np.repeat([1.2, 1.4, 1.6], 10)
    relaxing = 1 + 0.3 * np.exp(-np.tile(np.arange(10), 3))
    save("steps.csv", "stretch,nominal_stress_mpa", steps, LAW.nominal_stress("uniaxial", steps) * relaxing)
    files = ["uniaxial=steps.csv", "relaxation=relaxation.csv"]
    fit = ["fit", *files, "--holds", "relaxed", "--law", "neo_hooke", "--out", "card.json"]
    assert main(fit) == 0
    assert load_card("card.json")["prony"]["moduli"] == "relaxed"
    assert main([*fit, "--moduli", "instantaneous"]) == 1
    assert "--moduli instantaneous: the curve is the relaxed one by --holds; state the same in both" in capsys.readouterr().err
