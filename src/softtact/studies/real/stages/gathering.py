"""Measured data, copied into the study with its source and checksum."""

import hashlib
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from softtact.errors import InputError
from softtact.files import atomic_path, read_csv, write_csv, write_json
from softtact.imaging.ball_presses import BallPress, Gel
from softtact.imaging.marker_motion import COLUMNS, MarkerMotion
from softtact.imaging.shading import PhongShading
from softtact.outputs import cache_folder, temporary_folder
from softtact.processes import run_tied
from softtact.studies.real.config import MADE, gel_data

WHEEL = "taxim==1.4.1"
_DRAWN_PX = (96, 72)        # columns and rows of images that the study draws
_TABLE = ("grad_r", "grad_g", "grad_b")


def gather_presses(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Gather labelled presses.  outputs: presses (npz), facts (JSON);  settings: set, data, taxim (folders), seed"""
    one = settings["set"]
    if one["source"] == "taxim":
        arrays, facts = _of_wheel(one["name"], settings["taxim"])
    elif one["source"] == "fots":
        arrays, facts = _of_fots(settings["data"])
    else:
        arrays, facts = _drawn(one, settings["seed"])
    facts |= {"presses": len(arrays["images"]), "pixels": [arrays["images"].shape[2], arrays["images"].shape[1]]}
    with atomic_path(outputs["presses"]) as temporary:
        np.savez_compressed(temporary, **arrays)
    write_json(outputs["facts"], facts)


def gather_markers(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Gather the motion of markers.  outputs: markers (CSV);  settings: file (or made), data, seed, markers: what made ones show"""
    if settings["file"] == MADE:
        write_csv(outputs["markers"], _drawn_markers(settings["markers"], settings["seed"]))
        return
    path = Path(settings["file"])
    path = path if path.exists() else gel_data(settings["data"], settings["file"])
    MarkerMotion.read(path)
    write_csv(outputs["markers"], read_csv(path)[list(COLUMNS)])


def _of_wheel(name, folder):
    """Presses of PyPI's taxim, and its table."""
    wheel = _wheel(folder)
    try:
        with zipfile.ZipFile(wheel) as archive, temporary_folder() as place:
            packed = archive.extract(f"taxim/calib/{name}/dataPack.npz", place)
            table = archive.extract(f"taxim/calib/{name}/polycalib.npz", place)
            with np.load(packed, allow_pickle=False) as data, np.load(table, allow_pickle=False) as found:
                arrays = {"images": data["imgs"], "background": data["f0"], "centre_px": data["touch_center"].astype(float),
                          "radius_px": data["touch_radius"].astype(float)}
                arrays |= {key: found[key].astype(np.float32) for key in _TABLE}
    except (KeyError, zipfile.BadZipFile, OSError) as error:
        raise InputError(f"{wheel}: it holds no calibration {name!r} of {WHEEL} ({error}); give another wheel or name.") from None
    return arrays, {"source": f"{WHEEL} of PyPI (MIT), taxim/calib/{name}", "sha256": _sha256(wheel), "measured": True}


def _wheel(folder):
    """The wheel's file; pip downloads it into the user's cache where no folder has it. Nothing of it is installed or run."""
    place = Path(folder) if folder else cache_folder() / "taxim"
    if found := sorted(place.glob("taxim-1.4.1-*.whl")):
        return found[0]
    place.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", "--dest", str(place), WHEEL]
    ended = run_tied(command, capture_output=True, text=True, check=False)
    if not (found := sorted(place.glob("taxim-1.4.1-*.whl"))):
        said = (ended.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(f"{place}: pip could not download {WHEEL} ({said}); put its wheel (27 MB) there, state its "
                         "folder as `taxim`, or leave its sets out of `shading.sets`.")
    return found[0]


def _of_fots(folder):
    """Presses of FOTS; its background has blue and red swapped against its images."""
    table = read_csv(gel_data(folder, "fots/presses.csv"))
    images = np.stack([np.asarray(Image.open(gel_data(folder, f"fots/presses/{name}"))) for name in table.image])
    background = np.load(gel_data(folder, "fots/background.npy"), allow_pickle=False)
    middle = np.median(images, axis=0)
    swapped = min((background, background[..., ::-1]), key=lambda one: float(np.abs(middle - one).mean()))
    arrays = {"images": images, "background": swapped, "centre_px": table[["centre_x_px", "centre_y_px"]].to_numpy(float),
              "radius_px": table.radius_px.to_numpy(float)}
    return arrays, {"source": "Rancho-zhao/FOTS, commit 5bcde04 (MIT by its README)", "measured": True,
                    "background": "channels swapped" if swapped is not background else "as it is"}


def _drawn(one, seed):
    """Presses that the study draws with three lights of its own; they test the stages and show nothing about a gel."""
    rng, (columns, rows) = np.random.default_rng(seed), _DRAWN_PX
    true = PhongShading(_DRAWN_PX, np.zeros((1, 3)), azimuth_rad=np.array([0.1, 2.2, 4.3]), elevation_rad=np.array([0.5, 0.6, 0.4]),
                        diffuse=np.array([90.0, 70, 80]), specular=np.array([10.0, 10, 5]), exponent=np.array([4.0, 6, 8]))
    y, x = np.mgrid[:rows, :columns]
    background = np.rint(110 + 0.3 * x[..., None] + np.array([0.2, 0, -0.2]) * y[..., None])
    gel, images, centres, radii = Gel(one["ball_px"], one["thickness_px"]), [], [], []
    for _ in range(9):
        centre, radius = rng.uniform((30, 25), (columns - 30, rows - 25)), float(rng.uniform(0.4, 0.6) * one["ball_px"])
        slopes = BallPress(background, background, tuple(centre), radius).slopes(gel)
        image = background + true.difference(slopes[..., 0], slopes[..., 1], x, y) + rng.normal(0, 1, background.shape)
        images.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
        centres.append(centre)
        radii.append(radius)
    return ({"images": np.array(images), "background": background.astype(np.uint8), "centre_px": np.array(centres),
             "radius_px": np.array(radii)}, {"source": "drawn by the study itself", "measured": False})


def _drawn_markers(markers, seed):
    """A grid of markers that spreads around the contact, in whole px: no measurement and no model of this package."""
    rng = np.random.default_rng(seed)
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(20.0, 310, 29), np.arange(10.0, 235, 27)))
    away = np.column_stack([x, y]) - markers["centre_px"]
    motion = 0.12 * away * np.exp(-np.hypot(*away.T) / 45)[:, None] + [0.5, -0.5] + rng.normal(0, 0.3, away.shape)
    return pd.DataFrame(np.column_stack([x, y, np.rint(motion)]), columns=list(COLUMNS))


def _sha256(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
