"""Pictures of a press that are made at every update: surface and readings as one image, and as coloured meshes in 3-D.

They show what a result holds: the map of a plane surface or the mesh of a body, taxels in rows, readings at places, an image.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import binary_erosion

from softtact.fem.solid_mesh import outer_triangles
from softtact.press.result import PressResult

_HIGH, _WIDE, _EDGE, _TEXT = 340, 320, 8, 34      # px: a panel's largest height and width, its margin, its title
_BACKGROUND, _PLATE, _INK, _WALL = (255, 255, 255), (225,) * 3, (40, 40, 40), 150
_LIGHT = 0.6            # share of the colours' range from which on numbers are written in dark
_MOST_SHOWN = 60_000    # facets that are sent to the page
_MOST_POINTS = 100      # of the surface that is sent to the page, along its longer side, about
_COARSE = 120           # cells along an object's longest side to which a finer mesh is simplified for the page
_GAP = 0.15             # of a footprint's width, between the sensor and its board of taxels
_TILE = 0.92            # share of a taxel's side that its tile takes
_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_DISC, _CORNERS = 0.05, 24      # radius of a place, as a share of the longer side, where its readout states none; corners of it
_RIM = 1.1              # radius of the rim around a taxel on a module, over the taxel's
_UNDER = 0.003          # of the longer side: depth of a module's triangle below its taxels
_NO_DIFFERENCE = 1e-9    # least limit of the colours of a difference: where there is none, it has the middle one


@cache
def colours(name: str = "viridis") -> np.ndarray:
    """256 colours (256, 3) uint8 of a map of matplotlib."""
    import matplotlib

    return np.rint(255 * matplotlib.colormaps[name](np.linspace(0, 1, 256))[:, :3]).astype(np.uint8)


def coloured(values: np.ndarray, low: float, high: float, name: str = "viridis") -> np.ndarray:
    """Colours (..., 3) uint8 of values between two limits."""
    share = (np.asarray(values) - low) / max(high - low, 1e-12)
    return colours(name)[np.rint(255 * np.clip(np.nan_to_num(share), 0, 1)).astype(int)]


@dataclass(frozen=True)
class Places:
    """A reading at places, such as a skin's taxels or points of a body."""

    name: str
    units: str
    xy_mm: np.ndarray
    """(k, 2)"""
    values: np.ndarray
    """(k,)"""
    radius_mm: float
    """That a place is drawn with."""
    triangles_mm: np.ndarray
    """(m, 3, 2): of the modules that the places are on; none where they are on no modules."""
    module: np.ndarray
    """(k,): number of a place's triangle."""


def board(result: PressResult, clearance_mm: np.ndarray | None = None, recorded: np.ndarray | None = None) -> np.ndarray:
    """One image (h, w, 3) uint8: the surface as it is deformed, beside it the readings or the camera's image.

    clearance_mm: (y, x), negative in the contact, which gets a white outline
    recorded: counts (rows, columns) of a real sensor, shown beside the simulated ones and in their colours
    """
    return _beside(_panels(result, clearance_mm, recorded), caption=caption(result))


def comparison(result: PressResult, fast: PressResult) -> np.ndarray:
    """The `board` of a long model's result and its difference to a fast one's: blue where its own is less, red where more.

    Of maps, or else of the first reading at places; without both, and of one result twice, the board alone.
    """
    panels = _panels(result, None)
    if result is fast:
        return _beside(panels, caption=caption(result))
    if result.deformation_map_mm is not None and fast.deformation_map_mm is not None:
        apart = result.deformation_map_mm[-1] - fast.deformation_map_mm[-1]
        most = max(float(np.abs(apart).max()), _NO_DIFFERENCE)
        image = Image.fromarray(coloured(apart[::-1], -most, most, "coolwarm"))
        panels.append(_panel(image, f"less {fast.model}, up to {most:.3f} mm"))
    elif both := list(zip(places_of(result), places_of(fast), strict=False)):
        apart = both[0][0].values - both[0][1].values
        most = max(float(np.abs(apart).max()), _NO_DIFFERENCE)
        panels.append(_panel(_places_image(both[0][0], result, apart, (-most, most), "coolwarm"),
                             f"less {fast.model}, up to {most:.4g} {both[0][0].units}"))
    return _beside(panels, caption=caption(result))


def caption(result: PressResult) -> str:
    """Force, depth and contact in one line."""
    if not result.normal_force_n[-1]:
        return "at first touch, not pressed yet"
    return (f"{result.normal_force_n[-1]:.4g} N, {result.indentation_mm[-1]:.3f} mm deep, contact "
            f"{result.contact_area_mm2[-1]:.4g} mm2 ({result.model})")


def _panels(result, clearance, recorded=None):
    panels, taxels = [_surface_panel(result, clearance)], taxels_of(result)
    read = {name: counts for name, counts in (("taxels", taxels), ("recorded", recorded)) if counts is not None}
    high = max([1.0, *(float(np.nanmax(counts)) for counts in read.values())])
    panels += [_panel(_taxel_image(counts, result, high), f"{name}, up to {np.nanmax(counts):.0f} counts")
               for name, counts in read.items()]
    for places in places_of(result):
        most = float(places.values.max(initial=0.0))
        panels.append(_panel(_places_image(places, result, places.values, (0.0, max(most, 1e-9)), "inferno"),
                             f"{places.name}, up to {most:.4g} {places.units}"))
    if taxels is None and (image := camera_image(result)) is not None:
        panels.append(_panel(Image.fromarray(image), "camera image"))
    return panels


def _surface_panel(result, clearance):
    if result.deformation_map_mm is None:
        return _panel(_body_image(result), f"displacement, up to {moved_mm(result).max():.3f} mm")
    shown = result.deformation_map_mm[-1]
    return _panel(_map_image(shown, clearance), f"deformation, up to {np.abs(shown).max():.3f} mm")


def moved_mm(result: PressResult) -> np.ndarray:
    """Displacement's length in mm at the last step, over the map or the body's nodes."""
    return np.linalg.norm(np.nan_to_num(result.displacement_mm[-1]), axis=-1)


def places_of(result: PressResult) -> Iterator[Places]:
    """Readings at places at the last step; of several quantities the first."""
    for name, reading in result.readings.items():
        if "x_mm" not in reading.coords:
            continue
        values, units = np.asarray(reading.values[-1], dtype=float), reading.attrs.get("units", "")
        if values.ndim > 1:
            values, units = values[:, 0], str(np.asarray(reading["units"].values)[0])
        triangles = np.asarray(reading.attrs.get("modules_mm", [])).reshape(-1, 3, 2)
        yield Places(name, units, np.column_stack([reading["x_mm"].values, reading["y_mm"].values]), np.nan_to_num(values),
                     float(reading.attrs.get("radius_mm", _DISC * np.ptp(_bounds(result), axis=0).max())), triangles,
                     reading["module"].values if len(triangles) else np.zeros(len(values), dtype=int))


def _bounds(result):
    """Least and largest x and y (2, 2) in mm of the sensor."""
    if result.deformation_map_mm is None:
        points = result.solid.mesh.points[:, :2]
        return np.array([points.min(axis=0), points.max(axis=0)])
    return np.column_stack([result.x_mm[[0, -1]], result.y_mm[[0, -1]]])


def taxels_of(result: PressResult) -> np.ndarray | None:
    """Counts (rows, columns) of the last step, if the sensor has taxels."""
    reading = result.readings.get("taxels")
    return None if reading is None or reading.ndim != 3 else np.asarray(reading.values[-1], dtype=float)


def camera_image(result: PressResult) -> np.ndarray | None:
    """The camera's image (h, w, 3) at the last step, if the sensor has a camera."""
    images = [reading.values[-1] for reading in result.readings.values() if reading.ndim == 4 and reading.shape[-1] == 3]
    return np.asarray(images[0], dtype=np.uint8) if images else None


def surface_mesh(result: PressResult) -> trimesh.Trimesh:
    """The sensing surface, or the whole outside of a body, as it is deformed (mm), coloured by the deformation."""
    if result.deformation_map_mm is None:
        points, triangles, moved = _body(result)
        return trimesh.Trimesh(points, triangles, process=False,
                               vertex_colors=_opaque(coloured(moved, 0.0, max(float(moved.max()), 1e-6))))
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
    """The taxels beside the sensor, where it has them: coloured tiles, or a skin's modules with their taxels on them."""
    if (counts := taxels_of(result)) is not None:
        return _tiles(result, counts)
    if (places := next(places_of(result), None)) is None:
        return None
    (low, high), most = _bounds(result), max(float(places.values.max()), 1e-9)
    aside = np.array([(1 + _GAP) * (high - low)[0], 0.0])
    discs = [_polygon(places.xy_mm + aside, _circle(places.radius_mm), 0.0, places.values, most)]
    deep = -_UNDER * (high - low).max()
    if not len(places.triangles_mm):
        discs.append(_grey(_polygon(((low + high) / 2 + aside)[None], _SQUARE * (high - low), deep, np.zeros(1), most)))
    else:
        middle = places.triangles_mm.mean(axis=1)
        discs += [_polygon(middle[[k]] + aside, triangle - middle[k], deep, mean[None], most)
                  for k, (triangle, mean) in enumerate(zip(places.triangles_mm, _module_means(places), strict=True))]
        discs.append(_grey(_polygon(places.xy_mm + aside, _RIM * _circle(places.radius_mm), deep / 2, places.values, most)))
    together: Any = trimesh.util.concatenate(discs)
    return together


def _module_means(places):
    """Mean value of each module's places."""
    return [places.values[places.module == k].mean() for k in range(len(places.triangles_mm))]


def _circle(radius):
    angle = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _grey(mesh):
    mesh.visual.vertex_colors = _opaque(np.full((len(mesh.vertices), 3), _PLATE))
    return mesh


def _polygon(middles, corners, height, values, most):
    """A mesh of one convex polygon (k, 2) around each of the middles (n, 2), seen from above, coloured by values (n,)."""
    k, ahead = len(corners), np.roll(corners, -1, axis=0)
    if (corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]).sum() < 0:
        corners = corners[::-1]
    flat = (middles[:, None] + corners).reshape(-1, 2)
    fan = np.column_stack([np.zeros(k - 2, dtype=int), np.arange(1, k - 1), np.arange(2, k)])
    faces = (k * np.arange(len(middles))[:, None, None] + fan).reshape(-1, 3)
    rgb = np.repeat(coloured(values, 0.0, most, "inferno"), k, axis=0)
    return trimesh.Trimesh(np.column_stack([flat, np.full(len(flat), height)]), faces, vertex_colors=_opaque(rgb), process=False)


def _tiles(result, counts):
    rows, columns = counts.shape
    width, height = np.ptp(result.x_mm), np.ptp(result.y_mm)
    side = np.array([width / columns, height / rows])
    j, i = (index.ravel() for index in np.indices(counts.shape))
    middle = np.column_stack([i + 0.5, j + 0.5]) * side - [width / 2, height / 2] + [(1 + _GAP) * width, 0.0]
    return _polygon(middle, _TILE * side * _SQUARE, 0.0, counts.ravel(), max(np.nanmax(counts), 1.0))


def light_mesh(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh for the page: of one with very many facets the corners that share a small cell are one."""
    if len(mesh.faces) <= _MOST_SHOWN:
        return mesh
    cell = np.ptp(mesh.vertices, axis=0).max() / _COARSE
    _, first, place = np.unique(np.floor(mesh.vertices / cell).astype(int), axis=0, return_index=True, return_inverse=True)
    faces = place.ravel()[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return trimesh.Trimesh(mesh.vertices[first], faces[whole], process=False)


def _body(result):
    """Corners (n, 3) in mm and triangles (t, 3) of a body's outside at the last step, and the displacement's length (n,)."""
    triangles, inverse = np.unique(outer_triangles(result.solid.mesh), return_inverse=True)
    points = (result.solid.mesh.points + result.solid.displacement_mm[-1])[triangles]
    return points, inverse.reshape(-1, 3), moved_mm(result)[triangles]


def _body_image(result):
    """A body from above, coloured by the displacement, with a white outline of the contact."""
    used = np.unique(outer_triangles(result.solid.mesh))
    points, triangles, moved = _body(result)
    (low, high), touched = _bounds(result), np.nan_to_num(result.solid.pressed_mpa[-1][used]) > 0
    size = _size((high - low)[::-1])
    share = (size[0] - 1) / (high - low)[0]
    flat = np.column_stack([points[:, 0] - low[0], high[1] - points[:, 1]]) * share
    corners = points[triangles]
    seen = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0
    image, contact = Image.new("RGB", size, _BACKGROUND), Image.new("1", size)
    pen, marker = ImageDraw.Draw(image), ImageDraw.Draw(contact)
    rgb = coloured(moved[triangles].mean(axis=1), 0.0, max(float(moved.max()), 1e-6))
    for k in np.argsort(corners[..., 2].mean(axis=1)):      # the highest last
        if seen[k]:
            outline = flat[triangles[k]].ravel().tolist()
            pen.polygon(outline, fill=tuple(rgb[k].tolist()))
            if touched[triangles[k]].all():
                marker.polygon(outline, fill=1)
    return _outlined(np.array(image), np.array(contact))


def _map_image(shown, clearance):
    rgb = coloured(shown[::-1], 0.0, max(float(shown.max()), 1e-6))      # the lowest row last, as y goes up
    image = Image.fromarray(rgb).resize(_size(rgb.shape), Image.Resampling.BICUBIC)
    if clearance is None:
        return image
    apart = Image.fromarray(clearance[::-1].astype(np.float32)).resize(image.size, Image.Resampling.BILINEAR)
    return _outlined(np.array(image), np.asarray(apart) < 0)


def _outlined(pixels, mask):
    """An image of pixels (h, w, 3) with a white line around a mask (h, w)."""
    pixels[mask & ~binary_erosion(mask, iterations=2, border_value=1)] = 255
    return Image.fromarray(pixels)


def _places_image(places, result, values, limits, colours_of):
    """Discs with numbers at places, over the triangles of their modules, in the proportions of the sensor."""
    low, high = _bounds(result)
    size = _size((high - low)[::-1])
    share, (least, most) = size[0] / (high - low)[0], limits
    image = Image.new("RGB", size, _BACKGROUND if len(places.triangles_mm) else _PLATE)
    pen, font = ImageDraw.Draw(image), _font(int(np.clip(0.75 * places.radius_mm * share, 7, 20)))

    def flat(points):
        return np.column_stack([points[:, 0] - low[0], high[1] - points[:, 1]]) * share

    means = _module_means(Places(**vars(places) | {"values": values}))
    for triangle, rgb in zip(places.triangles_mm, coloured(means, least, most, colours_of), strict=True):
        pen.polygon(flat(triangle).ravel().tolist(), fill=tuple(rgb.tolist()), outline=(_WALL,) * 3)
    for place, value, rgb in zip(flat(places.xy_mm), values, coloured(values, least, most, colours_of), strict=True):
        pen.circle(place.tolist(), places.radius_mm * share, fill=tuple(rgb.tolist()), outline=(_WALL,) * 3)
        ink = _INK if rgb @ np.array([0.3, 0.6, 0.1]) > 128 else _BACKGROUND
        pen.text(place.tolist(), f"{value:.3g}", fill=ink, font=font, anchor="mm")
    return image


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
