"""Many presses of the elastic model: one after the other on the processor, all at once on a GPU.

On the processor each object has its dense compliance among its points (`compliance.touch_object`), which caches hold; the fields of
all presses are one product, which reads the surface's compliance once. They tell into which objects' recesses the surface bulges:
these are pressed once more.

On a GPU there is a column for each press and load step, and all share the surface, free sides included: a product uses four dense
matrices, one for each parity, on a quarter of the surface's nodes and all columns. Only the quarter's rectangle of nodes that the
objects come near takes part.
The method is that of `contact.unilateral`: points that penetrate join the active set, points in tension leave it, and the equations
on a set are solved by projected conjugate gradients. A set is left as soon as its residual has fallen by a power of ten, and the
displacement is updated by products with changes of the forces alone, so single precision serves. An object that would sink below
the shell is held at the shell's depth, and its force follows.
"""

import weakref
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device

from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.object_points import ObjectPoints
from softtact.contact.undersides import PosedUnderside
from softtact.contact.unilateral import LEAST_REACH_MM, ContactLoadSteps, depth_on_springs, highest_missed, not_settled
from softtact.errors import ConvergenceError
from softtact.models.elastic.compliance import Compliance, LayerPress, press_object, touch_object
from softtact.models.quarter_symmetry import PARITIES

_FALL = 0.1             # of a residual, before the active set is renewed
_MOST_KEPT = 6          # surfaces of up to 60 MB
_GROUP, _GROUPS = 32, 8     # least columns of one rectangle, and most rectangles of a batch
_SIDES = 5              # lengths of a rectangle's sides, so that few are prepared
_NEAR = 1.8             # times the depth on springs, which are stiffer at a contact's edges than the layer
_SUMMED = 128          # products that are summed up in single precision
_HELD = 1e-3            # by which an object held at the shell may press more than its force: what settling leaves
_ROUNDING = 1e-6       # of a force: what single precision leaves of it
_TINY = 1e-30           # in place of a zero that divides


@dataclass(frozen=True)
class BatchSettings:
    """tolerance_mm: largest gap under pressure, and largest overlap;  max_iterations: active sets;  inner_iterations: on each."""

    tolerance_mm: float = 5e-7
    max_iterations: int = 60
    inner_iterations: int = 40


class BatchSurface:
    """A `Compliance` on a device of torch, among the nodes of a rectangle about the middle: `displacement` and `precondition`.

    Values (4 u, columns) are those of the u nodes of the rectangle's quarter, then of their mirror images along y, along x, and
    both. Nodes on an axis are their own images; there the image's place is not `real`.
    """

    def __init__(self, compliance: Compliance, device: Any, quarter: tuple[int, int]) -> None:
        """quarter: rows and columns of the rectangle's quarter"""
        self.grid, (rows, columns) = compliance.grid, quarter
        whole = tuple(count // 2 + 1 for count in self.grid.shape)
        self._numbers = np.arange(whole[0] * whole[1]).reshape(whole)[:rows, :columns].ravel()
        self._all_nodes, _ = _images(self.grid, *np.divmod(np.arange(whole[0] * whole[1]), whole[1]))
        self.nodes, self.real = _images(self.grid, *np.divmod(self._numbers, whole[1]))
        self._device = device
        neighbours, weights = _neighbours(compliance, self.nodes, self.real)
        self._neighbours, self._weights = self.put(neighbours), self.put(weights)
        self._blocks = self.put(compliance.blocks.blocks)
        self._inner = self._blocks if quarter == whole else self.put(
            np.stack([block[np.ix_(self._numbers, self._numbers)] for block in compliance.blocks.blocks]))

    def put(self, values: np.ndarray) -> Any:
        """An array on the device."""
        import torch  # takes seconds

        return torch.as_tensor(values, device=self._device)

    def displacement(self, force: Any) -> Any:
        """Displacements (4 u, m) in mm of forces (4 u, m) in N, both in single precision."""
        by_parity = _by_parity(force)
        return _by_parity(0.25 * array_namespace(force).matmul(self._inner, by_parity)).reshape(force.shape)

    def whole_displacement(self, force: Any) -> Any:
        """The same in double precision, within 1e-7 of the whole: of forces in single precision, summed up in parts."""
        return self._summed(self._inner, _by_parity(force)).reshape(force.shape)

    def fields(self, force: Any) -> np.ndarray:
        """`whole_displacement` (m, n) at all the grid's nodes."""
        xp, by_parity = array_namespace(force), _by_parity(force)
        everywhere = xp.zeros((len(PARITIES), self._blocks.shape[2], force.shape[1]), dtype=force.dtype, device=device(force))
        everywhere[:, self._numbers] = by_parity
        moved = _on_host(self._summed(self._blocks, everywhere)).reshape(len(self._all_nodes), -1)
        fields = np.empty((moved.shape[1], self.grid.count))
        fields[:, self._all_nodes] = moved.T
        return fields

    @staticmethod
    def _summed(blocks, by_parity):
        """The product in double precision, from parts in single precision, whose sums are too short to round much."""
        xp, total = array_namespace(by_parity), 0.0
        for first in range(0, blocks.shape[2], _SUMMED):
            part = slice(first, first + _SUMMED)
            total = total + xp.astype(xp.matmul(blocks[:, :, part], by_parity[:, part]), xp.float64)
        return _by_parity(0.25 * total)

    def at_nodes(self, values: Any) -> np.ndarray:
        """Values (m, n) at the grid's nodes of values (4 u, m); zero beyond the rectangle."""
        found = np.zeros((values.shape[1], self.grid.count))
        found[:, self.nodes[self.real]] = _on_host(values)[self.real].T
        return found

    def precondition(self, x: Any) -> Any:
        """Approximate inverse of `displacement`: the compliance's stencil."""
        out = self._weights[:, :1] * x[self._neighbours[:, 0]]
        for number in range(1, self._neighbours.shape[1]):
            out.addcmul_(self._weights[:, number, None], x[self._neighbours[:, number]])
        return out


def _by_parity(values):
    """Sums over the four images (4 u, m) with the signs of each parity, (4, u, m); from parities to images it is the same."""
    of, xp = values.reshape(len(PARITIES), -1, values.shape[-1]), array_namespace(values)
    here, beyond = (of[0] + of[1], of[0] - of[1]), (of[2] + of[3], of[2] - of[3])
    return xp.stack([here[0] + beyond[0], here[1] + beyond[1], here[0] - beyond[0], here[1] - beyond[1]])


def _images(grid, rows, columns):
    """Numbers (4 u,) in the grid of a quarter's nodes, counted from the middle, and of their images; which (4 u,) are real."""
    middle_j, middle_i = (count // 2 for count in grid.shape)
    signs = [(1 - 2 * x, 1 - 2 * y) for x, y in PARITIES]
    nodes = [(middle_j + y * rows) * grid.shape[1] + middle_i + x * columns for x, y in signs]
    real = [((x > 0) | (columns > 0)) & ((y > 0) | (rows > 0)) for x, y in signs]
    return np.concatenate(nodes), np.concatenate(real)


def _neighbours(compliance, nodes, real):
    """Places (4 u, k) of the neighbours of each real place, and the stencil's weights, 0 where there is none."""
    places = np.flatnonzero(real)
    found, weight = compliance.stencil.around(compliance.grid, nodes[real])
    neighbours, weights = np.zeros((len(nodes), found.shape[1]), dtype=np.int64), np.zeros((len(nodes), found.shape[1]), np.float32)
    neighbours[places], weights[places] = np.where(found >= 0, places[found], 0), np.where(found >= 0, weight, 0.0)
    return neighbours, weights


_KEPT: "OrderedDict[tuple, tuple[weakref.ref, BatchSurface]]" = OrderedDict()     # the last few, by their compliance's identity


def _surface_of(compliance, device, quarter):
    """The `BatchSurface`, made once for as long as its compliance is in use."""
    key = id(compliance), str(device), quarter
    if key not in _KEPT or _KEPT[key][0]() is not compliance:
        _KEPT[key] = weakref.ref(compliance), BatchSurface(compliance, device, quarter)
        while len(_KEPT) > _MOST_KEPT:
            _KEPT.popitem(last=False)
    return _KEPT[key][1]


def _on_host(values):
    return values.cpu().numpy()


def press_layers(compliance: Compliance, objects: list[PosedUnderside], forces_n: np.ndarray, *, device: Any = "cpu",
                 settings: BatchSettings = BatchSettings()) -> tuple[LayerPress, dict[int, ConvergenceError]]:
    """The `LayerPress` of objects through forces (p, l) in N, rising, whose columns are the objects' load steps, side by side; and
    the errors of those that do not settle, by their number.

    device: `cpu`, or a device of torch, for which the settings are
    """
    if device == "cpu":
        return _press_in_turn(compliance, objects, forces_n)
    load_steps = forces_n.shape[1]
    heights = np.repeat([one.height_mm for one in objects], load_steps, axis=0)
    stops = np.repeat([one.stop_mm for one in objects], load_steps)
    press = _press_columns(compliance, heights, forces_n.ravel(), stops, device, settings)
    settled = press.contact.settled.reshape(-1, load_steps)
    return press, {int(number): ConvergenceError(not_settled(forces_n[number][~settled[number]][0]))
                   for number in np.flatnonzero(~settled.all(axis=1))}


def _press_in_turn(compliance, objects, forces_n):
    """`press_layers` on the processor."""
    grid, (presses, load_steps), errors = compliance.grid, forces_n.shape, {}
    force, gap = np.zeros((grid.count, forces_n.size)), np.full((grid.count, forces_n.size), np.inf)
    depth, iterations, settled = (np.zeros(forces_n.size, dtype=kind) for kind in (float, int, bool))

    def take(columns, points, contact):
        force[points.nodes, columns], gap[points.nodes, columns] = contact.force, contact.gap
        depth[columns], iterations[columns], settled[columns] = contact.depth, contact.iterations, True

    of_press = [slice(number * load_steps, (number + 1) * load_steps) for number in range(presses)]
    for number, columns in enumerate(of_press):
        try:
            take(columns, *touch_object(compliance, objects[number], forces_n[number], bulges=False))
        except ConvergenceError as error:
            errors[number] = error.with_traceback(None)
    pressed = np.flatnonzero(force.any(axis=1))
    points = ObjectPoints.level(pressed, np.zeros(len(pressed)), grid.step)
    top = compliance.top(points, force[pressed])
    fields = compliance.fields(points, force[pressed], top=top)
    for number, columns in enumerate(of_press):
        if number in errors or not _bulges(objects[number].height_mm, gap[:, columns], top[columns], depth[columns]):
            continue
        try:
            points, press = press_object(compliance, objects[number], forces_n[number])
            take(columns, points, press.contact)
            fields[columns] = press.fields
        except ConvergenceError as error:
            errors[number], settled[columns], fields[columns] = error.with_traceback(None), False, 0.0
    return LayerPress(fields, ContactLoadSteps(force, depth, gap, iterations, settled), grid.areas(np.arange(grid.count))), errors


def _bulges(height, gap, top, depth):
    """Whether the surface, `top` (l, ny, nx) down, penetrates an object with heights (n,) where it has no gap (n, l) yet."""
    beyond = np.where(np.isinf(gap[:, 0]), height, -np.inf)
    return highest_missed(beyond, -np.inf, top.reshape(len(depth), -1), depth) > -np.inf


def _press_columns(compliance, heights, forces_n, stops, device, settings):
    """The `LayerPress` of columns (m,) with heights (m, n): first among the nodes that the objects are expected to come near."""
    grid, area = compliance.grid, compliance.grid.areas(np.arange(compliance.grid.count))
    first = np.array([depth_on_springs(one, area, force / compliance.foundation_modulus)
                      for one, force in zip(heights, forces_n, strict=True)])
    found: dict[str, np.ndarray] = {}

    def press(some, quarter):
        part = _among(compliance, quarter, heights[some], forces_n[some], stops[some], first[some], device, settings)
        for name, values in part.items():
            found.setdefault(name, np.empty((len(heights), *values.shape[1:]), dtype=values.dtype))[some] = values

    quarters = _quarters(grid, heights, first)
    order = np.argsort(quarters.prod(axis=1), kind="stable")
    for some in np.array_split(order, max(1, min(len(order) // _GROUP, _GROUPS))):
        press(some, tuple(int(side) for side in quarters[some].max(axis=0)))
    deeper = (found["gap"] < -settings.tolerance_mm).any(axis=1) & found["settled"]      # than expected: others touch, too
    if deeper.any():
        press(np.flatnonzero(deeper), tuple(count // 2 + 1 for count in grid.shape))
    fields = grid.with_held_sides(found.pop("fields").reshape(-1, *grid.shape))
    return LayerPress(fields=fields, contact=ContactLoadSteps(**found | {"force": found["force"].T, "gap": found["gap"].T}),
                      areas=area)


def _quarters(grid, heights, depths):
    """Rows and columns (m, 2) of the quarter's rectangle that objects with heights (m, n) come near at depths (m,) on springs."""
    lowest, whole = heights.min(axis=1), np.array([count // 2 + 1 for count in grid.shape])
    near = heights < (lowest + _NEAR * (depths - lowest) + LEAST_REACH_MM)[:, None]
    away = np.abs(grid.from_middle(np.arange(grid.count)))
    wanted = np.column_stack([np.where(near, along, 0).max(axis=1) + 1 for along in away.T[::-1]])
    step = -(-whole // _SIDES)
    return np.minimum(step * -(-wanted // step), whole)


def _among(compliance, quarter, heights, forces_n, stops, first, device, settings):
    """Arrays by their names in `ContactLoadSteps`, columns first, and `fields`, with contact within a rectangle's quarter alone."""
    surface = _surface_of(compliance, device, quarter)
    areas = compliance.grid.areas(surface.nodes) * surface.real
    gap0 = np.where(surface.real[:, None], heights.T[surface.nodes], NO_CONTACT_MM)
    press = _Columns(surface, surface.put(gap0), surface.put(forces_n), settings)
    xp = press.xp
    press.start(surface.put(first), surface.put(areas))
    press.settle(surface.put(np.arange(len(forces_n))))
    resting = (_on_host(press.depth) > stops) | (~_on_host(press.settled) & np.isfinite(stops))
    if resting.any():
        press.hold(surface.put(np.flatnonzero(resting)), surface.put(stops[resting]))
    settled = _on_host(press.settled)
    settled &= ~resting | (_on_host(xp.sum(press.force, axis=0)) <= forces_n * (1 + _HELD))      # the shell carries the rest
    force, depth = xp.astype(press.force, xp.float32), _on_host(press.depth)
    fields = surface.fields(force)
    return {"force": surface.at_nodes(press.force), "depth": depth, "gap": heights - depth[:, None] + fields, "fields": fields,
            "iterations": _on_host(press.iterations), "settled": settled}


class _Columns:
    """The state of all columns (m,): forces (n, m) in N and their displacement, depths, the active set, and which have settled."""

    def __init__(self, surface, gap0, forces, settings):
        self.surface, self.gap0, self.forces, self.settings = surface, gap0, forces, settings
        self.xp = xp = array_namespace(gap0)
        self.held, self.settled = xp.zeros_like(forces, dtype=xp.bool), xp.zeros_like(forces, dtype=xp.bool)
        self.iterations = xp.zeros_like(forces, dtype=xp.int64)

    def start(self, depth, area):
        """First guess: forces of independent springs under the object, at the depth that balances each force."""
        xp = self.xp
        pressed = xp.clip(depth - self.gap0, min=0.0) * area[:, None]
        self.force, self.depth = pressed * (self.forces / xp.sum(pressed, axis=0)), depth
        self.active = self.force > 0
        self.moved = self.surface.whole_displacement(xp.astype(self.force, xp.float32))

    def hold(self, columns, depth):
        """Settle columns again, held at a depth in place of their force."""
        self.held[columns], self.depth[columns] = True, depth
        self.settle(columns)

    def settle(self, columns):
        """Iterate on some columns until each has settled, or up to the limit."""
        for _ in range(self.settings.max_iterations):
            gap, active, self.settled[columns] = self._evaluate(columns)
            left = ~self.settled[columns]
            if not self.xp.any(left):
                return
            columns = columns[left]
            self._advance(columns, gap[:, left], active[:, left])

    def _evaluate(self, columns):
        """Gaps and the next active set of some columns, and which of these have settled."""
        xp, tolerance = self.xp, self.settings.tolerance_mm
        force, active, held = self.force[:, columns], self.active[:, columns], self.held[columns]
        gap = self.gap0[:, columns] + self.moved[:, columns]
        count = xp.clip(xp.sum(xp.astype(active, gap.dtype), axis=0), min=1.0)
        depth = xp.where(held, self.depth[columns], xp.sum(gap * active, axis=0) / count)
        gap -= depth
        joining, pulling = ~active & (gap < -tolerance), active & (force < 0)
        self.depth[columns] = depth
        unsettled = xp.any((xp.abs(gap) > tolerance) & active | joining | pulling, axis=0)
        return gap, (active | joining) & ~pulling, ~unsettled

    def _advance(self, columns, gap, active):
        """Forces of some columns on their next active set; points that left it lose theirs."""
        xp, surface = self.xp, self.surface
        before = self.force[:, columns]
        kept, mask = before * active, xp.astype(active, xp.float32)
        free = xp.astype(~self.held[columns], xp.float32)
        lacking = free * xp.astype(self.forces[columns] - xp.sum(kept, axis=0), xp.float32)
        even = surface.precondition(mask) * mask
        weight = xp.clip(xp.sum(even, axis=0), min=_TINY)
        change = xp.astype(kept - before, xp.float32) + even * (lacking / weight)
        if xp.all(active | (before == 0)) and xp.all(xp.abs(lacking) <= _ROUNDING * self.forces[columns]):     # the first time
            change, moved = xp.zeros_like(change), xp.zeros_like(change)
        else:
            moved = surface.displacement(change)
        right = (xp.astype(-gap, xp.float32) - moved) * mask
        self._conjugate_gradients(change, moved, right, mask, even * (free / weight), free)
        self.force[:, columns] = (before + change) * active     # no rounded rest where nothing touches
        self.moved[:, columns] = self.moved[:, columns] + moved
        self.active[:, columns] = active
        self.iterations[columns] += 1

    def _conjugate_gradients(self, change, moved, residual, mask, even, free):
        """Add to `change` and `moved` until the residual has fallen; the sum of forces is kept where a column is free."""
        xp, surface = self.xp, self.surface
        share = free / xp.clip(xp.sum(mask, axis=0), min=1.0)

        def centred(r):
            return r - mask * (share * xp.sum(r, axis=0))

        def project(r):
            z = surface.precondition(r)
            z *= mask
            z -= even * xp.sum(z, axis=0)
            return z

        residual = centred(residual)
        least = xp.clip(_FALL * xp.max(xp.abs(residual), axis=0), min=0.3 * self.settings.tolerance_mm)
        z = project(residual)
        direction, rho = xp.asarray(z, copy=True), xp.sum(residual * z, axis=0)
        for _ in range(self.settings.inner_iterations):
            going = xp.max(xp.abs(residual), axis=0) > least
            if not xp.any(going):
                break
            by_direction = surface.displacement(direction)
            length = xp.sum(direction * by_direction, axis=0)
            step = xp.where(going, rho / xp.clip(length, min=_TINY), 0.0)
            change += step * direction
            by_direction *= step
            moved += by_direction
            by_direction *= mask
            before, residual = residual, centred(residual - by_direction)
            z = project(residual)
            turned = xp.clip(xp.sum((residual - before) * z, axis=0), min=0.0)     # Polak and Ribiere's: single precision
            direction *= xp.where(rho > 0, turned / xp.clip(rho, min=_TINY), 0.0)
            direction += z
            rho = xp.sum(residual * z, axis=0)
