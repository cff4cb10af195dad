"""The result of a press, for all sensors and models: numbers per load step, maps of the surface, fields of the bodies, readings.

`PressResult.write` stores it as NetCDF, `read_press` reads it back; `write_vtu` is for ParaView, `plot` draws it.
Files hold arrays by the names of the fields of `PressResult`, with their units. `tactile_map` is the reading `taxels`; any other is
called `reading_NAME`, and its dimensions and coordinates end in `_of_NAME`. The mesh of solids is `node_mm`, `cells_K` and
`facets_K`; their nodes' displacement is `node_displacement_mm`, other fields of `SolidFields` have its names.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.files import PROVENANCE, read_arrays, read_dataset, write_dataset
from softtact.inputs import in_one_sentence
from softtact.models.solid.result import SolidFields
from softtact.press.objects import Origin, PlacedObject
from softtact.readout.points import labelled_points
from softtact.readout.registry import Readings, labelled

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from softtact.models.hyperelastic.deformed_mesh import PressedBody
    from softtact.press.gradient import Gradient


_ABSENT: Any = None      # a field that a sensor or a model does not have
_LATER = {"later": True}     # a field that files of earlier versions do not hold
_PLANE = {"plane": True}     # a field of sensors with a plane of maps
_STUCK_MM = 1e-9     # of a path along the object: what rounding leaves


def _array(units: str, *dimensions: str, coordinate: str | None = None) -> dict[str, Any]:
    """Metadata of a field that files hold as an array with units ("1": a number), or as the coordinate of that name."""
    return {"units": units, "dimensions": dimensions, "coordinate": coordinate}


_FACT = {"fact": True}      # a field that files hold as an attribute
_WALL_TIME = "wall_time_s"     # in files an attribute, which no comparison of results counts


@dataclass(frozen=True, kw_only=True)
class PressResult:
    """One press, load step by load step. A field is one line here: its metadata say how it is written and read back.

    Maps are None where the sensor has no plane of maps; `solid` is None where the press had no solids or did not keep them. The
    fields of `solid` are attributes of the result, too: `result.volume_ratio`.
    """

    deformation_map_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "step", "y", "x") | _PLANE)
    """(step, y, x) in mm: how far the sensing surface moved towards the board, positive."""
    thinning_map_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "step", "y", "x") | _PLANE | _LATER)
    """(step, y, x) in mm: how much thinner the layer is, as its taxels read it; `counts_of` of it gives the counts of the press.
    Of the elastic model each point reads its surroundings, which differ from the map beside edges and thin walls; the lower side
    may move, too. Elsewhere it is the deformation map, and files then hold that one alone."""
    readings: "Mapping[str, xarray.DataArray]" = field(default_factory=Readings)
    """What each of the sensor's readouts reads, by their names in its file; `step` is the first dimension. `taxels`: (step, row,
    column) in counts, the ideal reading, or that of a calibrated sensor long after the press."""
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
    """(step,) in N: largest unbalanced nodal force; nan where the model does not give it."""
    extrapolated_volume_fraction: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) share of a layer's volume strained beyond the data its law was fitted to, the larger of the layers'; or nan."""
    least_volume_ratio: np.ndarray | None = field(default=None, metadata=_array("1", "step") | _LATER)
    """(step,) of the hyperelastic model: least deformed over undeformed volume of the cover, over the integration points and
    corners of its elements; 0 or less where one is folded under an edge. None of other models."""
    edge_radius_mm: np.ndarray | None = field(default=None, metadata=_array("mm", "step") | _LATER)
    """(step,) in mm of the hyperelastic model: by how much the object's edges were rounded, because the cover would have folded
    under them; 0 where they are as sharp as the object's mesh. Where they are rounded, the cover may have several balances under
    corners, of which a press finds one. None of other models."""
    iterations: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) iterations of the solver."""
    converged: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) 1 where the solver reached its tolerance."""
    within_validity: np.ndarray = field(metadata=_array("1", "step"))
    """(step,) 0 where the numbers are not to be relied on, for the `validity_reason`."""
    time_s: np.ndarray | None = field(default=None, metadata=_array("s", "step") | _LATER)
    """(step,) in s: from the start of the motion to the step's end; None where its steps have no durations."""
    wall_time_s: np.ndarray
    """(step,) in s: wall time of the load step; the solver's preparation counts to the first. Files hold it as an attribute, since
    two runs of one press differ in it alone."""
    x_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "x", coordinate="x") | _PLANE)
    """(x,) in mm: the map's columns in the sensor frame."""
    y_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "y", coordinate="y") | _PLANE)
    """(y,) in mm: the map's rows in the sensor frame."""
    model: str = field(metadata=_FACT)
    """The model of the press: elastic, foundation, hyperelastic or solid."""
    sensor: str = field(metadata=_FACT)
    """The sensor's name."""
    solver: str = field(metadata=_FACT)
    """The linear solver's name."""
    pad_force_n: np.ndarray = field(default=_ABSENT, metadata=_array("N", "step"))
    """(step,) in N: the part of `normal_force_n` that the pad carries."""
    shell_force_n: np.ndarray = field(default=_ABSENT, metadata=_array("N", "step"))
    """(step,) in N: the part that the rigid shell around the pad carries, under an object wider than the pad; else 0."""
    force_n: np.ndarray = field(default=_ABSENT, metadata=_array("N", "step", "axis"))
    """(step, 3) in N: the object's force on the sensor, pad and shell, along x, y, z; z is negative where it presses."""
    torque_nmm: np.ndarray = field(default=_ABSENT, metadata=_array("N mm", "step", "axis"))
    """(step, 3) in N mm: the torque of that force about the origin of the sensor frame; nan where the model does not
    give it, and where the shell carries a part, as the position of that force is not known."""
    displacement_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "step", "y", "x", "axis") | _PLANE)
    """(step, y, x, 3) in mm: how the map's plane moved along x, y, z; nan in x and y where the model gives the map alone.
    Of a sensor without a plane `solid.displacement_mm` (step, node, 3)."""
    traction_mpa: np.ndarray = field(default=_ABSENT, metadata=_array("MPa", "step", "y", "x", "axis") | _PLANE | _LATER)
    """(step, y, x, 3) in MPa: the object's force on the sensing surface per area at rest, along x, y, z; z is negative where it
    presses. Of the elastic model's presses with a motion, of gels with a camera, and of the solid model; else nan."""
    slip: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "step", "y", "x") | _PLANE)
    """(step, y, x) in mm: how far the surface slid along the object since it last came to touch; nan where it does not touch,
    and where the model has no friction."""
    expected_error_mm: np.ndarray = field(default=_ABSENT, metadata=_array("mm", "step"))
    """(step,) in mm: expected error against the hyperelastic model, root mean square over the map, for a fast model on frusta and
    where the model was chosen by it; else nan. Its accuracy: docs/explanation/fast_models.md."""
    hyperelastic_counts: np.ndarray = field(default=_ABSENT, metadata=_array("counts", "step", "bound") | _LATER)
    """(step, 3) in counts of all taxels: what the hyperelastic model is expected to read in place of a fast model, least, middle
    and most, for nine in ten presses; else nan. See `expected_error_counts`."""
    validity_reason: np.ndarray = field(default=_ABSENT, metadata=_array("text", "step") | _LATER)
    """(step,) texts: why `within_validity` is 0, several reasons joined by "; "; empty where it is 1, and in files of earlier
    versions. The rules: docs/reference/command_line.md, "What is flagged"."""
    selection_reason: str = field(default="", metadata=_FACT)
    """The reason for the choice of the model, if the user did not name it."""
    largest_counts: float = field(default=2400.0, metadata=_FACT)
    """Largest counts of the sensor's readout."""
    attributes: dict[str, Any] = field(default_factory=dict)
    """More facts (numbers and texts): thickness_mm, friction, repairs of the mesh. They are written as attributes, too."""
    bodies: "tuple[PressedBody, ...]" = ()
    """A `PressedBody` of the layers for each step where `Sensor.press` was asked to keep them, else none; not written with the
    maps."""
    solid: SolidFields | None = None
    """Fields of the solids, of a press by the solid model: mesh, nodal displacement, stress, contact pressure, loads of frames."""
    placed_object: PlacedObject | None = None
    """The object where it is at each load step, where `Sensor.press` was asked to keep it; it is written with the maps."""
    origin: Origin | None = field(default=None, repr=False, compare=False)
    """The sensor and the object of a press by forces, for `gradient`; neither written with the maps nor sent to other processes."""

    def __post_init__(self) -> None:
        if not isinstance(self.readings, Readings):
            object.__setattr__(self, "readings", Readings(self.readings))
        steps, down = len(self.normal_force_n), np.array([0.0, 0.0, 1.0])
        defaults: dict[str, Callable[[], np.ndarray]] = {
            "pad_force_n": lambda: self.normal_force_n, "shell_force_n": lambda: self.normal_force_n - self.pad_force_n,
            "force_n": lambda: 0.0 - self.normal_force_n[:, None] * down, "torque_nmm": lambda: np.full((steps, 3), np.nan),
            "expected_error_mm": lambda: np.full(steps, np.nan), "hyperelastic_counts": lambda: np.full((steps, 3), np.nan),
            "validity_reason": lambda: np.full(steps, "", dtype=str)}
        if self.deformation_map_mm is not None:
            unknown = np.where(down == 0, np.nan, 1.0)
            defaults |= {"displacement_mm": lambda: -self.deformation_map_mm[..., None] * unknown,
                         "thinning_map_mm": lambda: self.deformation_map_mm,
                         "traction_mpa": lambda: np.full((*self.deformation_map_mm.shape, 3), np.nan),
                         "slip": lambda: np.full(self.deformation_map_mm.shape, np.nan)}
        elif self.solid is not None:
            defaults["displacement_mm"] = lambda: self.solid.displacement_mm
        for name, default in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default())

    def __getattr__(self, name: str) -> Any:
        solid = self.__dict__.get("solid")
        if name in _OF_POINTS and "readings" in self.__dict__:     # names of version 0.1
            return _OF_POINTS[name](self)
        if solid is None or name.startswith("_") or not hasattr(solid, name):
            raise AttributeError(f"this {type(self).__name__} has no {name!r}")
        return getattr(solid, name)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"origin": None}      # whose sensor holds hundreds of megabytes

    @property
    def steps(self) -> int:
        """Number of load steps."""
        return len(self.normal_force_n)

    @property
    def tactile_map(self) -> np.ndarray:
        """(step, row, column) in counts: `readings["taxels"]`. Raises InputError where the sensor has no taxels."""
        if "taxels" not in self.readings:
            raise InputError(f"{self.sensor} has no readout 'taxels'; its readings are {', '.join(self.readings) or 'none'}.")
        return cast(Readings, self.readings).array("taxels")

    @property
    def slipping_share(self) -> np.ndarray:
        """(step,) share of the points of the map in contact that slid along the object in the step; nan where nothing touches, or
        the model has no friction."""
        if self.deformation_map_mm is None:
            return np.full(self.steps, np.nan)
        touching = np.isfinite(self.slip)
        before = np.concatenate([np.zeros((1, *self.slip.shape[1:])), np.nan_to_num(self.slip[:-1])])
        slid, count = (touching & (self.slip - before > _STUCK_MM)).sum(axis=(1, 2)), touching.sum(axis=(1, 2))
        return np.where(count > 0, slid / np.maximum(count, 1), np.nan)

    @property
    def taxels_at_range_end(self) -> np.ndarray:
        """(step,) how many taxels read `largest_counts`, where the converter ends: what they feel is more than they read."""
        return (self.tactile_map >= self.largest_counts).sum(axis=(1, 2))

    @property
    def expected_error_counts(self) -> np.ndarray:
        """(step,) in counts of all taxels: how much more a fast model is expected to read than the hyperelastic one; else nan."""
        if "taxels" not in self.readings:
            return np.full(self.steps, np.nan)
        return self.tactile_map.sum(axis=(1, 2)) - self.hyperelastic_counts[:, 1]

    def load(self, frame: str) -> np.ndarray:
        """Loads (s, 6) in N and N mm of a frame of the solids by its name, such as `object`."""
        if self.solid is None:
            raise InputError(f"This result of the {self.model} model keeps no frames; see force_n and torque_nmm, or press with "
                             "model='solid' and keep_body=True.")
        return self.solid.load(frame)

    def pressed_body(self, load_step: int = -1) -> "PressedBody":
        """The `PressedBody` at the load step of number `load_step`, by default the last one: nodes, cells and displacements."""
        if not self.bodies:
            raise InputError(f"This result of the {self.model} model keeps no body; press with model='hyperelastic', or a "
                             "soft object, and keep_body=True.")
        return self.bodies[load_step]

    def gradient(self, of: str = "tactile_map", by: str | Sequence[str] = ("pose", "force")) -> "Gradient":
        """Derivatives of the settled contact: a `Gradient` of `of` by each parameter of `by`, at each load step.

        of: tactile_map, deformation_map or depth (`indentation_mm`)
        by: pose (x, y in mm and rx, ry, rz in degrees, as in `Pose.from_values`) or one of these five; force (N); young (MPa of the
        elastic layer, or a common factor of the foundation model's moduli); thickness (mm, of the cover or the only layer)
        Of presses by force with the elastic or the foundation model; accuracy: docs/how-to/find_a_pose_from_taxels.md. Raises
        InputError for others, where the object touches nothing or rests on the shell, and for unknown names.
        """
        from softtact.press import gradient

        return gradient.gradient(self, of, by)

    def plot(self, path: str | Path | None = None, *, full_scale: bool = False) -> "Figure":
        """A matplotlib figure of maps and taxels at each load step; written to `path` (PNG or SVG) where one is given.

        full_scale: the taxels' colours end at the readout's largest count; else at the largest count of the press
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
        """The result as an xarray dataset with dimensions step, y, x, axis, row, column, node ... and the units of each array."""
        return _dataset_of(self)

    def write(self, path: str | Path, *, settings: dict[str, Any] | None = None, seed: int | None = None) -> None:
        """Write as NetCDF (.nc); `read_press` reads it back.

        settings, seed: of the press, for the file's record of its provenance
        """
        if Path(path).suffix.lower() != ".nc":
            raise InputError(f"{path}: a result is written as .nc; give a name with such an ending.")
        write_dataset(path, self.to_dataset(), seed=seed, settings=settings or {})

    def write_vtu(self, path: str | Path) -> None:
        """Write the pressed sensor as VTU: the solver's mesh where it was kept, else the map's surface (see `press.vtu`)."""
        from softtact.press import vtu

        vtu.write(self, path)


# Names of version 0.1 for the readout `points`, on sensors of kind solid.
_OF_POINTS: dict[str, Callable[[PressResult], np.ndarray]] = {
    "reading_points_mm": lambda result: np.zeros((0, 3)) if "points" not in result.readings else np.column_stack(
        [result.readings["points"][f"{axis}_mm"].values for axis in "xyz"]),
    "reading_displacement_mm": lambda result: np.zeros((result.steps, 0, 3)) if "points" not in result.readings else (
        result.readings["points"].values[..., 1:]),
    "reading_pressure_mpa": lambda result: np.zeros((result.steps, 0)) if "points" not in result.readings else (
        result.readings["points"].values[..., 0])}


_TAXELS, _DIMENSIONS_OF_TAXELS = "taxels", ("step", "row", "column")
_IN_FILE = {"displacement_mm": "node_displacement_mm"}      # fields of `SolidFields` with another name in files
_OLD_KIND = "softtact solid result"     # of files of solids of version 0.1


def _arrays(of: type = PressResult) -> list[Field[Any]]:
    """The fields of a result, or of `SolidFields`, that files hold as arrays."""
    return [one for one in fields(of) if "dimensions" in one.metadata]


def _facts() -> list[str]:
    """Names of the fields that files hold as attributes."""
    return [one.name for one in fields(PressResult) if "fact" in one.metadata]


def _name(one: Field[Any]) -> str:
    """Name of an array in a file."""
    return one.metadata["coordinate"] or one.name


def _dataset_of(result: PressResult) -> "xarray.Dataset":
    """The data set of a result."""
    import xarray

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    plane = result.deformation_map_mm is not None
    for one in _arrays():
        if getattr(result, one.name) is None or ("plane" in one.metadata and not plane):
            continue
        if one.name == "thinning_map_mm" and np.array_equal(result.thinning_map_mm, result.deformation_map_mm):
            continue
        kept = coordinates if one.metadata["coordinate"] else variables
        kept[_name(one)] = (one.metadata["dimensions"], getattr(result, one.name), {"units": one.metadata["units"]})
        if one.name == "deformation_map_mm" and _is_tactile_map(result):
            variables["tactile_map"] = (_DIMENSIONS_OF_TAXELS, result.tactile_map, {"units": "counts"})
    if result.placed_object is not None:
        variables |= result.placed_object.variables()
    attributes = {name: getattr(result, name) for name in (*_facts(), _WALL_TIME)} | result.attributes
    if result.solid is not None:
        variables |= _of_solid(result.solid)
        coordinates |= {"frame": np.array(result.solid.frames, dtype=str), "pair": np.array(result.solid.pairs, dtype=str),
                        "load": ["fx", "fy", "fz", "mx", "my", "mz"], "xyz": ["x", "y", "z"]}
        attributes |= {"geometry": result.solid.mesh.geometry, "mesh_thickness_mm": result.solid.mesh.thickness_mm}
    data = xarray.Dataset(variables, coords=coordinates, attrs=attributes)
    for name, reading in result.readings.items():
        if not (name == _TAXELS and "tactile_map" in variables):
            data = data.merge({f"reading_{name}": _with_separate_dimensions(name, reading)})
    return data


def _is_tactile_map(result):
    return _TAXELS in result.readings and result.readings[_TAXELS].dims == _DIMENSIONS_OF_TAXELS


def _with_separate_dimensions(name, reading):
    """A reading with unique names of its coordinates and of its dimensions except `step`."""
    names = {one: f"{one}_of_{name}" for one in (*reading.dims, *reading.coords) if one != "step"}
    return reading.rename(names).assign_attrs(reading=name)


def _of_solid(solid):
    """Variables of the fields of solids."""
    variables: dict[str, Any] = {
        _IN_FILE.get(one.name, one.name): (one.metadata["dimensions"], getattr(solid, one.name), {"units": one.metadata["units"]})
        for one in _arrays(SolidFields)}
    variables["node_mm"] = (("node", "xyz"), solid.mesh.points, {"units": "mm"})
    for k, (region, kind, nodes) in enumerate(solid.mesh.cells):
        variables[f"cells_{k}"] = ((f"element_{k}", f"node_of_{kind}"), nodes, {"region": region, "kind": kind})
    facets = ((name, kind, nodes) for name, face in solid.mesh.faces.items() for kind, nodes in face.items())
    for k, (name, kind, nodes) in enumerate(facets):
        variables[f"facets_{k}"] = ((f"facet_{k}", f"node_of_{kind}"), nodes, {"face": name, "kind": kind})
    return variables


def read_press(path: str | Path) -> PressResult:
    """The `PressResult` that `PressResult.write` wrote, to the bit; `bodies` were not written and are none.

    Files of version 0.1 are read, too: of sensors of layers, and of solids (.nc, .npz). Raises InputError that names the file where
    it is missing or damaged, or holds no press.
    """
    data = _read_npz(path) if Path(path).suffix.lower() == ".npz" else read_dataset(path)
    with in_one_sentence(path, "it holds no whole press", "give a file that softtact press --out or PressResult.write made"):
        return _press_of(path, data)


def _press_of(path, data):
    """The `PressResult` of a file's data set."""
    if data.attrs.get("kind") == _OLD_KIND:
        data = _renewed(path, data)
    elif "kind" in data.attrs and "deformation_map_mm" not in data:
        raise InputError(f"{path}: it holds no whole press; give a file that softtact press --out or PressResult.write made.")
    held = [one for one in _arrays() if "later" not in one.metadata or _name(one) in data]
    needed = [one for one in held if "plane" not in one.metadata or "deformation_map_mm" in data or "node_mm" not in data]
    missing = [name for name in (*map(_name, needed), *_facts()) if name not in data.variables and name not in data.attrs]
    if missing:
        raise InputError(f"{path}: it holds no whole press ({missing[0]!r} is missing); give a file that softtact press --out or "
                         "PressResult.write made.")
    for one in needed:
        if data[_name(one)].dims != one.metadata["dimensions"]:
            raise InputError(f"{path}: {_name(one)!r} has the dimensions {data[_name(one)].dims} in place of "
                             f"{one.metadata['dimensions']}; write the press again.")
    values: dict[str, Any] = {one.name: data[_name(one)].values for one in needed}
    values |= {name: value.astype(str) for name, value in values.items() if value.dtype == object}     # texts
    attributes = {name: value.item() if isinstance(value, np.generic) else value for name, value in data.attrs.items()}
    attributes.pop(_WALL_TIME, None)
    values |= {_WALL_TIME: wall_time_s(data)} | {name: attributes.pop(name) for name in _facts()}
    geometry, thickness = attributes.pop("geometry", "solid"), attributes.pop("mesh_thickness_mm", 1.0)
    attributes = {name: value for name, value in attributes.items() if name not in PROVENANCE}
    return PressResult(**values, readings=_readings_of(data), attributes=attributes, placed_object=PlacedObject.of(data),
                       solid=_solid_of(data, geometry, thickness) if "node_mm" in data else None)


def wall_time_s(data: "xarray.Dataset") -> np.ndarray:
    """Wall time (step,) in s of the load steps of a press' data set: its attribute, or the variable of older files; else nan."""
    if _WALL_TIME in data:
        return np.asarray(data[_WALL_TIME].values)
    return np.atleast_1d(data.attrs.get(_WALL_TIME, np.full(data.sizes["step"], np.nan)))


def _readings_of(data):
    readings = {}
    if "tactile_map" in data:
        readings[_TAXELS] = labelled(data["tactile_map"].values, _DIMENSIONS_OF_TAXELS, units="counts")
    for name in (str(name) for name in data.data_vars if str(name).startswith("reading_")):
        reading, end = data[name], f"_of_{data[name].attrs.get('reading')}"
        names = {one: str(one).removesuffix(end) for one in (*reading.dims, *reading.coords) if str(one).endswith(end)}
        reading = reading.rename(names).rename(None)
        readings[reading.attrs.pop("reading")] = reading
    return readings


def _solid_of(data, geometry, thickness):
    cells = [data[name] for name in data.data_vars if str(name).startswith("cells_")]
    faces: dict[str, dict[str, np.ndarray]] = {}
    for facets in (data[name] for name in data.data_vars if str(name).startswith("facets_")):
        faces.setdefault(facets.attrs["face"], {})[facets.attrs["kind"]] = facets.values
    mesh = SolidMesh(data["node_mm"].values, tuple((one.attrs["region"], one.attrs["kind"], one.values) for one in cells), faces,
                     geometry, float(thickness))
    return SolidFields(mesh=mesh, frames=tuple(map(str, data["frame"].values)), pairs=tuple(map(str, data["pair"].values)),
                       **{one.name: _stored(data, one) for one in _arrays(SolidFields)})


def _stored(data, one):
    """A field of solids in a file; nan in one of an earlier version that does not hold it."""
    name = _IN_FILE.get(one.name, one.name)
    if name not in data and one.metadata["later"]:
        return np.full([3 if dimension == "xyz" else data.sizes[dimension] for dimension in one.metadata["dimensions"]], np.nan)
    return data[name].values


# --- files of solids of version 0.1 ---


def _renewed(path, data):
    """The data set of an old file of solids with the names and numbers of today's results; missing numbers are nan."""
    missing = [one.name for one in _arrays(SolidFields) if one.name not in data.variables and not one.metadata["later"]]
    if missing:
        raise InputError(f"{path}: it holds no whole press ({missing[0]!r} is missing); press again.")
    steps, frames = data.sizes["step"], [str(name) for name in data["frame"].values]
    place = frames.index("object") if "object" in frames else 0
    force = data["frame_load"].values[:, place, :3] if frames else np.full((steps, 3), np.nan)
    down = -data["frame_way_mm"].values[:, place, 2] if frames else np.full(steps, np.nan)
    unknown = np.full(steps, np.nan)
    numbers = {"normal_force_n": -force[:, 2], "pad_force_n": -force[:, 2], "shell_force_n": np.zeros(steps),
               "indentation_mm": down, "contact_area_mm2": unknown, "frustum_compression_mm": unknown, "expected_error_mm": unknown,
               "converged": np.ones(steps, np.int8), "within_validity": np.ones(steps, np.int8)}
    points = {f"reading_{name}": data[f"reading_{name}"].values for name in ("points_mm", "displacement_mm", "pressure_mpa")}
    renewed = data.drop_vars([*points, "step"], errors="ignore").rename(_IN_FILE)
    renewed = renewed.assign({name: ("step", values) for name, values in numbers.items()})
    renewed = renewed.assign(force_n=(("step", "axis"), force), torque_nmm=(("step", "axis"), np.full((steps, 3), np.nan)))
    attributes = {"model": "solid", "sensor": "", "solver": "", "selection_reason": "", "largest_counts": 2400.0} | data.attrs
    attributes["mesh_thickness_mm"] = attributes.pop("thickness_mm")
    renewed.attrs = {name: value for name, value in attributes.items() if name != "kind"}
    if len(points["reading_points_mm"]):
        values = np.concatenate([points["reading_pressure_mpa"][..., None], points["reading_displacement_mm"]], axis=2)
        reading = labelled_points(values, points["reading_points_mm"])
        renewed = renewed.merge({"reading_points": _with_separate_dimensions("points", reading)}, combine_attrs="override")
    return renewed


def _read_npz(path):
    import xarray

    with read_arrays(path) as data:
        if "layout" not in data:
            raise InputError(f"{path}: it holds no layout, so it is no press of solids; give a file that PressResult.write wrote.")
        layout = json.loads(str(data["layout"]))
        variables = {name: (one["dims"], data[name], one["attributes"]) for name, one in layout["arrays"].items()}
    coordinates = {name: variables.pop(name) for name in layout["coordinates"]}
    return xarray.Dataset(variables, coordinates, layout["attributes"])
