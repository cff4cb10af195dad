"""A made-up gel: markers that an object carries along, drawn without mechanics, so that the study's stages run in a moment."""

import numpy as np

from softtact.studies.markers.pressing import Frames

CAMERA_PX, MARKERS, RADIUS_PX = 128, 4, 4.5
MM_PER_PX = 16.0 / CAMERA_PX


def rest_px():
    """(16, 2) places of the markers at rest."""
    along = CAMERA_PX * (np.arange(MARKERS) + 0.5) / MARKERS - 0.5
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def made_up_frames(sensor, mesh, plan, path):
    """`Frames` in place of a press: under a disc of 4 mm markers spread with the depth, and go with the object at half its way."""
    moved = plan.moved_mm(path)
    rest, middle = rest_px(), 0.5 * (CAMERA_PX - 1) + np.array([plan.x_mm, plan.y_mm]) * 2
    near = np.exp(-((rest - middle) ** 2).sum(axis=1) / (4.0 / MM_PER_PX) ** 2)[:, None]
    way = np.zeros((len(moved), 2))
    way[:, 0 if plan.aside == "x" else 1] = -0.5 * moved[:, 1] / MM_PER_PX
    spread = near * (rest - middle) * 0.06
    px = rest + moved[:, :1, None] * spread + near * way[:, None]
    y, x = np.mgrid[:CAMERA_PX, :CAMERA_PX]
    disc = np.hypot(x - middle[0], y - middle[1]) < 4.0 / MM_PER_PX
    depth = moved[:, 0][:, None, None] * disc
    image = np.stack([_drawn(places, one, disc) for places, one in zip(px, moved[:, 0], strict=True)])
    maps = np.zeros((len(moved), 5, 5, 3))
    maps[:, 2, 2, 2] = -moved[:, 0]
    force = np.zeros((len(moved), 3))
    force[:, 2] = -moved[:, 0]
    points = np.concatenate([(px - 0.5 * (CAMERA_PX - 1)) * MM_PER_PX, -np.repeat(moved[:, :1, None], len(rest), axis=1)], axis=-1)
    axis = np.linspace(-8, 8, 5)
    return Frames(depth, image, px, points, maps, maps, maps[..., 2] < -0.5, force, axis, axis)


def _drawn(places, depth, disc):
    light = np.full(disc.shape, 180.0) - 40 * depth * disc
    for column, row in places:
        x0, y0 = (max(int(at) - 7, 0) for at in (column, row))
        y, x = np.mgrid[y0:min(y0 + 16, CAMERA_PX), x0:min(x0 + 16, CAMERA_PX)]
        light[y, x] *= 1 - 0.8 * np.clip(RADIUS_PX + 0.5 - np.hypot(x - column, y - row), 0, 1)
    return np.repeat(np.round(light).astype(np.uint8)[..., None], 3, axis=-1)
