"""How exactly a known object's pose is found from one reading of the taxels, with gradients and without.

Of each of some random poses the elastic model makes a reading at a known force, with the taxels' noise, and three ways find
the pose from the noisy counts: centre and main axis of the counts; Nelder and Mead's simplex; least squares with
`PressResult.gradient`. The last two begin at the centre of the counts and have the same budget, in presses; a gradient counts as
one. Unknown are x and y in mm and the turn about z in degrees.

    python benchmarks/pose_from_taxels.py --poses 50
"""

import argparse
import time
import warnings

import numpy as np
import record
import trimesh
from scipy.optimize import least_squares, minimize

from softtact.errors import ShellWarning, SofttactError
from softtact.press.sensor import Sensor, load_sensor
from softtact.readout.virtual_sensor import VirtualSensorSettings

FORCE_N, BUDGET, SEED = 10.0, 40, 20261128
PARAMETERS = ("x", "y", "rz")
SCALE = np.array([1.0, 1.0, 10.0])     # mm, mm, degrees: about what the counts change alike by
NOISE = VirtualSensorSettings().noise_counts


def ellipsoid() -> trimesh.Trimesh:
    """An ellipsoid with semi-axes of 9, 5 and 6 mm, its centre at the origin: it turns into itself after 180 degrees."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    mesh.apply_scale([9.0, 5.0, 6.0])
    return mesh


class Taxels:
    """Counts of the taxels under the object, and how many presses and gradients were asked for."""

    def __init__(self, sensor: Sensor, mesh: trimesh.Trimesh) -> None:
        self.sensor, self.mesh, self.spent = sensor, mesh, 0

    def press(self, pose: np.ndarray):
        """The press at x, y (mm) and a turn about z (degrees)."""
        self.spent += 1
        with warnings.catch_warnings(action="ignore", category=ShellWarning):
            return self.sensor.press(self.mesh, pose=[pose[0], pose[1], 0.0, 0.0, 0.0, pose[2]], force_n=FORCE_N, model="elastic",
                                     label="")

    def counts(self, pose: np.ndarray) -> np.ndarray:
        """Counts (row, column)."""
        return self.press(pose).tactile_map[0]


def centre(sensor: Sensor, counts: np.ndarray) -> np.ndarray:
    """x, y and turn of the counts' centre and main axis, the first guess of both searches."""
    side_x, side_y = sensor.spec.footprint_mm
    rows, columns = counts.shape
    x = side_x * ((np.arange(columns) + 0.5) / columns - 0.5)
    y = side_y * ((np.arange(rows) + 0.5) / rows - 0.5)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    weight = counts.ravel() / counts.sum()
    middle = weight @ places
    spread = (weight[:, None] * (places - middle)).T @ (places - middle)
    axis = np.linalg.eigh(spread)[1][:, -1]
    return np.append(middle, np.degrees(np.arctan2(axis[1], axis[0])))


def with_gradients(taxels: Taxels, wanted: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Least squares (trust region) with the gradient as its Jacobian."""
    last: dict[str, object] = {}

    def residuals(scaled):
        last["press"] = taxels.press(scaled * SCALE)
        return (last["press"].tactile_map[0] - wanted).ravel() / NOISE

    def jacobian(scaled):
        taxels.spent += 1
        found = last["press"].gradient("tactile_map", PARAMETERS).values[0]
        return found.reshape(-1, len(PARAMETERS)) * SCALE / NOISE

    return least_squares(residuals, start / SCALE, jac=jacobian, max_nfev=BUDGET // 2, xtol=1e-5, ftol=1e-8).x * SCALE


def without_gradients(taxels: Taxels, wanted: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Nelder and Mead's simplex, at first of half a millimetre and five degrees."""
    first = np.vstack([start / SCALE, start / SCALE + 0.5 * np.eye(len(PARAMETERS))])

    def misfit(scaled):
        return float(((taxels.counts(scaled * SCALE) - wanted) ** 2).sum()) / NOISE**2

    return minimize(misfit, start / SCALE, method="Nelder-Mead", options={
        "initial_simplex": first, "maxfev": BUDGET, "xatol": 1e-5, "fatol": 1e-3}).x * SCALE


def error(found: np.ndarray, pose: np.ndarray) -> list[float]:
    """Distance in mm, and angle in degrees between the long axes."""
    turn = (found[2] - pose[2] + 90) % 180 - 90
    return [float(np.linalg.norm(found[:2] - pose[:2])), float(abs(turn))]


def search(taxels: Taxels, pose: np.ndarray, rng: np.random.Generator) -> dict[str, list[float]]:
    """{way: [mm, degrees, presses and gradients, seconds of the processor]} at one pose."""
    counts = taxels.counts(pose)
    wanted = np.round(np.clip(counts + NOISE * rng.standard_normal(counts.shape), 0, taxels.sensor.spec.largest_counts))
    start = centre(taxels.sensor, wanted)
    rows = {"centre of the counts": [*error(start, pose), 0, 0.0]}
    for name, way in (("Nelder-Mead", without_gradients), ("gradients", with_gradients)):
        taxels.spent, begin = 0, time.process_time()
        rows[name] = [*error(way(taxels, wanted, start), pose), taxels.spent, time.process_time() - begin]
    return rows


def measure(poses: int) -> dict[str, dict[str, float]]:
    """Medians and 90 % quantiles of the errors of each way over random poses."""
    rng, taxels = np.random.default_rng(SEED), Taxels(load_sensor("coro"), ellipsoid())
    rows: dict[str, list[list[float]]] = {}
    for number in range(poses):
        pose = rng.uniform([-4.0, -10.0, -90.0], [4.0, 10.0, 90.0])
        try:
            for name, row in search(taxels, pose, rng).items():
                rows.setdefault(name, []).append(row)
        except SofttactError as failure:
            raise RuntimeError(f"pose {number} at {pose}: {failure}") from failure
    return {name: summary(np.array(found)) for name, found in rows.items()}


def summary(found: np.ndarray) -> dict[str, float]:
    """Of errors (pose, [mm, degrees, presses, seconds])."""
    middle, high = np.median(found, axis=0), np.quantile(found[:, :2], 0.9, axis=0)
    names = ("median_mm", "median_degrees", "median_presses", "ninth_decile_mm", "ninth_decile_degrees", "mean_process_s")
    return dict(zip(names, [*middle[:3].tolist(), *high.tolist(), float(found[:, 3].mean())], strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=50)
    options = parser.parse_args()
    found = measure(options.poses)
    for name, row in found.items():
        print(f"{name:22}", "  ".join(f"{key} {value:.3g}" for key, value in row.items()))
    print(record.write("pose_from_taxels", poses=options.poses, force_n=FORCE_N, noise_counts=NOISE, budget=BUDGET, ways=found))


if __name__ == "__main__":
    main()
