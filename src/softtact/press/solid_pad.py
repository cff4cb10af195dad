"""A sensor's layers as a solid of finite strain with its frusta as items below it, and the result of a press on it.

A soft object adds its elements to those of the layers; a rigid one is its exact facets on a frame with six freedoms.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.pair import ContactPair
from softtact.contact.surface_places import places
from softtact.contact.surfaces import Surface
from softtact.fem.elements import QUAD9
from softtact.fem.solid_mesh import SolidMesh
from softtact.fem.structured_meshes import box
from softtact.geometry.meshes import misses_sensor
from softtact.models.foundation.frustum_spring import FrustumLaw
from softtact.models.hyperelastic.deformed_mesh import Cells, PressedBody
from softtact.models.solid.body import SolidBody
from softtact.models.solid.frusta import FrustumItem
from softtact.models.solid.path import SolidLoadStep, times_of
from softtact.press.cache import cached_frustum_law
from softtact.press.making import make_result
from softtact.press.objects import OBJECT, SoftObject, shell_of
from softtact.press.result import PressResult
from softtact.press.validity import flags_solid

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_PENALTY = 20.0  # times E / h of the softer of both surfaces
_CELL_OF_LAYERS = 20  # elements along the shorter side of a sensor without frusta
_REGION = {"dielectric": "sheet", "cover": "cover"}  # names of the layers in files of pressed bodies
_SHELL = "shell"  # the frame that never moves
_ACROSS = 8  # elements across the part that a rigid object may touch, at least ...
_MOST_PARTS = 3  # ... but at most so many in place of one
_PARTS = 4  # along each side of the square that stands for a point of contact, as its force is given to the map
_NEAR = 0.4  # of the layers' height: a rigid object may touch with its part up to so far above its lowest point


class SolidPad:
    """A sensor's layers as a mesh of HEX27: in plan one element for each frustum, or some twenty along the shorter side.

    Frame: that of the sensor, but z = 0 at the layers' lower side, and `height_mm` at the sensing surface.
    """

    def __init__(self, sensor: "Sensor") -> None:
        self.sensor, self.shell, spec = sensor, shell_of(sensor), sensor.spec
        self._frusta = getattr(spec.dielectric, "frusta", None)
        dielectric, cover = _layers(spec)
        self.height_mm, self._plane_mm = dielectric + cover, dielectric
        self._build()

    def _build(self, fine: np.ndarray | None = None) -> None:
        """Mesh the layers; fine (2, 2): least and largest x and y in mm of a part with smaller elements."""
        lines, (dielectric, cover), spec = [self._along(axis) for axis in range(2)], _layers(self.sensor.spec), self.sensor.spec
        self._lines = lines if fine is None else [_split(line, *fine[:, axis]) for axis, line in enumerate(lines)]
        levels = self._levels(dielectric, cover, spec.edge.held_below_mm)
        counts = [len(self._lines[0]) - 1, len(self._lines[1]) - 1, len(levels) - 1]
        low, high = [line[0] for line in self._lines], [line[-1] for line in self._lines]
        grading = [(line - line[0]) / (line[-1] - line[0]) for line in self._lines] + [levels / levels[-1]]
        mesh = box((*low, 0.0), (*high, self.height_mm), counts, grading=grading)
        self.mesh = mesh.with_regions(lambda x: np.where(x[:, 2] < dielectric, "dielectric", "cover"))

    def _along(self, axis: int) -> np.ndarray:
        """Ends of the elements along an axis in mm, without finer ones."""
        side = self.sensor.spec.footprint_mm[axis]
        if self._frusta is None:
            size = min(self.sensor.spec.footprint_mm) / _CELL_OF_LAYERS
            return np.linspace(-side / 2, side / 2, max(4, round(side / size)) + 1)
        count, pitch = self.sensor.spec.frusta_counts[axis], self._frusta.pitch_mm
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
        pad, held = self._held()
        mesh = pad.joined(placed, prefix="object ")
        laws = {name: self.sensor.laws[name] for name in self.mesh.regions} | {f"object {region}": soft.law}
        top = placed.points[:, 2].max()
        middle = 0.5 * (placed.points.min(axis=0) + placed.points.max(axis=0))
        wide = self.shell.exists and (np.abs(placed.points[:, :2]) > 0.5 * np.asarray(spec.footprint_mm)).any()
        rests_on = {_SHELL: ((0.0, 0.0, self.height_mm), self.shell.top_mm(self.height_mm))} if wide else {}
        carried = {OBJECT: ((middle[0], middle[1], top), ["object held"], "xyz")}
        body = SolidBody(mesh, laws, held=held, threads=threads, carried=carried, rigid=rests_on)
        pressed, surface = Surface.of(mesh.face("object pressed")), Surface.of(mesh.face("z1"))
        size = pressed.size_mm(body.points)
        softer = min(3 * soft.law.mu0, *(3 * law.mu0 for law in self.sensor.laws.values()))
        friction = max(soft.friction, getattr(spec.friction, "object", 0.0))
        body.add(
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
            top_side, penalty = Surface.of({"triangle": body.surface_nodes(_SHELL)}), _PENALTY * 3 * soft.law.mu0 / size
            body.add(ContactPair(pressed, top_side, stiffness=penalty, reach_mm=2 * size, rigid=True))
        self._add_frusta(body)
        return body

    def with_rigid(self, placed: trimesh.Trimesh, *, friction: float | None = None, threads: int) -> SolidBody:
        """The pad and a rigid object (mm, in its pose) that just touches pad or shell, as one `SolidBody`.

        The pad has smaller elements below the part of the object that may touch it.
        Frame `object`: about the middle of the object's bounding box, with six freedoms.
        friction: Coulomb's coefficient of object and surface, by default the sensor's
        Raises InputError where the object misses the sensor.
        """
        triangles = self._touching(placed)
        self._build(self._part_below(triangles))
        mesh, held = self._held()
        ends = triangles.reshape(-1, 3)
        rigid = {OBJECT: (0.5 * (ends.min(axis=0) + ends.max(axis=0)), triangles)}
        if wide := self.shell.exists and bool((np.abs(ends[:, :2]) > 0.5 * np.asarray(self.sensor.spec.footprint_mm)).any()):
            rigid[_SHELL] = ((0.0, 0.0, self.height_mm), self.shell.top_mm(self.height_mm))
        body = SolidBody(mesh, self.sensor.laws, held=held, threads=threads, rigid=rigid)
        surface, pressed = Surface.of(mesh.face("z1")), Surface.of({"triangle": body.surface_nodes(OBJECT)})
        size = surface.size_mm(body.points)
        penalty = _PENALTY * min(3 * law.mu0 for law in self.sensor.laws.values()) / size
        if friction is None:
            friction = getattr(self.sensor.spec.friction, "object", 0.0)
        reach = min(2 * size, 0.5 * self.height_mm + size)
        body.add(ContactPair(surface, pressed, stiffness=penalty, reach_mm=reach, friction=friction, rigid=True))
        if wide:
            top_side = Surface.of({"triangle": body.surface_nodes(_SHELL)})
            body.add(ContactPair(pressed, top_side, stiffness=penalty, reach_mm=reach, segments=True, rigid=True, name="shell"))
        self._add_frusta(body)
        return body

    def _part_below(self, triangles):
        """Least and largest x and y (2, 2) of the part of the pad that may touch an object's triangles (t, 3, 3)."""
        below = _points_below(triangles, self.height_mm * (1 + _NEAR))[:, :2]
        half = 0.5 * np.asarray(self.sensor.spec.footprint_mm)
        return np.clip([below.min(axis=0), below.max(axis=0)], -half, half)

    def _touching(self, placed):
        """Triangles (t, 3, 3) of a rigid object in the pad's frame, moved along z to where it just touches pad or shell."""
        triangles, underside = np.asarray(placed.triangles), HeightField(placed)
        half = 0.5 * np.asarray(self.sensor.spec.footprint_mm)
        down = underside.lowest_over(-half, half)
        if not down < NO_CONTACT_MM:
            raise misses_sensor(triangles.reshape(-1, 3), self.sensor.spec.footprint_mm)
        return triangles + [0.0, 0.0, self.height_mm - min(down, self.shell.stop_mm(underside))]

    def _held(self):
        """The layers' mesh, and its held faces {face: axes}."""
        held_to = self.height_mm - self.sensor.spec.edge.held_below_mm
        mesh = self.mesh.with_faces(shell=lambda x: _on_rim(x, self._lines) & (x[:, 2] < held_to)) if held_to > 0 else self.mesh
        base = self._frusta is None and self.sensor.spec.base_held
        return mesh, ({"shell": "xyz"} if held_to > 0 else {}) | ({"z0": "xyz"} if base else {})

    def _add_frusta(self, body: SolidBody) -> None:
        """Frusta below the layers, an item for each pattern of elements over a frustum."""
        if self._frusta is None:
            return
        spec, law = self.sensor.spec, self._frustum_law()
        nodes, groups = self._nodes_at(0.0), {}      # type: ignore[var-annotated]
        for cells in np.ndindex(*spec.frusta_counts):
            parts = tuple(self._parts_over(axis, cell) for axis, cell in enumerate(cells))
            key = tuple(len(part) - 1 for part in parts)
            groups.setdefault(key, []).append(nodes[2 * parts[0][0] : 2 * parts[0][-1] + 1, 2 * parts[1][0] : 2 * parts[1][-1] + 1])
        for key, above in groups.items():
            above = np.array([part.ravel() for part in above])
            root = law.spread @ _shapes_over(law.root_xy, self._frusta.pitch_mm, key)
            body.add(FrustumItem(above, root, law, bonded=spec.tips_bonded, friction=spec.friction.board))

    def _frustum_law(self) -> FrustumLaw:
        """The law of frusta with bonded tips; the item lets tips slide where they may."""
        self.sensor.need_elastic("frusta", ["dielectric"])
        known = self.sensor.prepared_models.get("frustum")
        return known or cached_frustum_law(self.sensor.spec, self.sensor.laws["dielectric"], bonded=True)

    def _parts_over(self, axis: int, number: int) -> np.ndarray:
        """Numbers of the ends of the elements over a frustum, by its number along an axis."""
        pitch = self._frusta.pitch_mm  # type: ignore[union-attr]
        low = (number - 0.5 * self.sensor.spec.frusta_counts[axis]) * pitch
        low, high = (int(np.argmin(np.abs(self._lines[axis] - end))) for end in (low, low + pitch))
        return np.arange(low, high + 1)

    def result(self, body: SolidBody, steps: list[SolidLoadStep], *, keep_body: bool = False) -> PressResult:
        """The `PressResult` of load steps; keep_body: with a `PressedBody` at each."""
        sampled = np.array([self._sampled(step.state.displacement) for step in steps])
        forces = np.array([step.loads[0] for step in steps])
        on_shell = np.array([step.loads[1:, 2].sum() for step in steps])  # of the shell's frame, where there is one
        points = [step.state.histories[0].points for step in steps]
        contact = [step.state.contacts[0] for step in steps]
        area = [float(at.weight[state.pressure > 0].sum()) for at, state in zip(points, contact, strict=True)]
        down = np.array([-step.state.poses[0].translation[2] for step in steps])
        frusta = [item for item in body.items if isinstance(item, FrustumItem)]
        compression = [max((float(item.compressions(step.state.displacement).max()) for item in frusta), default=np.nan)
                       for step in steps]  # fmt: skip
        seconds = np.array([step.wall_time_s for step in steps])
        share = np.array([step.extrapolated_volume_fraction for step in steps])
        flags = flags_solid(np.array(compression), law_limit_mm=frusta[0].limit_mm if frusta else np.inf)
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
            self.sensor, "solid", body.solver.name, -sampled[..., 2], -forces[:, 2], seconds, flags=flags, **numbers
        )
        made = replace(made, time_s=times_of(steps), **self._contact(body, steps))
        return replace(made, bodies=tuple(self._pressed_body(body, step) for step in steps)) if keep_body else made

    def _contact(self, body: SolidBody, steps: list[SolidLoadStep]) -> dict[str, Any]:
        """Traction and slip of the sensing surface at the map's points, by the names of a result.

        The traction's sum over the map's cells is the force on them: each point of contact gives its force to the four map points
        around it.
        """
        traction, slip = [], []
        for step in steps:
            history, state = step.state.histories[0], step.state.contacts[0]
            touches = state.pressure > 0
            to_map = self._shares(places(history.points, body.points)[touches], history.points.weight[touches])
            area = np.asarray(to_map.sum(axis=1)).ravel()
            slid = to_map @ (history.slid + state.slid_mm)[touches]
            traction.append(to_map @ state.force_mpa[touches] / self._cells_mm2.ravel()[:, None])
            slip.append(np.where(area > 0, slid / np.where(area > 0, area, 1.0), np.nan))
        shape = (len(steps), *self.sensor.spec.map_shape)
        return {"traction_mpa": np.reshape(traction, (*shape, 3)), "slip": np.reshape(slip, shape)}

    @property
    def _cells_mm2(self) -> np.ndarray:
        """(y, x) area of each map point's cell."""
        along = [np.convolve(np.pad(np.diff(line), 1), [0.5, 0.5], mode="valid")
                 for line in (self.sensor.spec.map_y_mm, self.sensor.spec.map_x_mm)]
        return np.outer(*along)

    def _shares(self, at: np.ndarray, area: np.ndarray) -> sp.csr_matrix:
        """Areas (map points, p) in mm2 of points (p, 3) with an area each, by the map points around: of a square about each."""
        side = np.sqrt(area)[:, None, None]
        parts = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
        spread = np.stack(np.meshgrid(parts, parts), axis=-1).reshape(-1, 2)
        within, (ny, nx) = (at[:, None, :2] + side * spread).reshape(-1, 2), self.sensor.spec.map_shape
        weights, columns, point = np.repeat(area, _PARTS**2) / _PARTS**2, [], np.repeat(np.arange(len(at)), _PARTS**2)
        for axis, line in enumerate((self.sensor.spec.map_x_mm, self.sensor.spec.map_y_mm)):
            place = np.clip(np.interp(within[:, axis], line, np.arange(len(line))), 0, len(line) - 1 - 1e-9)
            low = place.astype(int)
            columns.append(((low, low + 1 - place), (low + 1, place - low)))
        entries = [(y * nx + x, weights * wx * wy) for x, wx in columns[0] for y, wy in columns[1]]
        rows, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        return sp.csr_matrix((values, (rows, np.tile(point, 4))), shape=(ny * nx, len(at)))

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
        numbers = self._nodes_at(self._plane_mm)
        offsets = (QUAD9.nodes + 1).round().astype(int)
        return values, numbers[2 * where[0][:, None] + offsets[:, 0], 2 * where[1][:, None] + offsets[:, 1]]

    def _nodes_at(self, height):
        """Numbers (2 x + 1, 2 y + 1) of the nodes at a height in mm."""
        on = np.flatnonzero(np.abs(self.mesh.points[:, 2] - height) < 1e-9)
        order = np.lexsort((self.mesh.points[on, 1], self.mesh.points[on, 0]))
        return on[order].reshape(2 * len(self._lines[0]) - 1, 2 * len(self._lines[1]) - 1)


def _layers(spec) -> tuple[float, float]:
    """Thicknesses in mm of the layers below and above the map's plane, without frusta."""
    sheet = getattr(spec.dielectric, "sheet_thickness_mm", None)
    below = spec.dielectric.thickness_mm if sheet is None else sheet
    return float(below), float(spec.cover.thickness_mm) if spec.cover is not None else 0.0


def _on_rim(x, lines):
    return np.any([np.abs(np.abs(x[:, axis]) - line[-1]) < 1e-9 for axis, line in enumerate(lines)], axis=0)


def _points_below(triangles: np.ndarray, height: float) -> np.ndarray:
    """Corners of triangles (t, 3, 3) below a height, and where their edges cross it (n, 3)."""
    start, end = triangles.reshape(-1, 3), np.roll(triangles, -1, axis=1).reshape(-1, 3)
    cross = (start[:, 2] < height) != (end[:, 2] < height)
    share = (height - start[cross, 2]) / (end[cross, 2] - start[cross, 2])
    return np.vstack([start[start[:, 2] < height], start[cross] + share[:, None] * (end[cross] - start[cross])])


def _split(line: np.ndarray, low: float, high: float) -> np.ndarray:
    """Ends of elements along an axis, those between `low` and `high` (mm) divided to `_ACROSS` elements there."""
    sizes = np.diff(line)
    parts = np.clip(np.ceil(sizes * _ACROSS / max(high - low, 1e-9) - 1e-9), 1, _MOST_PARTS).astype(int)
    touched = (line[1:] > low) & (line[:-1] < high)
    ends = [np.linspace(a, b, count + 1)[:-1] for a, b, count in zip(line, line[1:], np.where(touched, parts, 1), strict=False)]
    return np.concatenate([*ends, line[-1:]])


def _shapes_over(xy: np.ndarray, pitch: float, parts: tuple[int, ...]) -> np.ndarray:
    """Shape functions (s, nodes) at places (s, 2) about the middle of a square of `parts` elements along x and y."""
    along = []
    for axis, count in enumerate(parts):
        place = (xy[:, axis] / pitch + 0.5) * count
        element = np.clip(np.floor(place).astype(int), 0, count - 1)
        t, values = 2 * (place - element) - 1, np.zeros((len(xy), 2 * count + 1))
        for node, value in enumerate((0.5 * t * (t - 1), 1 - t**2, 0.5 * t * (t + 1))):
            np.add.at(values, (np.arange(len(xy)), 2 * element + node), value)
        along.append(values)
    return np.einsum("sa,sb->sab", *along).reshape(len(xy), -1)
