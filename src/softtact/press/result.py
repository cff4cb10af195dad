"""What a press gives: maps and numbers per load step, with names and units, and how they are kept in a file."""

from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.files import PROVENANCE, read_dataset, write_dataset
from softtact.press.placed_object import PlacedObject
from softtact.press.vtu import of_bodies, of_map

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from softtact.models.hyperelastic.deformed_mesh import PressedBody


def _array(units: str, *dimensions: str, coordinate: str | None = None) -> dict[str, Any]:
    """How a field of a result stands in a file: as an array with units ("1": a number), or as the coordinate of that name."""
    return {"units": units, "dimensions": dimensions, "coordinate": coordinate}


_FACT = {"fact": True}      # a field that stands in a file as an attribute


@dataclass(frozen=True)
class PressResult:
    """One press, load step by load step. A field is one line here: its metadata say how it is written and read back."""

    deformation_map_mm: np.ndarray = field(metadata=_array("mm", "step", "y", "x"))
    """(step, y, x) in mm: how far the sensing surface moved towards the board, positive."""
    tactile_map: np.ndarray = field(metadata=_array("counts", "step", "row", "column"))
    """(step, row, column) in counts: the taxels' ideal reading, or that of a calibrated sensor long after the press."""
    normal_force_n: np.ndarray = field(metadata=_array("N", "step"))
    """(step,) in N: how hard the object was pressed, positive into the sensor; pad and shell together."""
    indentation_mm: np.ndarray = field(metadata=_array("mm", "step"))
    """(step,) in mm: how far the object came down from where it just touches the sensing surface, whatever its pose's height;
    negative where the shell beside the pad keeps it from touching."""
    contact_area_mm2: np.ndarray = field(metadata=_array("mm2", "step"))
    """(step,) in mm2: area of the sensing surface that bears pressure."""
    penetration_mm: np.ndarray = field(metadata=_array("mm", "step"))
    """(step,) in mm: deepest overlap of object and surface that the solver left."""
    frustum_compression_mm: np.ndarray = field(metadata=_array("mm", "step"))
    """(step,) in mm: of the most compressed frustum; nan where the model has none."""
    residual_n: np.ndarray = field(metadata=_array("N", "step"))
    """(step,) in N: largest unbalanced nodal force; nan where the model does not tell."""
    extrapolated_volume_fraction: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) share of a layer's volume strained beyond the data its law was fitted to, the larger of the layers'; or nan."""
    iterations: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) iterations of the solver."""
    converged: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) 1 where the solver reached its tolerance."""
    within_validity: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) 0 where the numbers are not to be relied on; why: docs/reference/command_line.md, "What is flagged"."""
    wall_time_s: np.ndarray = field(metadata=_array("s", "step"))
    """(step,) in s: wall time of the load step; the solver's preparation counts to the first."""
    x_mm: np.ndarray = field(metadata=_array("mm", "x", coordinate="x"))
    """(x,) in mm: the map's columns in the sensor frame."""
    y_mm: np.ndarray = field(metadata=_array("mm", "y", coordinate="y"))
    """(y,) in mm: the map's rows in the sensor frame."""
    model: str = field(metadata=_FACT)
    """Which model pressed: elastic, foundation, hyperelastic, or solid where the object is soft."""
    sensor: str = field(metadata=_FACT)
    """The sensor's name."""
    solver: str = field(metadata=_FACT)
    """The linear solver's name."""
    pad_force_n: np.ndarray | None = field(default=None, metadata=_array("N", "step"))
    """(step,) in N: what of `normal_force_n` the pad carries."""
    shell_force_n: np.ndarray | None = field(default=None, metadata=_array("N", "step"))
    """(step,) in N: what the rigid shell around the pad carries, where an object wider than the pad rests on it; else 0."""
    force_n: np.ndarray | None = field(default=None, metadata=_array("N", "step", "axis"))
    """(step, 3) in N: the object's force on the sensor, pad and shell, along x, y, z; z is negative where it presses."""
    torque_nmm: np.ndarray | None = field(default=None, metadata=_array("N mm", "step", "axis"))
    """(step, 3) in N mm: the torque of that force about the origin of the sensor frame; nan where the model does not
    tell, and where the shell carries a part, whose place is not known."""
    displacement_mm: np.ndarray | None = field(default=None, metadata=_array("mm", "step", "y", "x", "axis"))
    """(step, y, x, 3) in mm: how the map's plane moved along x, y, z; nan in x and y where the model tells the map alone."""
    slip: np.ndarray | None = field(default=None, metadata=_array("mm", "step", "y", "x"))
    """(step, y, x) in mm: how far the surface slid along the object since it came to touch; nan where it does not touch, and where
    the model knows no friction."""
    expected_error_mm: np.ndarray | None = field(default=None, metadata=_array("mm", "step"))
    """(step,) in mm: error to expect against the hyperelastic model, root mean square over the map, of a fast model on frusta and
    where the model was chosen by it; else nan. How well it is told: docs/explanation/fast_models.md."""
    selection_reason: str = field(default="", metadata=_FACT)
    """What made the choice of the model, where it was not the user's."""
    largest_counts: float = field(default=2400.0, metadata=_FACT)
    """Counts at which the sensor's readout ends."""
    attributes: dict[str, Any] = field(default_factory=dict)
    """More facts (numbers and texts): thickness_mm, friction, repairs of the mesh. They are written as attributes, too."""
    bodies: "tuple[PressedBody, ...]" = ()
    """A `PressedBody` for each force where `Sensor.press` was asked to keep them, else none; not written with the maps."""

    placed_object: PlacedObject | None = None
    """The object where it stands at each load step, where `Sensor.press` was asked to keep it; it is written with the maps."""

    def __post_init__(self) -> None:
        steps, vertical = len(self.normal_force_n), np.array([0.0, 0.0, 1.0])
        unknown = np.where(vertical == 0, np.nan, 1.0)
        defaults = {"pad_force_n": lambda: self.normal_force_n, "shell_force_n": lambda: self.normal_force_n - self.pad_force_n,
                    "force_n": lambda: -self.normal_force_n[:, None] * vertical, "torque_nmm": lambda: np.full((steps, 3), np.nan),
                    "displacement_mm": lambda: -self.deformation_map_mm[..., None] * unknown,
                    "slip": lambda: np.full(self.deformation_map_mm.shape, np.nan),
                    "expected_error_mm": lambda: np.full(steps, np.nan)}
        for name, default in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default())

    def pressed_body(self, load_step: int = -1) -> "PressedBody":
        """The `PressedBody` at the load step of number `load_step`, by default the last one: nodes, cells and displacements."""
        if not self.bodies:
            raise InputError(f"This result of the {self.model} model keeps no body; press with model='hyperelastic', or a "
                             "soft object, and keep_body=True.")
        return self.bodies[load_step]

    def plot(self, path: str | Path | None = None, *, full_scale: bool = False) -> "Figure":
        """A matplotlib figure of maps and taxels at each load step; written to `path` (PNG or SVG) where one is given.

        full_scale: let the taxels' colours end at the readout's largest count; else at the largest one that is there
        """
        from softtact.press import plot

        figure = plot.draw(self, full_scale=full_scale)
        if path is not None:
            plot.save(figure, path)
        return figure

    def show(self, *, full_scale: bool = False) -> None:
        """Show `plot` in a window, or below a notebook's cell."""
        import matplotlib.pyplot as plt

        from softtact.press import plot

        plot.draw(self, full_scale=full_scale, figure=plt.figure())
        plt.show()

    def to_dataset(self) -> "xarray.Dataset":
        """The result as an xarray dataset with dimensions step, y, x, axis, row, column and the units of each array."""
        import xarray

        arrays: dict[str, Any] = {}
        coordinates: dict[str, Any] = {}
        for one in _arrays():
            kept = coordinates if one.metadata["coordinate"] else arrays
            kept[_name(one)] = (one.metadata["dimensions"], getattr(self, one.name), {"units": one.metadata["units"]})
        if self.placed_object is not None:
            arrays |= self.placed_object.variables()
        return xarray.Dataset(arrays, coords=coordinates, attrs={name: getattr(self, name) for name in _facts()} | self.attributes)

    def write(self, path: str | Path, *, settings: dict[str, Any] | None = None, seed: int | None = None) -> None:
        """Write as NetCDF; `read_press` reads it back.

        settings, seed: what the press came from, for the file's record of its provenance
        """
        write_dataset(path, self.to_dataset(), seed=seed, settings=settings or {})

    def write_vtu(self, path: str | Path) -> None:
        """Write the pressed sensor as VTU: the solver's mesh where it was kept, else the map's surface (see `pressed_mesh`)."""
        if self.bodies:
            mesh = of_bodies(self.bodies, self.normal_force_n)
        else:
            mesh = of_map(self.deformation_map_mm, self.x_mm, self.y_mm, self.normal_force_n,
                          thickness_mm=self.attributes["thickness_mm"])
        if self.placed_object is not None:
            mesh = mesh.with_object(self.placed_object)
        mesh.write(path)


def read_press(path: str | Path) -> PressResult:
    """The `PressResult` that `PressResult.write` wrote, to the bit; its bodies were not written and are none.

    Raises InputError that names the file where it is missing or damaged, or holds no press.
    """
    data = read_dataset(path)
    missing = [name for name in (*map(_name, _arrays()), *_facts()) if name not in data.variables and name not in data.attrs]
    if missing:
        raise InputError(f"{path}: it holds no whole press ({missing[0]!r} is missing); give a file that softtact press --out or "
                         "PressResult.write made.")
    for one in _arrays():
        if data[_name(one)].dims != one.metadata["dimensions"]:
            raise InputError(f"{path}: {_name(one)!r} has the dimensions {data[_name(one)].dims} in place of "
                             f"{one.metadata['dimensions']}; write the press again.")
    arrays: dict[str, Any] = {one.name: data[_name(one)].values for one in _arrays()}
    attributes = {name: value.item() if isinstance(value, np.generic) else value for name, value in data.attrs.items()}
    facts = {name: attributes.pop(name) for name in _facts()}
    attributes = {name: value for name, value in attributes.items() if name not in PROVENANCE}
    return PressResult(**arrays, **facts, attributes=attributes, placed_object=PlacedObject.of(data))


def _arrays() -> list[Field[Any]]:
    """The fields of a result that stand as arrays in a file."""
    return [one for one in fields(PressResult) if "dimensions" in one.metadata]


def _facts() -> list[str]:
    """Names of the fields that stand as attributes in a file."""
    return [one.name for one in fields(PressResult) if "fact" in one.metadata]


def _name(one: Field[Any]) -> str:
    """What an array is called in a file."""
    return one.metadata["coordinate"] or one.name
