"""Fits of published test curves: errors of the family, predictions of a test left out, and how long a card takes.

    SOFTTACT_TEST_DATA=folder python benchmarks/materials.py               (half a minute)
    python benchmarks/materials.py --write-docs    (the tables of its page in docs/notebook/ from the last record)

The folder holds `materials/literature` (Treloar 1944, Kawabata 1981) and `materials/soro_db` (Marechal et al. 2021).
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np
import record

from softtact.materials.card_making import make_card
from softtact.materials.config import load_material
from softtact.materials.fitting import collect, errors_of, fit_law, rms
from softtact.materials.laws.registry import make_law
from softtact.materials.making import curves_of
from softtact.materials.readers import read_curves
from softtact.sensors.library import material_file

PROJECT = Path(__file__).parents[1]
PAGE = PROJECT / "docs" / "notebook" / "2026-11-22-laws-on-published-tests.md"
RUBBERS = ("Treloar_1944", "Kawabata_1981")
WINDOW = (1.0, 2.0)     # strains up to 100 %
# Ogden, Proc. R. Soc. A 326 (1972) 565, for Treloar's rubber; in Abaqus' convention mu = mu_p alpha_p / 2.
OGDEN_1972 = {"mu1": 0.003, "alpha1": 5.0, "mu2": 0.4095, "alpha2": 1.3, "mu3": 0.01, "alpha3": -2.0}


def rubber(folder):
    """A row per law: its relative error on three modes, and on each mode when it was left out."""
    curves = read_curves(folder, layout="literature")
    card = make_card(curves, residual="relative")
    return [{"law": name, "relative_error": law["relative_error"], "stable": law["stable_over_data"],
             "left_out": {mode: entry and entry["relative_error"] for mode, entry in law["left_out"].items()}}
            for name, law in ((name, card["laws"][name]) for name in card["ranking"])]


def treloar(folder):
    """Three terms of Ogden's on Treloar's three modes, by several measures, beside Ogden's own constants."""
    curves = read_curves(folder, layout="literature")
    size = rms(collect(curves).stress)
    literature = errors_of(make_law("ogden3", OGDEN_1972), curves)
    relative, absolute = (fit_law("ogden3", curves, residual=kind) for kind in ("relative", "absolute"))
    larger = fit_law("ogden3", [curve.within((1.1, 10)) for curve in curves], residual="relative")
    return {"relative": relative.relative_error, "relative_above_10_percent": larger.relative_error,
            "absolute_over_size": absolute.rmse_mpa / size, "ogden_1972_relative": literature[1],
            "ogden_1972_over_size": literature[0] / size, "parameters": relative.parameters,
            "by_mode": relative.relative_error_by_mode}


def silicone(path):
    """The chosen law up to 100 % strain, and the laws that are not stable there."""
    (curve,) = read_curves([path], layout="soro_db")
    card = make_card([curve], window={"uniaxial": WINDOW})
    law = card["laws"][card["chosen"]]
    largest = float(np.abs(curve.within(WINDOW).nominal_stress).max())
    return {"material": path.stem, "points": law["fit"]["points"], "chosen": card["chosen"],
            "rmse_over_largest": law["rmse_mpa"] / largest, "largest_mpa": largest, "mu0_mpa": law["mu0_mpa"],
            "stable_range": law["stable_range"],
            "unstable": [name for name in card["ranking"] if not card["laws"][name]["stable_over_data"]]}


def seconds():
    """Time of a whole card, predictions of tests left out included, and of the fits alone, for the project's own curves."""
    config = load_material(material_file("polyurethane"))
    curves, times = curves_of(config.curve_settings), {}
    for name, left_out in (("card", True), ("fits", False)):
        start = time.perf_counter()
        make_card(curves, predict_left_out=left_out)
        times[name] = time.perf_counter() - start
    return times


def measure(data):
    """All of it, recorded."""
    folder = Path(data) / "materials"
    return record.write("materials", seconds=seconds(), treloar=treloar(folder / "literature" / RUBBERS[0]),
                        rubbers={name: rubber(folder / "literature" / name) for name in RUBBERS},
                        silicones=[silicone(path) for path in sorted((folder / "soro_db").glob("*.csv"))])


def rubber_table(rows):
    lines = ["| law | three modes | uniaxial left out | equibiaxial left out | planar left out |", "|---|---|---|---|---|"]
    for row in rows:
        left = " | ".join(_percent(row["left_out"][mode]) for mode in ("uniaxial", "equibiaxial", "planar"))
        lines.append(f"| {row['law']} | {_percent(row['relative_error'])} | {left} |")
    return "\n".join(lines)


def silicone_table(rows):
    lines = ["| material | points | chosen | RMSE over the largest stress | mu0, MPa | stable in uniaxial / equibiaxial stretch | "
             "not stable over the data |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        ranges = " / ".join(f"{low:.2f} to {high:.3g}" for low, high in list(row["stable_range"].values())[:2])
        lines.append(f"| {row['material']} | {row['points']} | {row['chosen']} | {row['rmse_over_largest']:.2%} |"
                     f" {row['mu0_mpa']:.4f} | {ranges} | {', '.join(row['unstable']) or 'none'} |")
    return "\n".join(lines)


def _percent(value):
    return "-" if value is None else f"{value:.1%}" if value < 10 else f"{value:.0f}-fold"


def write_page(found):
    """Put the tables between the page's marks."""
    parts = [f"**{name.replace('_', ', ')}**\n\n{rubber_table(rows)}" for name, rows in found["rubbers"].items()]
    parts.append(f"**Silicones, strains up to 100 %**\n\n{silicone_table(found['silicones'])}")
    before, _, after = PAGE.read_text(encoding="utf-8").partition("<!-- tables -->")
    after = after.partition("<!-- end of tables -->")[2]
    PAGE.write_text(f"{before}<!-- tables -->\n" + "\n\n".join(parts) + f"\n<!-- end of tables -->{after}", encoding="utf-8")


def main():
    """Measure, or write the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--write-docs", action="store_true", help="put the last record into its page in docs/notebook/")
    if options.parse_args().write_docs:
        return write_page(record.read("materials"))
    if "SOFTTACT_TEST_DATA" not in os.environ:
        return print("SOFTTACT_TEST_DATA names no folder with the published tests: nothing was measured.")
    print(measure(os.environ["SOFTTACT_TEST_DATA"]))


if __name__ == "__main__":
    main()
