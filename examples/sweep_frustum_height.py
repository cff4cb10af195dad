"""Sensitivity of a dielectric over the height of its frusta: capacitance against pressure, in the frusta's unit cell.

    python examples/sweep_frustum_height.py --heights 0.3 0.4 0.5 0.6 0.7 --out frustum_height.png

A plate presses one frustum of an infinite lattice at finite strain, with its board and folding sides (Mooney-Rivlin constants as
the paper prints them). Its compression gives the capacitance between board and electrode plane. Higher frusta gain more per
pressure, less than in proportion, and every curve flattens as the sides fold onto the board. Sheet and cover do not deform here. So
this is the largest gain of the dielectric under a uniform pressure, not the sensor's reading under an object. A coarse mesh of the
cell takes some seconds for a height; `--fine` takes the mesh of the press.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import softtact
from softtact.models.foundation.frustum_spring import frustum_law
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.readout.capacitance import capacitance_per_area
from softtact.reporting.style import pyplot, save

# the studies' draft mesh
COARSE = MeshSettings(frustum_heights=(0.0, 0.35, 1.0), unprojected_penalty_ratio=4.0, constrained_cell_edges=True)
PRESSURES_KPA = np.array([2.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0])


def main(arguments=None):
    options = parse(arguments)
    sensor = softtact.load_sensor("coro")
    mesh = MeshSettings() if options.fine else COARSE
    table = pd.concat([gain(sensor, height, mesh=mesh) for height in options.heights])
    at_low = table[table.pressure_kpa == PRESSURES_KPA[1]]
    print(at_low.assign(gain_per_kpa=at_low.gain / at_low.pressure_kpa)[["height_mm", "gain_per_kpa"]].to_string(index=False))
    save(draw(table), options.out)
    print(f"Drawn: {options.out}")
    return table


def gain(sensor, height_mm, *, mesh):
    """Table of compression (mm) and gain dC / C0 of a lattice of frusta of one height, at each pressure."""
    spec = with_height(sensor.spec, height_mm)
    law = frustum_law(spec, sensor.laws["dielectric"], mesh=mesh, pressure_mpa=1e-3 * PRESSURES_KPA[-1])
    force_n = 1e-3 * PRESSURES_KPA * spec.dielectric.frusta.pitch_mm**2             # of one frustum under its cell
    compression_mm = law.extension(force_n)
    relative = capacitance_per_area(spec, compression_mm) / capacitance_per_area(spec, 0.0) - 1
    return pd.DataFrame({"height_mm": height_mm, "pressure_kpa": PRESSURES_KPA, "compression_mm": compression_mm, "gain": relative})


def with_height(spec, height_mm):
    """The sensor with other frusta; all else stays."""
    frusta = spec.dielectric.frusta.model_copy(update={"height_mm": height_mm})
    return spec.model_copy(update={"dielectric": spec.dielectric.model_copy(update={"frusta": frusta})})


def draw(table):
    """Left: gain against pressure, a line a height; right: gain per pressure against height, at a light and a firm pressure."""
    figure, (left, right) = pyplot().subplots(1, 2, figsize=(9.5, 4.2), layout="constrained")
    heights = sorted(table.height_mm.unique())
    for height, shade in zip(heights, np.linspace(0.75, 0.0, len(heights)), strict=True):
        rows = table[table.height_mm == height]
        left.plot(rows.pressure_kpa, rows.gain, marker="o", ms=3, color=str(shade), label=f"{height:g} mm")
    left.set(xlabel="pressure on the lattice (kPa)", ylabel="relative gain of capacitance dC / C0 (1)", xlim=(0, None),
             ylim=(0, None))
    left.legend(title="height of the frusta", frameon=False)
    for pressure, mark in ((PRESSURES_KPA[1], "o-"), (PRESSURES_KPA[-1], "s--")):
        rows = table[table.pressure_kpa == pressure].sort_values("height_mm")
        right.plot(rows.height_mm, 100 * rows.gain / pressure, mark, color="k", mfc="w", label=f"mean up to {pressure:g} kPa")
    right.set(xlabel="height of the frusta (mm)", ylabel="sensitivity (% of C0 per kPa)", ylim=(0, None))
    right.legend(frameon=False)
    return figure


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--heights", type=float, nargs="+", default=[0.3, 0.4, 0.5, 0.6, 0.7], help="in mm")
    parser.add_argument("--fine", action="store_true", help="the mesh of the press in place of a coarse one")
    parser.add_argument("--out", type=Path, default=Path("frustum_height.png"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
