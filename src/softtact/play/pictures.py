"""Pictures of a press that are made at every update: map and readings as one image, the surface as a coloured mesh."""

from functools import cache
from typing import Any

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import binary_erosion

from softtact.press.result import PressResult

_HIGH, _WIDE, _EDGE, _TEXT = 340, 320, 8, 34      # px: a panel's largest height and width, its margin, its title
_BACKGROUND, _INK, _WALL = (255, 255, 255), (40, 40, 40), 150
_LIGHT = 0.6            # share of the colours' range from which on numbers are written in dark
_MOST_SHOWN = 60_000    # facets that are sent to the page
_MOST_POINTS = 100      # of the surface that is sent to the page, along its longer side, about
_COARSE = 120           # cells along an object's longest side to which a finer mesh is simplified for the page
_GAP = 0.15             # of a footprint's width, between the sensor and its board of taxels
_TILE = 0.92            # share of a taxel's side that its tile takes


@cache
def colours(name: str = "viridis") -> np.ndarray:
    """256 colours (256, 3) uint8 of a map of matplotlib."""
    import matplotlib

    return np.rint(255 * matplotlib.colormaps[name](np.linspace(0, 1, 256))[:, :3]).astype(np.uint8)


def coloured(values: np.ndarray, low: float, high: float, name: str = "viridis") -> np.ndarray:
    """Colours (..., 3) uint8 of values between two limits."""
    share = (np.asarray(values) - low) / max(high - low, 1e-12)
    return colours(name)[np.rint(255 * np.clip(np.nan_to_num(share), 0, 1)).astype(int)]


def board(result: PressResult, clearance_mm: np.ndarray | None = None, recorded: np.ndarray | None = None) -> np.ndarray:
    """One image (h, w, 3) uint8: the deformation map, beside it the taxels or the camera's image.

    clearance_mm: (y, x), negative in the contact, which gets a white outline
    recorded: counts (rows, columns) of a real sensor, shown beside the simulated ones and in their colours
    """
    return _beside(_panels(result, clearance_mm, recorded), caption=_caption(result))


def comparison(result: PressResult, elastic: PressResult) -> np.ndarray:
    """The `board` of a long model's result and its difference to the elastic map: blue where its own is less, red where more."""
    apart = result.deformation_map_mm[-1] - elastic.deformation_map_mm[-1]
    most = float(np.abs(apart).max())
    image = Image.fromarray(coloured(apart[::-1], -most, most, "coolwarm"))
    return _beside([*_panels(result, None), _panel(image, f"less elastic, up to {most:.3f} mm")], caption=_caption(result))


def _caption(result):
    return (f"{result.normal_force_n[-1]:.4g} N, {result.indentation_mm[-1]:.3f} mm deep, contact "
            f"{result.contact_area_mm2[-1]:.4g} mm2 ({result.model})")


def _panels(result, clearance, recorded=None):
    shown, taxels = result.deformation_map_mm[-1], taxels_of(result)
    panels = [_panel(_map_image(shown, clearance), f"deformation, up to {np.abs(shown).max():.3f} mm")]
    read = {name: counts for name, counts in (("taxels", taxels), ("recorded", recorded)) if counts is not None}
    high = max([1.0, *(float(np.nanmax(counts)) for counts in read.values())])
    panels += [_panel(_taxel_image(counts, result, high), f"{name}, up to {np.nanmax(counts):.0f} counts")
               for name, counts in read.items()]
    if taxels is None and (image := camera_image(result)) is not None:
        panels.append(_panel(Image.fromarray(image), "camera image"))
    return panels


def taxels_of(result: PressResult) -> np.ndarray | None:
    """Counts (rows, columns) of the last step, if the sensor has taxels."""
    reading = result.readings.get("taxels")
    return None if reading is None or reading.ndim != 3 else np.asarray(reading.values[-1], dtype=float)


def camera_image(result: PressResult) -> np.ndarray | None:
    """The camera's image (h, w, 3) at the last step, if the sensor has a camera."""
    images = [reading.values[-1] for reading in result.readings.values() if reading.ndim == 4 and reading.shape[-1] == 3]
    return np.asarray(images[0], dtype=np.uint8) if images else None


def surface_mesh(result: PressResult) -> trimesh.Trimesh:
    """The sensing surface (mm) as it is deformed, coloured by the deformation."""
    each = max(1, round(max(result.deformation_map_mm.shape) / _MOST_POINTS))
    down = result.deformation_map_mm[-1][::each, ::each]
    x, y = np.meshgrid(result.x_mm[::each], result.y_mm[::each])
    aside = np.nan_to_num(result.displacement_mm[-1][::each, ::each, :2])      # by friction, where the result knows it
    x, y = x + aside[..., 0], y + aside[..., 1]
    top = np.column_stack([x.ravel(), y.ravel(), -down.ravel()])
    rgb = coloured(down, 0.0, max(float(down.max()), 1e-6)).reshape(-1, 3)
    rim = _rim(*down.shape)
    base = top[rim] * [1, 1, 0] - [0, 0, result.attributes["thickness_mm"]]
    upper, lower = len(top) + np.arange(len(rim)), len(top) + len(rim) + np.arange(len(rim))
    walls = np.vstack([np.column_stack([upper, lower, np.roll(lower, -1)]),
                       np.column_stack([upper, np.roll(lower, -1), np.roll(upper, -1)])])
    return trimesh.Trimesh(np.vstack([top, top[rim], base]), np.vstack([_grid_faces(*down.shape), walls]), process=False,
                           vertex_colors=_opaque(np.vstack([rgb, np.full((2 * len(rim), 3), _WALL, dtype=np.uint8)])))


def taxel_mesh(result: PressResult) -> trimesh.Trimesh | None:
    """The taxels as coloured tiles beside the sensor, where a sensor has them."""
    if (counts := taxels_of(result)) is None:
        return None
    rows, columns = counts.shape
    width, height = np.ptp(result.x_mm), np.ptp(result.y_mm)
    side = np.array([width / columns, height / rows])
    j, i = (index.ravel() for index in np.indices(counts.shape))
    middle = np.column_stack([i + 0.5, j + 0.5]) * side - [width / 2, height / 2] + [(1 + _GAP) * width, 0.0]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * _TILE * side
    flat = (middle[:, None] + corners).reshape(-1, 2)
    faces = (4 * np.arange(rows * columns)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    rgb = np.repeat(coloured(counts.ravel(), 0.0, max(np.nanmax(counts), 1.0), "inferno"), 4, axis=0)
    return trimesh.Trimesh(np.column_stack([flat, np.zeros(len(flat))]), faces, vertex_colors=_opaque(rgb), process=False)


def light_mesh(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh for the page: of one with very many facets the corners that share a small cell are one."""
    if len(mesh.faces) <= _MOST_SHOWN:
        return mesh
    cell = np.ptp(mesh.vertices, axis=0).max() / _COARSE
    _, first, place = np.unique(np.floor(mesh.vertices / cell).astype(int), axis=0, return_index=True, return_inverse=True)
    faces = place.ravel()[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return trimesh.Trimesh(mesh.vertices[first], faces[whole], process=False)


def _map_image(shown, clearance):
    rgb = coloured(shown[::-1], 0.0, max(float(shown.max()), 1e-6))      # the lowest row last, as y goes up
    image = Image.fromarray(rgb).resize(_size(rgb.shape), Image.Resampling.BICUBIC)
    if clearance is None:
        return image
    apart = Image.fromarray(clearance[::-1].astype(np.float32)).resize(image.size, Image.Resampling.BILINEAR)
    mask = np.asarray(apart) < 0
    pixels = np.array(image)
    pixels[mask & ~binary_erosion(mask, iterations=2, border_value=1)] = 255
    return Image.fromarray(pixels)


def _taxel_image(counts, result, high):
    """Tiles with numbers, in the proportions of the sensor; high: counts of the brightest colour."""
    counts = counts[::-1]     # the lowest row last, as y goes up
    rgb = coloured(counts, 0.0, high, "inferno")
    width, height = _size((np.ptp(result.y_mm), np.ptp(result.x_mm)))
    image = Image.fromarray(rgb).resize((width, height), Image.Resampling.NEAREST)
    pen, (rows, columns) = ImageDraw.Draw(image), counts.shape
    if rows * columns > 200:
        return image
    font = _font(int(np.clip(width / columns / 3.2, 7, 20)))
    for (row, column), value in np.ndenumerate(counts):
        place = (column + 0.5) * width / columns, (row + 0.5) * height / rows
        pen.text(place, f"{value:.0f}", fill=_INK if value > _LIGHT * high else _BACKGROUND, font=font, anchor="mm")
    return image


def _panel(image, title):
    """An image with a title."""
    size = _size(image.size[::-1])
    image = image.resize(size, Image.Resampling.BILINEAR) if image.size != size else image
    out = Image.new("RGB", (max(size[0], 200) + 2 * _EDGE, size[1] + _TEXT + _EDGE), _BACKGROUND)
    ImageDraw.Draw(out).text((_EDGE, _EDGE), title, fill=_INK, font=_font(14))
    out.paste(image, (_EDGE, _TEXT))
    return out


def _beside(panels, *, caption=""):
    high = max(one.height for one in panels)
    out = Image.new("RGB", (sum(one.width for one in panels), high + (_TEXT if caption else 0)), _BACKGROUND)
    ImageDraw.Draw(out).text((_EDGE, high), caption, fill=_INK, font=_font(14))
    left = 0
    for one in panels:
        out.paste(one, (left, 0))
        left += one.width
    return np.asarray(out)


def _size(shape: tuple[float, ...]) -> tuple[int, int]:
    """Width and height in px of an image of a shape (rows, columns, ...) that fits a panel."""
    share = min(_HIGH / shape[0], _WIDE / shape[1])
    return round(share * shape[1]), round(share * shape[0])


@cache
def _font(size: int) -> Any:
    return ImageFont.load_default(size)


@cache
def _grid_faces(rows: int, columns: int) -> np.ndarray:
    node = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]))
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


@cache
def _rim(rows: int, columns: int) -> np.ndarray:
    """The grid's nodes around its sides, counter-clockwise from above."""
    node = np.arange(rows * columns).reshape(rows, columns)
    return np.concatenate([node[0, :-1], node[:-1, -1], node[-1, :0:-1], node[:0:-1, 0]])


def _opaque(rgb):
    """Colours (n, 4) of a mesh's vertices, which glTF takes as linear, from those of a screen (n, 3)."""
    screen = np.asarray(rgb) / 255
    linear = np.where(screen <= 0.04045, screen / 12.92, ((screen + 0.055) / 1.055) ** 2.4)     # of sRGB
    return np.column_stack([np.rint(255 * linear).astype(np.uint8), np.full(len(linear), 255, dtype=np.uint8)])
