"""What a press gives: maps and numbers per load step, with names and units."""

from dataclasses import dataclass, field

import numpy as np

from softtact.errors import InputError
from softtact.files import write_dataset
from softtact.press.vtu import of_bodies, of_map


@dataclass(frozen=True)
class PressResult:
    """One press through a list of forces.

    deformation_map_mm (force, y, x): towards the PCB, positive;  tactile_map (force, row, column): ideal counts
    force_n, indentation_mm, contact_area_mm2, penetration_mm, wall_time_s, iterations, converged, within_validity (force,)
    frustum_compression_mm (force,): of the most compressed frustum;  residual_n (force,): largest unbalanced nodal force
    extrapolated_volume_fraction (force,): share of a layer's volume strained beyond the data its law was fitted to, the larger of
    the layers'
    within_validity: 0 where the numbers are not to be relied on, and why: docs/reference/command_line.md, "What is flagged"
    expected_error_mm (force,): root mean square over the map, against the hyperelastic model, where the model was chosen by it
    The last four are nan where the model, the law or the policy does not tell.
    why: what made the choice of the model, where it was not the user's
    largest_counts: where the sensor's readout ends
    x_mm (x,), y_mm (y,): the map's grid;  model;  solver: the linear solver's name
    bodies: a `PressedBody` for each force where `Sensor.press` was asked to keep them, else none; not written with the maps
    """

    deformation_map_mm: np.ndarray
    tactile_map: np.ndarray
    force_n: np.ndarray
    indentation_mm: np.ndarray
    contact_area_mm2: np.ndarray
    penetration_mm: np.ndarray
    frustum_compression_mm: np.ndarray
    residual_n: np.ndarray
    extrapolated_volume_fraction: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray
    within_validity: np.ndarray
    wall_time_s: np.ndarray
    x_mm: np.ndarray
    y_mm: np.ndarray
    model: str
    sensor: str
    solver: str
    expected_error_mm: np.ndarray | None = None
    selection_reason: str = ""
    largest_counts: float = 2400.0
    attributes: dict = field(default_factory=dict)
    bodies: tuple = ()

    def __post_init__(self):
        if self.expected_error_mm is None:
            object.__setattr__(self, "expected_error_mm", np.full(len(self.force_n), np.nan))

    _PER_FORCE = ("indentation_mm", "contact_area_mm2", "penetration_mm", "frustum_compression_mm", "residual_n",
                  "extrapolated_volume_fraction", "expected_error_mm", "iterations", "converged", "within_validity", "wall_time_s")

    def pressed_body(self, load_step=-1):
        """The `PressedBody` at the force of number `load_step`, by default the last one: nodes, cells and displacements."""
        if not self.bodies:
            raise InputError(f"This result of the {self.model} model keeps no body; press with model='hyperelastic' and "
                             "keep_body=True.")
        return self.bodies[load_step]

    def to_dataset(self):
        """The result as an xarray dataset with dimensions force, y, x, row, column."""
        import xarray

        variables = {name: ("force", getattr(self, name)) for name in self._PER_FORCE}
        variables["deformation_map_mm"] = (("force", "y", "x"), self.deformation_map_mm, {"units": "mm"})
        variables["tactile_map"] = (("force", "row", "column"), self.tactile_map, {"units": "counts"})
        variables["force_n"] = ("force", self.force_n, {"units": "N"})
        attributes = {"model": self.model, "sensor": self.sensor, "solver": self.solver, "selection_reason": self.selection_reason,
                      **self.attributes}
        return xarray.Dataset(variables, coords={"x": self.x_mm, "y": self.y_mm}, attrs=attributes)

    def write(self, path, *, settings=None, seed=None):
        """Write as NetCDF."""
        write_dataset(path, self.to_dataset(), seed=seed, settings=settings or {})

    def write_vtu(self, path):
        """Write the pressed sensor as VTU: the solver's mesh where it was kept, else the map's surface (see `pressed_mesh`)."""
        if self.bodies:
            mesh = of_bodies(self.bodies, self.force_n)
        else:
            mesh = of_map(self.deformation_map_mm, self.x_mm, self.y_mm, self.force_n, thickness_mm=self.attributes["thickness_mm"])
        mesh.write(path)
