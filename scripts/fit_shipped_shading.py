"""Fit the shading of gelsight_mini that ships, to PyPI's wheel of `taxim` 1.4.1, unpacked in a folder.

    python scripts/fit_shipped_shading.py FOLDER

Its 24 presses of a ball in the middle of a GelSight Mini (MIT) have labelled circles, but no size of the ball: a radius of 70 px is
assumed, 4 mm at 0.029 mm/px. Circles are refined with the shading. Phong's lights are taken: polynomials come closer to these
presses (9.8 grey levels in place of 16.4), but they turn the colours round at the edge of other objects, which are steeper.
Writes src/softtact/imaging/data/gelsight_mini.yaml; half a minute.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from softtact.calibration.camera import calibrate_camera
from softtact.imaging.ball_presses import BallPress
from softtact.imaging.shading import SHIPPED

MM_PER_PX, BALL_MM, THICKNESS_MM = 0.029, 4.06, 4.0


def main(folder):
    data = np.load(Path(folder) / "taxim/calib/gelsight_mini/dataPack.npz", allow_pickle=True)
    background, images = (np.ascontiguousarray(data[name][..., ::-1]) for name in ("f0", "imgs"))      # from BGR
    presses = [BallPress(image, background.astype(float), tuple(map(float, centre)), float(radius), f"press {number}")
               for number, (image, centre, radius) in enumerate(
                   zip(images, data["touch_center"], data["touch_radius"], strict=True))]
    found = calibrate_camera(presses, background, ball_mm=BALL_MM, mm_per_px=MM_PER_PX, thickness_mm=THICKNESS_MM, kind="phong")
    facts = dict(found.shading.provenance) | {
        "made_by": "scripts/fit_shipped_shading.py", "data": "24 presses on a GelSight Mini of PyPI's taxim 1.4.1 (MIT)",
        "assumed": f"the ball's radius, {found.ball_px:.4g} px, which is not stated"}
    replace(found.shading, provenance=facts).save(SHIPPED / "gelsight_mini.yaml")
    print(f"{len(presses)} presses, error {found.error_levels:.2f} grey levels in contacts that it was not fitted to")


if __name__ == "__main__":
    main(sys.argv[1])
