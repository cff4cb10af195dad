"""Milliseconds of an image of a gel: `python benchmarks/gel_images.py [--taxim FOLDER]` from the project's folder.

A ball of 4 mm is pressed 1 mm deep into gelsight_mini and moved aside by 1 mm; the press itself is not timed. Then the image with
7 x 9 solved markers is drawn again and again on one core, at the sensor's pixels and at 640 x 480, with each kind of shading.
`shadows`: the table, and a shadow of a lamp for each channel. Parts: slopes of
the map, shadows, search of the pixels' points, markers, colours. Accuracy: the same image with every pixel's ray searched,
and the shading's own formula. With `--taxim`, the folder of PyPI's unpacked wheel of `taxim` (1.4.1, MIT): its torch path, without
shadows and without markers, at its own 640 x 480, in the same run (torchvision's resize, of which it caches the result, is stood in
for by torch's). Times are seconds of the process, with OMP_NUM_THREADS=1. Writes benchmarks/results/gel_images.json; a minute.
"""

import argparse
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import record
import trimesh

import softtact
from softtact.imaging import gel_image
from softtact.imaging.pinhole import Pinhole
from softtact.imaging.shading import KINDS, ShadingSamples
from softtact.imaging.shadows import Lamps, dimming_of
from softtact.readout.camera import Camera
from softtact.readout.relief import Relief

FRAMES = 60
SHADOWS = "shadows"
LAMPS = Lamps(np.deg2rad([0.0, 120.0, 240.0]), np.full(3, 0.2), np.full(3, 0.2), np.full(3, 0.3))
SIZES = {"320 x 240": (320, 240, 0.0634), "640 x 480": (640, 480, 0.0317)}


def pressed():
    """The relief of the last step, and the camera of the sensor."""
    sensor = softtact.load_sensor("gelsight_mini")
    result = sensor.press(trimesh.creation.icosphere(subdivisions=4, radius=4.0), motion="z -1.0 in 4; x 1.0 in 4", model="elastic",
                          label="")
    return Relief(result.x_mm, result.y_mm, result.displacement_mm[-1]), sensor.readouts["camera"]


def shading_of(kind, pixels):
    """A shading of a kind, fitted to samples of three lights whose strength changes across the image."""
    rng = np.random.default_rng(0)
    slope_x, slope_y, x, y = (rng.uniform(low, high, 20000) for low, high in ((-1, 1), (-1, 1), (0, pixels[0]), (0, pixels[1])))
    tilt = np.stack([slope_x, slope_y]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    lights = np.deg2rad([0, 120, 240])
    colours = 100 * (np.cos(lights)[:, None] * tilt[0] + np.sin(lights)[:, None] * tilt[1]) * (1 + 0.2 * (x / pixels[0] - 0.5))
    background = np.full((pixels[1], pixels[0], 3), 130.0)
    return KINDS[kind].fit(ShadingSamples(slope_x, slope_y, x, y, colours.T), pixels, background)


def frame(relief, camera, markers, places, table, background, lamps):
    """One image, the map's slopes and dimming, light past the markers, and the seconds (5,) of its parts on the processor."""
    step, at = gel_image.pixel_step(relief, camera), [time.process_time()]
    fields = gel_image.slopes_of(relief, camera.turn)
    at.append(time.process_time())
    if lamps is not None:
        fields = np.concatenate([fields, dimming_of(relief, lamps, fields, camera.turn)], axis=2)
    at.append(time.process_time())
    seen = gel_image.seen(relief, camera, fields, step=step)
    at.append(time.process_time())
    light = gel_image.light_past_markers(relief, camera, markers, places)
    at.append(time.process_time())
    image = gel_image.colours_by_table(seen[..., :2], step, table, background, light, None if lamps is None else seen[..., 2:])
    at.append(time.process_time())
    return image, fields, light, np.diff(at)


def timed(relief, readout, size, kind):
    """Milliseconds and accuracy of one size and shading."""
    columns, rows, mm_per_px = SIZES[size]
    camera = Pinhole(rows, columns, mm_per_px, readout.distance_mm, axes=readout.axes)
    places = Camera.model_copy(readout, update={"pixels": (columns, rows), "mm_per_px": mm_per_px}).markers_mm()
    lamps = LAMPS if kind == SHADOWS else None
    shading = shading_of("table" if lamps is not None else kind, (columns, rows))
    table, background = gel_image.tabulate(shading, camera), np.full((rows, columns, 3), 130.0, dtype=np.float32)
    given = (relief, camera, readout.markers, places, table, background, lamps)
    frame(*given)
    seconds = np.array([frame(*given)[3] for _ in range(FRAMES)])
    image, fields, light, _ = frame(*given)
    seen = gel_image.seen(relief, camera, fields)
    exact = gel_image.colours_by_formula(seen[..., :2], shading, background, light, None if lamps is None else seen[..., 2:])
    off = np.abs(image.astype(int) - exact)
    medians = np.median(1e3 * seconds, axis=0).round(2).tolist()
    parts = dict(zip(("slopes", "shadows", "rays", "markers", "colours"), medians, strict=True))
    whole = 1e3 * seconds.sum(axis=1)
    return {"ms": round(float(np.median(whole)), 2), "fastest_ms": round(float(whole.min()), 2), "parts_ms": parts,
            "mean_error_levels": round(float(off.mean()), 4), "largest_error_levels": int(off.max())}


def stand_ins():
    """Modules that taxim imports: torchvision's resize by torch, and torch_scatter, which only its shadows use."""
    import torch

    def resize(image, size, interpolation=None):
        return torch.nn.functional.interpolate(image[None], size=tuple(size), mode="bilinear", antialias=True)[0]

    vision, transforms, functional, scatter = (ModuleType(name) for name in (
        "torchvision", "torchvision.transforms", "torchvision.transforms.functional", "torch_scatter"))
    transforms.InterpolationMode = type("InterpolationMode", (), {"BILINEAR": "bilinear"})
    functional.resize = resize
    sys.modules |= {one.__name__: one for one in (vision, transforms, functional, scatter)}


def taxim(folder):
    """Milliseconds of taxim's torch path on the same ball, 1 mm deep, without shadows."""
    import torch

    stand_ins()
    sys.path.insert(0, str(folder))
    from taxim.taxim_torch import TaximTorch

    torch.set_num_threads(1)
    simulator = TaximTorch()
    y, x = np.mgrid[:480, :640]
    height = 4.0 - np.sqrt(np.maximum(16.0 - ((x - 320) ** 2 + (y - 240) ** 2) * simulator.sensor_params.pixmm**2, 0.0))
    heights, seconds = simulator.convert_height_map(height), []
    for _ in range(FRAMES + 1):
        start = time.process_time()
        image = simulator.render_direct(heights, with_shadow=False, press_depth=1.0)
        seconds.append(1e3 * (time.process_time() - start))
    assert tuple(image.shape) == (3, 480, 640)
    return {"ms": round(float(np.median(seconds[1:])), 2), "fastest_ms": round(float(np.min(seconds[1:])), 2),
            "pixels": "640 x 480", "shadows": False, "markers": False, "version": "1.4.1", "torch": torch.__version__}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--taxim", type=Path, help="folder of the unpacked wheel")
    options = parser.parse_args()
    relief, readout = pressed()
    found = {f"{size}, {kind}": timed(relief, readout, size, kind) for size in SIZES for kind in (*KINDS, SHADOWS)}
    if options.taxim:
        found["taxim, torch path"] = taxim(options.taxim)
    record.write("gel_images", frames=FRAMES, threads=1, clock="seconds of the process", images=found)
    for name, one in found.items():
        print(f"{name:24}{one['ms']:8.2f} ms (fastest {one['fastest_ms']:.2f})  {one.get('parts_ms', '')}")


if __name__ == "__main__":
    main()
