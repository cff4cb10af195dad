"""Bright contact discs in a camera frame: found by threshold, measured by their summed light."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter
from skimage import io
from skimage.filters import threshold_otsu
from skimage.measure import label, regionprops
from skimage.segmentation import expand_labels

from softtact.errors import InputError

COLUMNS = ["disc", "x_mm", "y_mm", "area_mm2"]
SMALLEST_PIXELS = 12   # a smaller bright spot is taken for noise
_RIM_PIXELS = 4        # light that the lens has spread beyond the threshold belongs to the disc
_CONTRAST = 0.15       # of full scale; a frame with less holds no disc


def detect_discs(frame, *, pixel_mm):
    """Table (disc, x_mm, y_mm, area_mm2) of the bright discs in a grey frame (rows, columns), origin at its centre.

    The area is the light above the background divided by the light of the disc's own core, so it does not
    depend on the threshold, on blur, or on where the disc lies under uneven light. An empty frame gives an empty table.
    """
    image = np.asarray(frame, dtype=float) / (np.iinfo(frame.dtype).max if frame.dtype.kind == "u" else 1.0)
    smooth = gaussian_filter(image, 1.0)
    if np.ptp(smooth) < _CONTRAST:
        return pd.DataFrame(columns=COLUMNS)
    labels = label(smooth > threshold_otsu(smooth))
    background = float(np.median(image[labels == 0]))
    grown = expand_labels(labels, _RIM_PIXELS)
    rows = [_measure(region, smooth, image, grown, background) for region in regionprops(labels)
            if region.area >= SMALLEST_PIXELS]
    centre = 0.5 * (np.array(image.shape) - 1)
    return pd.DataFrame([(k, (c - centre[1]) * pixel_mm, (r - centre[0]) * pixel_mm, pixels * pixel_mm**2)
                         for k, (r, c, pixels) in enumerate(rows)], columns=COLUMNS)


def _measure(region, smooth, image, grown, background):
    """Centre (row, column) and area in pixels of one disc."""
    r0, c0, r1, c1 = region.bbox
    window = (slice(max(0, r0 - _RIM_PIXELS), r1 + _RIM_PIXELS), slice(max(0, c0 - _RIM_PIXELS), c1 + _RIM_PIXELS))
    own = grown[window] == region.label
    core = np.percentile(smooth[region.slice][region.image], 75) - background
    return (*region.centroid, float((image[window] - background)[own].sum() / core))


def read_frames(path):
    """Pairs (name, grey frame) of an image file, or of a folder's PNG, TIFF and JPEG files in order of name."""
    path = Path(path)
    files = sorted(p for p in path.iterdir() if p.suffix.lower() in (".png", ".tif", ".tiff", ".jpg", ".jpeg")) \
        if path.is_dir() else [path]
    if not files:
        raise InputError(f"{path}: the folder holds no PNG, TIFF or JPEG file; name the folder with the frames.")
    for file in files:
        yield file.name, read_frame(file)


def read_frame(file):
    """One frame as grey values (rows, columns)."""
    try:
        frame = io.imread(file)
    except FileNotFoundError:
        raise InputError(f"{file}: there is no such file.") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{file}: not a readable image ({error}).") from None
    return frame if frame.ndim == 2 else np.asarray(frame[..., :3].mean(axis=2), dtype=np.uint8)
