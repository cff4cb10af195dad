"""Frames of the virtual dielectric's contact, and the discs found in them.

inputs: states (virtual_dielectric.nc);  outputs: images (folder), discs (CSV)
settings: camera {pixel_mm, blur_mm, noise, falloff}, seed; the footprint is the extent of the frusta
"""

from typing import Any

import pandas as pd
from skimage import io

from softtact.files import read_dataset, write_csv
from softtact.imaging.discs import COLUMNS, detect_discs
from softtact.imaging.frames import Camera, render_frame
from softtact.imaging.reading import read_frame
from softtact.progress import progress

MARGIN_MM = 1.0   # of glass visible around the outermost frusta's centres


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Render a frame per force, then detect the discs in the written files as in those of a camera."""
    state, camera = read_dataset(inputs["states"][0]), Camera(**settings["camera"])
    x, y = state.x_mm.values, state.y_mm.values
    footprint = 2 * (abs(x).max() + MARGIN_MM), 2 * (abs(y).max() + MARGIN_MM)
    outputs["images"].mkdir(parents=True, exist_ok=True)
    tables = []
    for k, force in enumerate(progress(state.force_n.values, label="FTIR frames")):
        file = outputs["images"] / f"frame_{k:03d}.png"
        frame = render_frame(x, y, state.disc_area_mm2.values[k], camera, footprint_mm=footprint, seed=[settings["seed"], k])
        io.imsave(file, frame, check_contrast=False)
        found = detect_discs(read_frame(file), pixel_mm=camera.pixel_mm)
        tables.append(found.assign(force_n=force, frame=file.name))
    write_csv(outputs["discs"], pd.concat(tables)[["force_n", "frame", *COLUMNS]])
