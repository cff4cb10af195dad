"""Readouts: a sensor's measurements of its surface's motion. One file each, registered by its kind.

    @register("mean_depth")
    @dataclass(frozen=True)
    class MeanDepth:                                          # its fields are the keys of the entry in the sensor's file
        scale: float = 1.0

        def read(self, surface: SurfaceMotion) -> xarray.DataArray:
            return labelled(self.scale * surface.thinning_mm.mean(axis=(1, 2)), ("step",), units="mm")

A sensor's `readouts:` name them: {depth: {kind: mean_depth, scale: 2}}; `PressResult.readings["depth"]` holds its readings, and so
do files. A user's readout is registered when its module is imported before the sensor is loaded. A class of pydantic's, or a
dataclass, checks its fields; `read` raises InputError where the readout does not fit the sensor; it is called at rest when the
sensor is loaded.
"""

from collections import UserDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from softtact.errors import InputError
from softtact.sensors.base import ReadoutEntry, Specification, sentence
from softtact.unknown_names import first_fault, nearest

if TYPE_CHECKING:
    import xarray

    from softtact.imaging.pinhole import Pinhole

_KINDS: dict[str, type] = {}
_LATER: dict[str, Callable[[], object]] = {}     # functions that register a kind
_Class = TypeVar("_Class", bound=type)


@dataclass(frozen=True)
class Samples:
    """A field on a part of a surface, at points with areas."""

    points_mm: np.ndarray
    """(k, 3) at rest."""
    area_mm2: np.ndarray
    """(k,) at rest."""
    values: np.ndarray
    """(k,) or (k, 3) of the field."""


@dataclass(frozen=True)
class PlaneMotion:
    """The motion of a plane sensing surface at the points of its map, with contact. Frame: the sensor's, z out of the surface."""

    x_mm: np.ndarray
    """(nx,): columns of the map at rest."""
    y_mm: np.ndarray
    """(ny,): rows of the map at rest."""
    displacement_mm: np.ndarray
    """(step, ny, nx, 3): of the surface; z is negative where it is pressed down."""
    traction_mpa: np.ndarray
    """(step, ny, nx, 3): of the object on the surface, per area at rest; pressing down is negative in z."""
    slip: np.ndarray
    """(step, ny, nx) bool: which points touch, and slide on the object in this step."""
    gap_mm: np.ndarray
    """(step, ny, nx): along z to the object, whose underside is at displacement z + gap; 0 in contact up to the solver's tolerance,
    inf where no object is above."""

    @classmethod
    def at_rest(cls, x_mm: np.ndarray, y_mm: np.ndarray) -> "PlaneMotion":
        """One step without any object."""
        shape = (1, len(y_mm), len(x_mm))
        return cls(x_mm, y_mm, np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape, dtype=bool), np.full(shape, np.inf))


class SeenObject(Protocol):
    """A rigid object at each step of a press."""

    def depths_mm(self, pinhole: "Pinhole", *, deepest_mm: float) -> np.ndarray:
        """(step, row, column): its depth below the surface at rest that a camera sees, 0 to the deepest."""


@dataclass(frozen=True)
class SurfaceMotion:
    """The motion of a sensing surface in a press: the input of readouts at each load step."""

    spec: Specification
    """Of the sensor."""
    steps: int
    """Number of load steps."""
    displacement: Callable[[str | None], list[Samples]]
    """Of a face by its name, or of the sensing surface: its displacement in mm at each step; nan along x and y where a model gives
    the map alone."""
    pressure: Callable[[str | None], list[Samples] | None]
    """Of a face or the sensing surface: contact pressure in MPa per area at rest, positive in compression, at each step; None where
    it is not known."""
    gap: Callable[[str | None], list[Samples] | None] = lambda face: None
    """Of a face or the sensing surface: gap in mm between it and the object along the normal, negative in penetration."""
    thinning_mm: np.ndarray | None = None
    """(step, y, x): decrease of the layers' thickness in mm at the points of the sensor's map; None without layers."""
    plane: PlaneMotion | None = None
    """Displacement, traction, slip and gap at the points of the map, where the surface is plane and the model gives them: at rest,
    and in the elastic model's presses with a motion."""
    object: "SeenObject | None" = None
    """The rigid object, where the model tells where it is."""


class Readout(Protocol):
    """A measurement of the motion of a sensor's surface."""

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """Labelled readings, `step` their first dimension, with their `units` as an attribute or as a coordinate."""


def register(kind: str) -> Callable[[_Class], _Class]:
    """Class decorator: register a readout under the kind that sensors' files name; a user's stays before the package's own."""
    def add(cls: _Class) -> _Class:
        if kind not in _KINDS or not cls.__module__.startswith("softtact."):     # the package's may be loaded later
            _KINDS[kind] = cls
        return cls

    return add


def register_later(kind: str, load: Callable[[], object]) -> None:
    """Let `load`, which registers a kind, be called when a sensor first names it: a camera's modules take a tenth of a second."""
    _LATER[kind] = load


def make_readout(name: str, entry: ReadoutEntry, *, where: str = "sensor") -> Readout:
    """The readout of an entry of a sensor's file. Raises InputError that names the field: an unknown kind, a key that it lacks."""
    place = f"{where}, at 'readouts.{name}'"
    if entry.kind not in _KINDS and entry.kind in _LATER:
        _LATER[entry.kind]()
    if entry.kind not in _KINDS:
        known = sorted({*_KINDS, *_LATER})
        raise InputError(f"{place}: there is no kind {entry.kind!r}{nearest(entry.kind, known)}; use one of {', '.join(known)}.")
    cls, given = _KINDS[entry.kind], dict(entry.model_extra or {})
    try:
        return cls(**given)
    except ValidationError as error:
        fault = first_fault(error)
        raise InputError(sentence(cls, fault, place) if issubclass(cls, BaseModel) else f"{place}: {fault['msg']}.") from None  # type: ignore[arg-type]
    except TypeError as error:
        raise InputError(f"{place}: {str(error).removeprefix(f'{cls.__name__}.__init__() ')}; correct its keys.") from None


class Unlabelled(NamedTuple):
    """Readings without xarray, which takes half a second to load; the arguments of `labelled`."""

    values: np.ndarray
    dimensions: tuple[str, ...]
    units: str


class Readings(UserDict[str, Any]):
    """{name: labelled readings}, some of which get their labels when they are first asked for."""

    def __getitem__(self, name: str) -> "xarray.DataArray":
        if isinstance(self.data[name], Unlabelled):
            values, dimensions, units = self.data[name]
            self.data[name] = labelled(values, dimensions, units=units)
        found: xarray.DataArray = self.data[name]
        return found

    def array(self, name: str) -> np.ndarray:
        """The values without their labels."""
        values: np.ndarray = self.data[name].values
        return values


def readings_of(readouts: Mapping[str, Readout], surface: SurfaceMotion) -> Readings:
    """The readings of the readouts; a readout whose class has `unlabelled` is asked for that."""
    return Readings({name: getattr(readout, "unlabelled", readout.read)(surface) for name, readout in readouts.items()})


def labelled(values: np.ndarray, dimensions: Sequence[str], *, units: str | None = None,
             coordinates: Mapping[str, Any] | None = None) -> "xarray.DataArray":
    """Readings with names for their dimensions; units: of all of them, where they are not a coordinate."""
    import xarray

    return xarray.DataArray(values, dims=tuple(dimensions), coords=dict(coordinates or {}),
                            attrs={} if units is None else {"units": units})
