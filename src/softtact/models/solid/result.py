"""What a press of solids gives: labelled arrays of all load steps, kept in files of their own.

    result = solid_result(SolidPath(body, {"ball": motion}))
    result.write("press.nc")
    result.write_vtu("press.vtu")
    result = read_solid_result("press.nc")
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import ConvergenceError, InputError
from softtact.fem.mesh_files import write_mesh
from softtact.fem.solid_mesh import SolidMesh
from softtact.models.solid import result_files
from softtact.models.solid.body import SolidBody
from softtact.models.solid.fields import nodal_fields, pressure_at_nodes
from softtact.models.solid.path import SolidLoadStep, SolidPath
from softtact.models.solid.readings import ReadingPoints

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class SolidResult:
    """A press of solids: s load steps, n nodes of the mesh, f frames, p pairs in contact, r nodes of rigid objects."""

    mesh: SolidMesh
    """All soft bodies at rest."""
    frames: tuple[str, ...]
    """Names of the frames."""
    pairs: tuple[str, ...]
    """Names of the pairs in contact."""
    displacement_mm: np.ndarray
    """(s, n, 3) of the nodes."""
    frame_load: np.ndarray
    """(s, f, 6): force in N and torque in N mm of each frame on the bodies, about its reference point."""
    frame_way_mm: np.ndarray
    """(s, f, 3) of the frames' reference points."""
    contact_pressure_mpa: np.ndarray
    """(s, p, n) per area at rest, positive in compression; 0 where the surface is open, nan off the pair's surface."""
    volume_ratio: np.ndarray
    """(s, n) J."""
    von_mises_mpa: np.ndarray
    """(s, n) of the Cauchy stress."""
    penetration_mm: np.ndarray
    """(s,) deepest overlap of surfaces in contact."""
    residual_n: np.ndarray
    """(s,) largest unbalanced force."""
    iterations: np.ndarray
    """(s,) Newton steps."""
    increments: np.ndarray
    """(s,) parts that a step was divided into."""
    volume_ratio_range: np.ndarray
    """(s, 2) least and largest J at the points of quadrature."""
    stretch_range: np.ndarray
    """(s, 2) least and largest isochoric principal stretch at the same points."""
    extrapolated_volume_fraction: np.ndarray
    """(s,) share strained beyond the data of the laws, nan where they do not tell."""
    work_mj: np.ndarray
    """(s,) work of frames and pressures up to the step's end."""
    dissipated_mj: np.ndarray
    """(s,) energy that friction took up to the step's end."""
    strain_energy_mj: np.ndarray
    """(s,) energy of the bodies."""
    wall_time_s: np.ndarray
    """(s,) time that the step took."""
    object_points_mm: np.ndarray
    """(r, 3) nodes of rigid objects at rest."""
    object_triangles: np.ndarray
    """(t, 3) their facets."""
    object_displacement_mm: np.ndarray
    """(s, r, 3) of the same nodes."""
    reading_points_mm: np.ndarray
    """(k, 3) places of readings at rest; none where a body has no readings."""
    reading_displacement_mm: np.ndarray
    """(s, k, 3) mean displacement of the surface around them."""
    reading_pressure_mpa: np.ndarray
    """(s, k) mean contact pressure per area at rest around them; nan off the surface in contact."""
    attributes: dict[str, Any] = field(default_factory=dict)
    """Where the result comes from, in words and numbers; files keep it."""

    @property
    def steps(self) -> int:
        """Number of load steps."""
        return len(self.displacement_mm)

    def load(self, frame: str) -> np.ndarray:
        """Loads (s, 6) of a frame by its name. InputError lists the names where there is none of it."""
        if frame not in self.frames:
            raise InputError(f"The result has no frame {frame!r}; its frames are {', '.join(self.frames) or 'none'}.")
        return self.frame_load[:, self.frames.index(frame)]

    def to_dataset(self) -> "xr.Dataset":
        """All of it as one labelled data set, the mesh with its regions and faces among its arrays."""
        return result_files.dataset_of(self)

    def write(self, path: str | Path) -> None:
        """Write as NetCDF (.nc) or as NumPy's arrays (.npz), by the path's ending; `read_solid_result` gives it back."""
        result_files.write(self.to_dataset(), path)

    def write_vtu(self, path: str | Path) -> None:
        """Write the mesh as VTU, with displacement, J, von Mises stress and contact pressure of step K as arrays `..._stepK`."""
        pressed = np.nanmax(np.where(np.isnan(self.contact_pressure_mpa), -np.inf, self.contact_pressure_mpa), axis=1,
                            initial=-np.inf)
        fields = {"displacement_mm": self.displacement_mm, "volume_ratio": self.volume_ratio, "von_mises_mpa": self.von_mises_mpa,
                  "contact_pressure_mpa": np.where(np.isfinite(pressed), pressed, np.nan)}
        write_mesh(self.mesh, path, {f"{name}_step{step + 1}": values[step].astype(np.float32)
                                     for name, values in fields.items() for step in range(self.steps)})


def solid_result(path: SolidPath) -> SolidResult:
    """Solve all steps of a path.

    Raises ConvergenceError that names the step that was not reached; its `result` holds the steps before, None where there is none.
    """
    steps: list[SolidLoadStep] = []
    try:
        for step in path.run():
            steps.append(step)
    except ConvergenceError as error:
        raise ConvergenceError(str(error), result=gathered(path.body, steps) if steps else None) from None
    return gathered(path.body, steps)


def gathered(body: SolidBody, steps: Iterable[SolidLoadStep], readings: ReadingPoints | None = None) -> SolidResult:
    """The `SolidResult` of load steps; `readings` are taken from the body's first pair in contact."""
    steps = list(steps)
    if not steps:
        raise InputError("There is no load step to keep; solve one.")
    n = len(body.mesh.points)
    surfaces = [body.surface_nodes(frame.name) for frame in body.frames if frame.nodes.min() >= n]
    fields = [nodal_fields(body, step.state) for step in steps]
    pressures = [[pressure_at_nodes(*own, n) for own in zip(body.pairs, step.state.histories, step.state.contacts, strict=True)]
                 for step in steps]

    def each(value):
        return np.array([value(step) for step in steps])

    return SolidResult(
        mesh=body.mesh, frames=tuple(frame.name for frame in body.frames), pairs=_names(body),
        displacement_mm=each(lambda step: step.state.displacement[:n]), frame_load=each(lambda step: step.loads),
        frame_way_mm=np.array([[pose.translation for pose in step.state.poses] for step in steps]).reshape(len(steps), -1, 3),
        contact_pressure_mpa=np.array(pressures).reshape(len(steps), -1, n),
        volume_ratio=np.array([J for J, _ in fields]), von_mises_mpa=np.array([mises for _, mises in fields]),
        penetration_mm=each(lambda step: step.penetration_mm), residual_n=each(lambda step: step.residual_n),
        iterations=each(lambda step: step.iterations), increments=each(lambda step: step.increments),
        volume_ratio_range=each(lambda step: step.volume_ratio), stretch_range=each(lambda step: step.stretch),
        extrapolated_volume_fraction=each(lambda step: step.extrapolated_volume_fraction),
        work_mj=each(lambda step: step.work_mj), dissipated_mj=each(lambda step: step.dissipated_mj),
        strain_energy_mj=each(lambda step: step.state.strain_energy), wall_time_s=each(lambda step: step.wall_time_s),
        object_points_mm=body.points[n:], object_triangles=np.concatenate([np.zeros((0, 3), int), *(own - n for own in surfaces)]),
        object_displacement_mm=each(lambda step: step.state.displacement[n:]), **_read(body, steps, readings))


def _read(body, steps, readings):
    """The readings of load steps by their names in `SolidResult`."""
    if readings is None:
        return {"reading_points_mm": np.zeros((0, 3)), "reading_displacement_mm": np.zeros((len(steps), 0, 3)),
                "reading_pressure_mpa": np.zeros((len(steps), 0))}
    moved = [readings.displacement_mm(step.state.displacement) for step in steps]
    pressures = [readings.pressure_mpa(body.pairs[0], step.state.histories[0], step.state.contacts[0]) for step in steps]
    return {"reading_points_mm": readings.points_mm, "reading_displacement_mm": np.array(moved),
            "reading_pressure_mpa": np.array(pressures)}


def _names(body):
    """Names of the pairs, numbered where they repeat."""
    names = [pair.name for pair in body.pairs]
    return tuple(name if names.count(name) == 1 else f"{name} {number}" for number, name in enumerate(names, start=1))


def read_solid_result(path: str | Path) -> SolidResult:
    """The `SolidResult` of a file that `SolidResult.write` wrote. Raises InputError that names the file and what it lacks."""
    dataset = result_files.read(path)
    values = {name: dataset[name].values for name in result_files.DIMENSIONS}
    return SolidResult(mesh=result_files.mesh_of(dataset), frames=tuple(map(str, dataset["frame"].values)),
                       pairs=tuple(map(str, dataset["pair"].values)), attributes=result_files.facts_of(dataset), **values)
