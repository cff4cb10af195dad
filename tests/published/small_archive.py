"""A small archive in the published layout, made by a formula, with oddities to order. It is no sensor's data."""

from pathlib import Path

import numpy as np
import pandas as pd

FLAT = ("CircleG", "Echo", "EchoH", "DonutM", "Cruz", "BordesH")
CURVED = ("Mug", "BigBall")
FILES = {"elastic": "Isaac", "hyperelastic": "Abaqus"}


class Archive:
    """Tables of the six files, to be changed by a test and written.

    maps {(set, model)}: data frame of x0..x32, Path;  real {set}: data frame of force, tax1..tax28, Path
    """

    def __init__(self, *, flat=FLAT, curved=CURVED, tests=2, frames=5, models=("elastic", "hyperelastic"), seed=0):
        rng = np.random.default_rng(seed)
        self.real, self.maps, self.depths = {}, {}, {}
        for set_name, names in (("Flat", flat), ("Curved", curved)):
            paths = [f"{name}/test_{k}" for name in names for k in range(tests)]
            dents = {path: rng.uniform([-12, -7, 4], [12, 7, 10]) for path in paths}
            forces = np.linspace(5, 50, frames)
            for model in models:
                scale = {"elastic": 1.0, "hyperelastic": 0.8}[model]
                maps = [scale * f / 50 * dent(*dents[path]) for path in paths for f in forces]
                self.maps[set_name, model] = _map_frame(np.round(np.concatenate(maps), 6), np.repeat(paths, frames * 57))
            counts = [counts_of(f / 50 * dent(*dents[path])) for path in paths for f in forces]
            self.real[set_name] = _real_frame(np.tile(forces, len(paths)), np.round(counts, 2), np.repeat(paths, frames))

    def write(self, folder, *, ending="", isaac="Isaac", **csv):
        """Write all files; `ending` of their names, `isaac`: how Isaac is spelt, `csv`: options of pandas."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for set_name, frame in self.real.items():
            frame.to_csv(folder / f"{set_name}_Real_Abaqus{ending}.csv", index=False, **csv)
        for (set_name, model), frame in self.maps.items():
            solver = {"Abaqus": "Abaqus", "Isaac": isaac}[FILES[model]]
            frame.to_csv(folder / f"{set_name}_Simulation_{solver}{ending}.csv", index=False, **csv)
        return folder


def dent(y0, x0, width):
    """A deformation map (57, 33) in mm with one dent, positive towards the PCB, row 0 at the most negative y."""
    y, x = np.linspace(-18.5, 18.5, 57), np.linspace(-11, 11, 33)
    return 0.4 * np.exp(-((y[:, None] - y0) ** 2 + (x - x0) ** 2) / width**2)


def counts_of(map_mm):
    """28 counts, row by row of the 7 x 4 grid: 3,000 per mm of a taxel's mean depth."""
    return 3000 * map_mm[:56, :32].reshape(7, 8, 4, 8).mean(axis=(1, 3)).ravel()


def _map_frame(values, paths):
    return pd.DataFrame(values, columns=[f"x{k}" for k in range(33)]).assign(Path=paths)


def _real_frame(forces, counts, paths):
    frame = pd.DataFrame(counts, columns=[f"tax{k}" for k in range(1, 29)])
    frame.insert(0, "force", forces)
    return frame.assign(Path=paths)
