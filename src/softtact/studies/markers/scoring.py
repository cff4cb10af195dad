"""Where the markers of an image are, and the scores of images of sequences against the solved ones.

Images of networks are smaller than the camera's; they are enlarged to the camera's size before markers are looked for, so that all
places are in px of the camera. Markers are tracked from frame to frame, since they move by less than half their pitch between two.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from softtact.errors import InputError
from softtact.evaluation.image_scores import degenerate, image_scores, motion_error_px, outside_markers, position_error_px
from softtact.imaging.markers import find_markers, track

if TYPE_CHECKING:
    import xarray

COLUMNS = [
    "source",
    "seed",
    "object",
    "split",
    "sequence",
    "end_depth_mm",
    "depth_mm",
    "aside_mm",
    "aside",
    "d_px",
    "e_px",
    "degenerate",
    "mae",
    "mse",
    "ssim",
    "psnr",
]
_REACH = 0.45  # of the pitch, that a marker moves between two frames at most
_MARGIN = 1.5  # radii around a marker that are left out of the image's scores


@dataclass(frozen=True)
class Camera:
    """What scores need of the camera."""

    px: int
    """Side of its image."""
    radius_px: float
    """Of a marker."""
    rest_px: np.ndarray
    """(marker, 2) of the markers at rest."""

    @property
    def reach_px(self) -> float:
        """Largest motion of a marker between two frames."""
        nearest = cKDTree(self.rest_px).query(self.rest_px, k=2)[0][:, 1]
        return _REACH * float(np.median(nearest))


def enlarged(image: np.ndarray, px: int) -> np.ndarray:
    """An image (y, x, 3) uint8 with px a side, bicubic."""
    from PIL import Image

    if image.shape[0] == px:
        return image
    return np.asarray(Image.fromarray(image).resize((px, px), Image.Resampling.BICUBIC))


def marker_places(images: np.ndarray, camera: Camera) -> np.ndarray:
    """(n, marker, 2) px of the camera of the markers in successive images (n, y, x, 3), the first at rest; nan where not found."""
    last, places = camera.rest_px, []
    for image in images:
        try:
            found = find_markers(enlarged(image, camera.px), radius_px=camera.radius_px).px
        except InputError:  # of an image without any
            found = np.zeros((0, 2))
        places.append(track(last, found, limit_px=camera.reach_px))
        last = np.where(np.isfinite(places[-1]), places[-1], last)
    return np.array(places)


@dataclass(frozen=True)
class Made:
    """What one source, a network or another physics, gives of a sequence."""

    places_px: np.ndarray
    """(n, marker, 2) px of the camera, of the frames that are scored."""
    rest_px: np.ndarray
    """(marker, 2) of its own frame at rest."""
    images: np.ndarray | None
    """(n, y, x, 3) uint8 of the same frames; None of a source without images."""


@dataclass(frozen=True)
class Truth:
    """The solved frames of a sequence that are scored."""

    places_px: np.ndarray
    """(n, marker, 2) px of the camera."""
    rest_px: np.ndarray
    """(marker, 2) at rest."""
    images: np.ndarray
    """(n, y, x, 3) uint8 of the networks' size."""
    labels: pd.DataFrame
    """(n) rows with object, split, sequence, end_depth_mm, depth_mm, aside_mm, aside."""


def scored_frames(count: int, every: int) -> np.ndarray:
    """Numbers of the frames of a sequence that are scored: each `every`-th one from the last back, without the one at rest."""
    return np.arange(count - 1, 0, -every)[::-1]


def truth_of(data: "xarray.Dataset", rows: np.ndarray) -> Truth:
    """The truth of some frames of one sequence of a file of image sequences, whose first frame is at rest."""
    sequence = data.sequence.values == data.sequence.values[rows[0]]
    labels = pd.DataFrame(
        {name: data[name].values[rows] for name in ("object", "split", "sequence", "end_depth_mm", "depth_mm", "aside_mm", "aside")}
    )
    return Truth(data.marker_px.values[rows], data.marker_px.values[sequence][0], data.image.values[rows], labels)


def scores(made: Made, truth: Truth, camera: Camera, *, source: str, seed: int) -> pd.DataFrame:
    """A row with COLUMNS for each frame; scores of images are nan of a source without them."""
    lost = degenerate(made.places_px)
    table = truth.labels.assign(
        source=source,
        seed=seed,
        degenerate=lost.astype(int),
        d_px=position_error_px(made.places_px, truth.places_px),
        e_px=motion_error_px(made.places_px, truth.places_px, made_at_rest=made.rest_px, real_at_rest=truth.rest_px),
    )
    alike = [_alike(made, truth, number, camera) for number in range(len(table))]
    return table.assign(**{name: [one[name] for one in alike] for name in ("mae", "mse", "ssim", "psnr")})[COLUMNS]


def _alike(made: Made, truth: Truth, number: int, camera: Camera) -> dict[str, float]:
    """Scores of one image outside the markers."""
    if made.images is None:
        return dict.fromkeys(("mae", "mse", "ssim", "psnr"), np.nan)
    real = truth.images[number]
    scale = real.shape[0] / camera.px
    places = [(part[number] + 0.5) * scale - 0.5 for part in (truth.places_px, made.places_px)]  # middles of pixels
    counted = outside_markers((real.shape[0], real.shape[1]), *places, radius_px=_MARGIN * camera.radius_px * scale)
    return asdict(image_scores(made.images[number], real, counted=counted))


def table_one(rows: pd.DataFrame, sources: Sequence[str]) -> pd.DataFrame:
    """Table I: a row for each source with d_px, e_px and degenerate_percent, each with its standard deviation over the seeds,
    and the values of the seeds.

    d and e are means over the frames that are not degenerate.
    """
    return _summary(rows.assign(degenerate_percent=100 * rows.degenerate), sources, ("d_px", "e_px", "degenerate_percent"))


def table_two(rows: pd.DataFrame, sources: Sequence[str]) -> pd.DataFrame:
    """Table II: a row for each source with mae, mse, ssim and psnr outside the markers; an image without any error has no psnr."""
    finite = rows.assign(psnr=rows.psnr.replace(np.inf, np.nan))
    kept = [source for source in sources if finite.loc[finite.source == source, "mae"].notna().any()]
    return _summary(finite, kept, ("mae", "mse", "ssim", "psnr"))


def _summary(rows: pd.DataFrame, sources: Sequence[str], names: Sequence[str]) -> pd.DataFrame:
    of_seeds = rows.groupby(["source", "seed"])[list(names)].mean()
    found = []
    for source in sources:
        if source not in of_seeds.index.get_level_values(0):
            continue
        one = of_seeds.loc[source]
        spread = one.std(ddof=1) if len(one) > 1 else one.iloc[0] * np.nan
        found.append(
            {
                "source": source,
                "seeds": len(one),
                **{name: one[name].mean() for name in names},
                **{f"{name}_sd": spread[name] for name in names},
                **{f"{name}_each": ", ".join(f"{value:.3g}" for value in one[name]) if len(one) > 1 else np.nan for name in names},
            }
        )
    return pd.DataFrame(found)
