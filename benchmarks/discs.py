"""Bias and scatter of a contact disc's area, by estimator, diameter and shape: `python benchmarks/discs.py` from the project's
folder (--frames N, default 4 frames of 100 discs each).

Signal-to-noise 5 at the frame's centre, 30 % less light in its corners, blur of one pixel. The bound is that of Cramer and Rao for
a blurred disc of known centre, contrast and blur, at each disc's own light: no unbiased estimator scatters less.
"""

import argparse
import importlib.metadata

import numpy as np
import record
from scipy.ndimage import gaussian_filter

from softtact.imaging import outline
from softtact.imaging.discs import PASSES, Scene, grey
from softtact.imaging.frames import Camera, expose, illumination

SUB = 8          # points per pixel side that tell a shape's coverage
COUNT = 10       # discs along each side
BLUR, FALLOFF, SNR = 1.0, 0.3, 5.0
DIAMETERS = (2 * np.sqrt(12 / np.pi), 8.0, 12.0, 16.0, 24.0, 40.0)   # pixels; the first has an area of 12
LEVELS = {"noise cut off at black": (0.05, 0.85), "noise not cut off": (0.3, 0.7)}


def frame(diameter, *, ratio, levels, seed, snr=SNR):
    """(frame, coverage) of COUNT x COUNT ellipses of the area of a disc of `diameter` pixels, at random parts of a pixel."""
    rng, pitch = np.random.default_rng(seed), int(np.ceil(1.5 * diameter + 10))
    cover = np.vstack([np.hstack([_ellipse(diameter, ratio, pitch, rng) for _ in range(COUNT)]) for _ in range(COUNT)])
    contrast = levels[1] - levels[0]
    camera = Camera(1.0, BLUR, noise=contrast / snr, falloff=FALLOFF, background=levels[0], brightness=levels[1])
    return expose(gaussian_filter(cover, BLUR), camera, seed=rng), cover


def _ellipse(diameter, ratio, side, rng):
    """Coverage (side, side) of one ellipse in a random direction; ratio: long axis over short."""
    points = (np.arange(side * SUB) + 0.5) / SUB - 0.5 * side
    (x0, y0), turn = rng.uniform(-0.5, 0.5, 2), rng.uniform(0, np.pi)
    x, y = np.meshgrid(points - x0, points - y0)
    along, across = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    inside = along**2 / ratio + across**2 * ratio < (0.5 * diameter) ** 2
    return inside.reshape(side, SUB, side, SUB).mean(axis=(1, 3))


def estimates(image):
    """{estimator: (areas in pixels, rows, columns)} of one frame."""
    scene, alone = Scene(image), Scene(image, passes=1)
    numbers, places = range(len(scene.fits)), np.array([region.centroid for region in scene.props])
    areas = {"pixels above the threshold": [region.area for region in scene.props],
             "summed light": [scene._by_light(k)["pixels"] for k in numbers],
             "circle, all discs": [fit.area for fit in _circles(image).fits],
             "outline, each alone": [fit.area for fit in alone.fits],
             "outline, all discs": [fit.area for fit in scene.fits]}
    sds = [fit.area_sd for fit in scene.fits]
    return {name: np.array(values, dtype=float) for name, values in areas.items()}, places, np.array(sds)


def _circles(image):
    """The frame fitted with outlines that are held to circles."""
    free, outline.SHAPE_SD = outline.SHAPE_SD, 1e-4 * outline.SHAPE_SD
    try:
        return Scene(image, passes=PASSES)
    finally:
        outline.SHAPE_SD = free


def bound(diameter, places, shape):
    """Least standard deviation of the areas, root mean square over the discs, as a share of the area."""
    light = illumination(shape, FALLOFF)[tuple(np.round(places).astype(int).T)]
    radius = 0.5 * diameter
    one = 2 / radius / np.sqrt(2 * np.pi * radius / (2 * BLUR * np.sqrt(np.pi)))
    return float(np.sqrt(np.mean((one / (SNR * light)) ** 2)))


def row(diameter, *, ratio, levels, frames):
    """One line of the table: bias and scatter in % for each estimator."""
    truth, errors, ratios, found, limit = np.pi * diameter**2 / 4, {}, [], 0, []
    for seed in range(frames):
        image, _ = frame(diameter, ratio=ratio, levels=LEVELS[levels], seed=seed)
        areas, places, sds = estimates(grey(image))
        for name, values in areas.items():
            errors.setdefault(name, []).extend(values / truth - 1)
        ratios.extend((areas["outline, all discs"] - truth) / sds)
        found += len(places)
        limit.append(bound(diameter, places, image.shape))
    return {"diameter_px": round(float(diameter), 2), "axis_ratio": ratio, "levels": levels, "found": found,
            "of": frames * COUNT**2, "bound_percent": round(100 * float(np.mean(limit)), 2),
            "error_over_stated_sd": round(float(np.std(ratios)), 2),
            "bias_percent": {name: round(100 * float(np.mean(e)), 2) for name, e in errors.items()},
            "sd_percent": {name: round(100 * float(np.std(e)), 2) for name, e in errors.items()},
            "rms_percent": {name: round(100 * float(np.sqrt(np.mean(np.square(e)))), 2) for name, e in errors.items()}}


def _write(rows):
    return record.write("discs", scikit_image=importlib.metadata.version("scikit-image"), signal_to_noise=SNR, falloff=FALLOFF,
                        blur_px=BLUR, rows=rows)


def main():
    """Measure, print, and write benchmarks/results/discs.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=4, metavar="N", help="frames of 100 discs per line (default: 4)")
    options, rows = parser.parse_args(), []
    for levels in LEVELS:
        for ratio in (1.0, 1.3):
            for diameter in DIAMETERS:
                rows.append(row(diameter, ratio=ratio, levels=levels, frames=options.frames))
                print(rows[-1], flush=True)
    print(f"written: {_write(rows)}")


if __name__ == "__main__":
    main()
