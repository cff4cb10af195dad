"""The readout `camera`: what a camera behind a gel sees, as images.

    readouts:
      camera: {kind: camera, pixels: [320, 240], mm_per_px: 0.063, distance_mm: 35, shading: gelsight_mini,
               markers: {rows: 7, columns: 9, pitch_mm: 2.0, radius_mm: 0.35}}

The pinhole and its signs: `softtact.imaging.pinhole`; what is drawn: `softtact.imaging.gel_image`; colours: a shading that
`softtact calibrate-camera` wrote, or one that ships. Other readouts, `markers` and `depth`, use the camera of this entry.
"""

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PositiveInt, model_validator

from softtact.errors import InputError
from softtact.imaging import gel_image
from softtact.imaging.gel_image import Relief, ShadingTable
from softtact.imaging.pinhole import Pinhole
from softtact.imaging.shading import Shading
from softtact.imaging.shadows import dimming_of
from softtact.readout.registry import SurfaceMotion, labelled, make_readout, register
from softtact.readout.relief import reliefs
from softtact.sensors.base import Specification
from softtact.sensors.fields import FiniteSection, Length, plain_value

if TYPE_CHECKING:
    import xarray

Place = Annotated[tuple[float, float], BeforeValidator(plain_value)]
Direction = Literal["x", "y", "-x", "-y"]
_STEEPEST_EDGE = 0.5      # px: the least width of a marker's edge, below which a disc is not smooth


class MarkerGrid(FiniteSection):
    """Dark discs on the sensing surface: a regular grid, or a list of places.

    A grid: `rows` x `columns` with a pitch, from the place of the first one on, by default in the middle of the image; turned by
    angle_deg, clockwise in the image. A list: points_px. All in the image of the untouched gel.
    """

    rows: PositiveInt | None = None
    columns: PositiveInt | None = None
    pitch_mm: Length | None = None
    pitch_px: Length | None = Field(None, description="in place of pitch_mm")
    first_px: Place | None = Field(None, description="column and row of the first marker; by default the grid lies in the middle")
    angle_deg: float = 0.0
    points_px: tuple[tuple[float, float], ...] | None = Field(None, description="columns and rows, in place of a grid")
    radius_mm: Length
    darkness: Annotated[float, BeforeValidator(plain_value), Field(gt=0, le=1)] = 0.8
    edge_px: Annotated[float, BeforeValidator(plain_value), Field(ge=_STEEPEST_EDGE)] = Field(
        1.0, description="width of the edge over which a marker gets dark, by the pixels' size and the lens")

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        grid = [self.rows, self.columns, self.pitch_mm or self.pitch_px]
        if (self.points_px is None) == (None in grid) or (self.points_px is not None and any(grid)):
            raise ValueError("it is neither a grid nor a list; give rows, columns and pitch_mm, or points_px")
        if self.pitch_mm and self.pitch_px:
            raise ValueError("it has two pitches; give pitch_mm or pitch_px")
        return self

    def rest_px(self, camera: Pinhole) -> np.ndarray:
        """(n, 2) column and row of the markers in the untouched gel's image, row by row."""
        if self.points_px is not None:
            return np.array(self.points_px, dtype=float).reshape(-1, 2)
        assert self.rows and self.columns
        pitch = self.pitch_px or self.pitch_mm / camera.mm_per_px      # type: ignore[operator]
        angle = np.deg2rad(self.angle_deg)
        along = pitch * np.array([np.cos(angle), np.sin(angle)])
        down = np.array([-along[1], along[0]])
        number = np.stack(np.meshgrid(np.arange(self.columns), np.arange(self.rows)), axis=-1).reshape(-1, 2)
        middle = 0.5 * ((self.columns - 1) * along + (self.rows - 1) * down)
        first = camera.centre_px - middle if self.first_px is None else np.array(self.first_px)
        return first + number[:, :1] * along + number[:, 1:] * down


@register("camera")
class Camera(FiniteSection):
    """A camera behind the gel. Reading: (step, y, x, channel) in grey levels 0 to 255, uint8, row 0 at the top.

    shading: the name of one that ships, or a file of `softtact calibrate-camera`, relative to the sensor's file
    background: an image of the untouched gel, by default the shading's smooth one
    axes: directions of the sensor frame along the image's columns and rows
    """

    pixels: Annotated[tuple[PositiveInt, PositiveInt], BeforeValidator(plain_value)] = Field(description="columns, rows")
    mm_per_px: Length = Field(description="on the surface at rest, in the middle of the image")
    distance_mm: Length = Field(description="from the pinhole to the surface at rest")
    distortion: Annotated[tuple[float, float, float, float, float], BeforeValidator(plain_value)] = Field(
        (0.0, 0.0, 0.0, 0.0, 0.0), description="Brown's k1, k2, p1, p2, k3")
    axes: Annotated[tuple[Direction, Direction], BeforeValidator(plain_value)] = ("x", "y")
    shading: Annotated[str, BeforeValidator(plain_value)]
    background: str | None = None
    markers: MarkerGrid | Literal["none"] = "none"

    @property
    def pinhole(self) -> Pinhole:
        """The camera's geometry."""
        return Pinhole(self.pixels[1], self.pixels[0], self.mm_per_px, self.distance_mm, self.distortion, self.axes)

    def markers_mm(self) -> np.ndarray:
        """(n, 2) places of the markers on the surface at rest, in mm of the sensor frame; none without markers."""
        if self.markers == "none":
            return np.zeros((0, 2))
        return self.pinhole.on_surface(self.markers.rest_px(self.pinhole))[:, :2]

    def check_on(self, spec: Specification) -> None:
        """Raise InputError where the axes, the lens or the markers do not fit the sensor."""
        where, (columns, rows) = f"{spec.name}, at 'readouts'", self.pixels
        if self.axes[0][-1] == self.axes[1][-1]:
            raise InputError(f"{where}: both axes of the camera, {list(self.axes)}, lie along one direction; write x and y.")
        corners = np.array([[0, 0], [columns - 1, 0], [0, rows - 1], [columns - 1, rows - 1]])
        if np.isnan(self.pinhole.directions(corners)).any():
            raise InputError(f"{where}: the camera's distortion {list(self.distortion)} has no inverse in the image's corners; "
                             "correct it.")
        if self.markers == "none":
            return
        px, places = self.markers.rest_px(self.pinhole), self.markers_mm()
        _refuse_outside(where, px, self.pinhole.sees(px), "px", f"image of {columns} x {rows} px")
        if spec.has_layers:
            along_x, along_y = spec.footprint_mm      # type: ignore[attr-defined]
            inside = (np.abs(places) <= [0.5 * along_x, 0.5 * along_y]).all(axis=1)
            _refuse_outside(where, places, inside, "mm", f"gel of {along_x:g} x {along_y:g} mm")

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Camera`. Raises InputError where markers lie outside the image or the gel, or the shading is of another image."""
        self.check_on(surface.spec)
        painter = painter_of(self, surface.spec.folder)
        images = np.stack([painter.image(relief) for relief in reliefs(surface)])
        return labelled(images, ("step", "y", "x", "channel"), units="grey levels",
                        coordinates={"channel": ["red", "green", "blue"]})


class Painter:
    """A camera with its shading, prepared for many images."""

    def __init__(self, camera: Camera, folder: Path) -> None:
        self.camera, self.pinhole = camera, camera.pinhole
        self.shading = _shading_of(camera, folder)
        self.table: ShadingTable | None = gel_image.tabulate(self.shading, self.pinhole)
        self.background = _background_of(camera, self.shading, folder)
        self.markers_mm = camera.markers_mm()

    def image(self, relief: Relief) -> np.ndarray:
        """(rows, columns, 3) uint8 of the surface at a load step."""
        step = gel_image.pixel_step(relief, self.pinhole)
        fields = gel_image.slopes_of(relief, self.pinhole.turn)
        if self.shading.lamps is not None:
            fields = np.concatenate([fields, dimming_of(relief, self.shading.lamps, fields, self.pinhole.turn)], axis=2)
        seen = gel_image.seen(relief, self.pinhole, fields, step=step)
        light = gel_image.light_past_markers(relief, self.pinhole, self.camera.markers, self.markers_mm)
        seen = seen if self.table is not None else gel_image.between(seen, self.pinhole, step)
        slopes, dimming = seen[..., :2], seen[..., 2:] if self.shading.lamps is not None else None
        if self.table is None:
            return gel_image.colours_by_formula(slopes, self.shading, self.background, light, dimming)
        return gel_image.colours_by_table(slopes, step, self.table, self.background, light, dimming)


@functools.lru_cache(maxsize=8)
def _painter(camera: Camera, folder: Path, stamps: tuple[Any, ...]) -> Painter:
    return Painter(camera, folder)


def painter_of(camera: Camera, folder: Path) -> Painter:
    """The `Painter` of a camera of a sensor's file in a folder, kept until a file that it names changes."""
    files = [folder / name for name in (camera.shading, camera.background) if name and (folder / name).is_file()]
    return _painter(camera, folder, tuple((file.resolve(), file.stat().st_mtime_ns, file.stat().st_size) for file in files))


def camera_of(spec: Specification, name: str) -> Camera:
    """The camera of a sensor's entry of that name. Raises InputError where there is none."""
    entries = spec.stated_readouts
    if name not in entries or entries[name].kind != "camera":
        raise InputError(f"{spec.name}, at 'readouts': there is no readout {name!r} of the kind camera; add one, or name it under "
                         "'camera'.")
    camera: Camera = make_readout(name, entries[name], where=spec.name)      # type: ignore[assignment]
    camera.check_on(spec)
    return camera


def _shading_of(camera, folder):
    file = folder / camera.shading
    shading = Shading.load(file if file.is_file() or file.suffix else camera.shading)     # only a plain name may be one that ships
    if tuple(shading.pixels) == camera.pixels:
        return shading
    try:
        return shading.scaled(camera.pixels)
    except InputError as error:
        raise InputError(f"shading {camera.shading}: {error}") from None


def _background_of(camera, shading, folder):
    """(rows, columns, 3) float32 grey levels of the untouched gel."""
    columns, rows = camera.pixels
    if camera.background is None:
        y, x = np.mgrid[:rows, :columns]
        return np.ascontiguousarray(np.clip(shading.background(x, y), 0, 255), dtype=np.float32)
    from softtact.imaging.markers import read_image

    image = read_image(folder / camera.background)
    if image.shape[:2] != (rows, columns):
        raise InputError(f"background {camera.background}: it has {image.shape[1]} x {image.shape[0]} px and the camera "
                         f"{columns} x {rows}; take it with this camera, or correct 'pixels'.")
    return np.ascontiguousarray(image, dtype=np.float32)


def _refuse_outside(where, places, inside, unit, what):
    """Refuse the first marker that is not inside, in a sentence."""
    if not inside.all():
        first = int(np.flatnonzero(~inside)[0])
        x, y = places[first]
        raise InputError(f"{where}: marker {first + 1} of {len(places)}, at ({x:.4g}, {y:.4g}) {unit}, lies outside the {what}; "
                         "correct the first marker, the pitch or the counts.")
