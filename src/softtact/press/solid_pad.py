"""A sensor's layers as a solid of finite strain, its frusta as springs, and what a press of it by a soft object gives."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.elements import QUAD9
from softtact.fem.solid_mesh import SolidMesh
from softtact.fem.structured_meshes import box
from softtact.models.hyperelastic.deformed_mesh import Cells, PressedBody
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidLoadStep
from softtact.models.solid.springs import FrustumSprings
from softtact.press.making import make_result, shell_of
from softtact.press.result import PressResult
from softtact.press.soft_object import OBJECT, SoftObject

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_PENALTY = 20.0  # times E / h of the softer of both surfaces
_CELL_OF_LAYERS = 20  # elements along the shorter side of a sensor without frusta
_REGION = {"dielectric": "sheet", "cover": "cover"}  # what files of pressed bodies call the layers
_SHELL = "shell"  # the frame that never moves
_ROOT_POINTS = 12  # along the diameter of a frustum's root, for its mean movement


class SolidPad:
    """A sensor's layers as a mesh of HEX27: in plan one element for each frustum, or some twenty along the shorter side.

    Frame: that of the sensor, but z = 0 at the layers' lower side, and `height_mm` at the sensing surface.
    """

    def __init__(self, sensor: "Sensor") -> None:
        self.sensor, self.shell, spec = sensor, shell_of(sensor), sensor.spec
        self._frusta = getattr(spec.dielectric, "frusta", None)
        self._lines = [self._along(axis) for axis in range(2)]
        dielectric, cover = _layers(spec)
        self.height_mm, self._plane_mm = dielectric + cover, dielectric
        levels = self._levels(dielectric, cover, spec.edge.held_below_mm)
        counts = [len(self._lines[0]) - 1, len(self._lines[1]) - 1, len(levels) - 1]
        low, high = [line[0] for line in self._lines], [line[-1] for line in self._lines]
        grading = [(line - line[0]) / (line[-1] - line[0]) for line in self._lines] + [levels / levels[-1]]
        mesh = box((*low, 0.0), (*high, self.height_mm), counts, grading=grading)
        self.mesh = mesh.with_regions(lambda x: np.where(x[:, 2] < dielectric, "dielectric", "cover"))

    def _along(self, axis: int) -> np.ndarray:
        """Ends of the elements along an axis in mm."""
        side = self.sensor.spec.footprint_mm[axis]
        if self._frusta is None:
            size = min(self.sensor.spec.footprint_mm) / _CELL_OF_LAYERS
            return np.linspace(-side / 2, side / 2, max(4, round(side / size)) + 1)
        count, pitch = self.sensor.spec.frusta_counts[axis], self._frusta.pitch_mm  # type: ignore[union-attr]
        lattice = (np.arange(count + 1) - count / 2) * pitch
        rim = side / 2 - lattice[-1]
        return lattice if rim < 0.05 * pitch else np.concatenate([[-side / 2], lattice, [side / 2]])

    def _levels(self, dielectric: float, cover: float, held_below: float) -> np.ndarray:
        """Heights of the elements' faces; the end of the shell is one of them."""
        ends = [0.0, dielectric] + ([dielectric + 0.5 * cover, self.height_mm] if cover else [])
        if not cover or self._frusta is None:
            ends.append(0.5 * dielectric)
        if 0 < held_below < self.height_mm:
            ends.append(self.height_mm - held_below)
        return np.unique(np.round(ends, 9))

    def with_object(self, placed: SolidMesh, soft: SoftObject, *, threads: int) -> SolidBody:
        """Both as one `SolidBody`, the holder's frame `object`, the pair of both in contact, and that of object and shell."""
        spec, region = self.sensor.spec, placed.regions[0]
        held_to = self.height_mm - spec.edge.held_below_mm
        pad = self.mesh.with_faces(shell=lambda x: _on_rim(x, self._lines) & (x[:, 2] < held_to)) if held_to > 0 else self.mesh
        mesh = pad.joined(placed, prefix="object ")
        laws = {name: self.sensor.laws[name] for name in self.mesh.regions} | {f"object {region}": soft.law}
        held = ({"shell": "xyz"} if held_to > 0 else {}) | ({"z0": "xyz"} if self._frusta is None and spec.base_held else {})
        top = placed.points[:, 2].max()
        middle = 0.5 * (placed.points.min(axis=0) + placed.points.max(axis=0))
        wide = self.shell.exists and (np.abs(placed.points[:, :2]) > 0.5 * np.asarray(spec.footprint_mm)).any()
        rests_on = {_SHELL: ((0.0, 0.0, self.height_mm), self.shell.top_mm(self.height_mm))} if wide else {}
        carried = {OBJECT: ((middle[0], middle[1], top), ["object held"], "xyz")}
        body = SolidBody(mesh, laws, held=held, threads=threads, carried=carried, rigid=rests_on)
        if self._frusta is not None:
            body.springs.append(self._springs())
        pressed, surface = Surface.of(mesh.face("object pressed")), Surface.of(mesh.face("z1"))
        size = pressed.size_mm(body.points)
        softer = min(3 * soft.law.mu0, *(3 * law.mu0 for law in self.sensor.laws.values()))
        friction = max(soft.friction, getattr(spec.friction, "object", 0.0))
        body.add_pair(
            ContactPair(
                surface,
                pressed,
                stiffness=_PENALTY * softer / size,
                reach_mm=min(2 * size, 0.5 * self.height_mm + size),
                friction=friction,
                segments=True,
            )
        )
        if wide:
            top_side, own = Surface.of({"triangle": body.surface_nodes(_SHELL)}), _PENALTY * 3 * soft.law.mu0 / size
            body.add_pair(ContactPair(pressed, top_side, stiffness=own, reach_mm=2 * size, rigid=True))
        return body

    def _springs(self) -> FrustumSprings:
        """A spring under each element of the lower side that has a frustum."""
        frusta = self._frusta
        (faces,) = self.mesh.face("z0").values()
        corners = self.mesh.points[faces]
        low, high = corners.min(axis=1)[:, :2], corners.max(axis=1)[:, :2]
        here = (np.abs(high - low - frusta.pitch_mm) < 1e-6 * frusta.pitch_mm).all(axis=1)  # type: ignore[union-attr]
        faces, corners = faces[here], corners[here]
        weights = _mean_over_disc(corners[0, :, :2], 0.5 * min(frusta.root_diameter_mm, frusta.pitch_mm))  # type: ignore[union-attr]
        law = self.sensor.prepared("foundation").law
        return FrustumSprings(faces, np.tile(weights, (len(faces), 1)), law)

    def result(self, body: SolidBody, steps: list[SolidLoadStep], *, keep_body: bool = False) -> PressResult:
        """The `PressResult` of load steps; keep_body: with a `PressedBody` at each."""
        sampled = np.array([self._sampled(step.state.displacement) for step in steps])
        forces = np.array([step.loads[0] for step in steps])
        on_shell = np.array([step.loads[1:, 2].sum() for step in steps])  # of the shell's frame, where there is one
        points = [step.state.histories[0].points for step in steps]
        contact = [step.state.contacts[0] for step in steps]
        area = [float(own.weight[state.pressure > 0].sum()) for own, state in zip(points, contact, strict=True)]
        down = np.array([-step.state.poses[0].translation[2] for step in steps])
        springs = body.springs[0] if body.springs else None
        compression = [float(springs.compressions(step.state.displacement).max()) if springs else np.nan for step in steps]
        seconds = np.array([step.wall_time_s for step in steps])
        share = np.array([step.extrapolated_volume_fraction for step in steps])
        deepest = springs.limit_mm if springs else np.inf
        valid = ~(np.array(compression) > deepest)
        numbers: dict[str, Any] = {
            "displacement_mm": sampled,
            "force_n": forces[:, :3],
            "torque_nmm": self._torques(body, steps),
            "pad_force_n": -forces[:, 2] - on_shell,
            "indentation_mm": down,
            "contact_area_mm2": np.array(area),
            "penetration_mm": np.array([step.penetration_mm for step in steps]),
            "frustum_compression_mm": np.array(compression),
            "residual_n": np.array([step.residual_n for step in steps]),
            "extrapolated_volume_fraction": share,
            "iterations": np.array([step.iterations for step in steps]),
        }
        made = make_result(
            self.sensor, "solid", body.solver.name, -sampled[..., 2], -forces[:, 2], seconds, within_validity=valid, **numbers
        )
        return replace(made, bodies=tuple(self._pressed_body(body, step) for step in steps)) if keep_body else made

    def _pressed_body(self, body: SolidBody, step: SolidLoadStep) -> PressedBody:
        """Layers and object at a load step, in the sensor's frame."""
        mesh, points, state = body.mesh, step.state.histories[0].points, step.state.contacts[0]
        cells = tuple(Cells(element.meshio_name, nodes[:, element.vtk_order], _REGION.get(region, "object"))
                      for region, element, nodes in mesh.parts())  # fmt: skip
        (top,) = mesh.face("z1").values()
        area = np.ptp(mesh.points[top], axis=1)[:, :2].prod(axis=1)
        pressed = np.bincount(points.facet, weights=points.weight * state.pressure, minlength=len(top))
        moved = step.state.displacement[: len(mesh.points)].astype(np.float32)
        at_rest = mesh.points - [0.0, 0.0, self.height_mm]
        return PressedBody(at_rest, moved, cells, top[:, :8], (pressed / area).astype(np.float32))

    def _torques(self, body, steps):
        """Torques (l, 3) about the origin of the sensor frame, at the middle of the sensing surface."""
        out = []
        for step in steps:
            at = body.frames[0].point + step.state.poses[0].translation - [0, 0, self.height_mm]
            out.append(step.loads[0, 3:] + np.cross(at, step.loads[0, :3]))
        return np.array(out)

    def _sampled(self, displacement: np.ndarray) -> np.ndarray:
        """Displacement (y, x, 3) in mm of the plane over the dielectric at the map's points."""
        spec = self.sensor.spec
        at = np.stack(np.meshgrid(spec.map_x_mm, spec.map_y_mm), axis=-1).reshape(-1, 2)
        values, columns = self._sampling(at)
        return np.einsum("pm,pmi->pi", values, displacement[columns]).reshape(*spec.map_shape, 3)

    def _sampling(self, at):
        """Shape values (p, 9) and nodes (p, 9) of the plane's points."""
        where, local = [], []
        for axis, line in enumerate(self._lines):
            cell = np.clip(np.searchsorted(line, at[:, axis], side="right") - 1, 0, len(line) - 2)
            where.append(cell)
            local.append(2 * (at[:, axis] - line[cell]) / (line[cell + 1] - line[cell]) - 1)
        values, _ = QUAD9.shape(np.column_stack(local))
        numbers = self._plane_nodes()
        offsets = (QUAD9.nodes + 1).round().astype(int)
        return values, numbers[2 * where[0][:, None] + offsets[:, 0], 2 * where[1][:, None] + offsets[:, 1]]

    def _plane_nodes(self):
        """Numbers (2 x + 1, 2 y + 1) of the nodes of the plane over the dielectric."""
        on = np.flatnonzero(np.abs(self.mesh.points[:, 2] - self._plane_mm) < 1e-9)
        order = np.lexsort((self.mesh.points[on, 1], self.mesh.points[on, 0]))
        return on[order].reshape(2 * len(self._lines[0]) - 1, 2 * len(self._lines[1]) - 1)


def _layers(spec) -> tuple[float, float]:
    """Thicknesses in mm of what lies below and above the map's plane, without frusta."""
    sheet = getattr(spec.dielectric, "sheet_thickness_mm", None)
    below = spec.dielectric.thickness_mm if sheet is None else sheet
    return float(below), float(spec.cover.thickness_mm) if spec.cover is not None else 0.0


def _on_rim(x, lines):
    return np.any([np.abs(np.abs(x[:, axis]) - line[-1]) < 1e-9 for axis, line in enumerate(lines)], axis=0)


def _mean_over_disc(corners: np.ndarray, radius: float) -> np.ndarray:
    """Weights (9,) of the nodes at corners (9, 2) of a face for the mean over a disc in its middle."""
    middle, half = corners.mean(axis=0), 0.5 * np.ptp(corners, axis=0)
    step = (np.arange(_ROOT_POINTS) + 0.5) / _ROOT_POINTS
    angle = 2 * np.pi * (np.arange(4 * _ROOT_POINTS) + 0.5) / (4 * _ROOT_POINTS)
    r, a = np.meshgrid(radius * np.sqrt(step), angle)  # rings of equal areas
    local = np.column_stack([(r * np.cos(a)).ravel() / half[0], (r * np.sin(a)).ravel() / half[1]])
    # The face may be seen from below: its own coordinates follow from those of its nodes.
    own = np.rint((corners - middle) / half)
    order = [int(np.flatnonzero((own == node).all(axis=1))[0]) for node in QUAD9.nodes]
    weights = np.empty(9)
    weights[order] = QUAD9.shape(local)[0].mean(axis=0)
    return weights
