"""Many presses of the elastic model at once: a column for each press and load step, on a GPU or on any device of torch.

`press_layer` gathers a dense compliance among one object's points. Here all presses share the surface: a product uses four dense
matrices, one for each parity, on a quarter of the surface's nodes and all columns. It takes about four times the operations, but
suits a GPU. The method is that of `contact.unilateral`, with torch's arrays.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields

import numpy as np
import torch

from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.unilateral import ContactLoadSteps, ContactSettings, depth_on_springs, press_columns
from softtact.models.elastic.compliance import Compliance, LayerPress

COLUMNS_AT_ONCE = 4000      # 1 MB each on the coro's grid, most of it in single precision


class DeviceSurface:
    """A `Compliance` on a torch device: `double`, `single`, `precondition`, of values (nodes, columns) at all its grid's nodes."""

    def __init__(self, compliance: Compliance, device: str | torch.device) -> None:
        self.device, self.shape = torch.device(device), compliance.grid.shape
        self._single = torch.as_tensor(compliance.blocks.blocks, dtype=torch.float32, device=self.device)
        self._double = self._single.double()
        self._offsets = list(_offsets(compliance.stencil))
        self._weights = torch.as_tensor(_stencil_weights(compliance), dtype=torch.float32, device=self.device)

    def double(self, force: torch.Tensor) -> torch.Tensor:
        """Displacements in mm of forces in N, in double precision."""
        return self._displacement(self._double, force)

    def single(self, force: torch.Tensor) -> torch.Tensor:
        """The same in single precision."""
        return self._displacement(self._single, force)

    def _displacement(self, blocks, force):
        rows, columns = self.shape
        even_y, odd_y = _folded(force.reshape(rows, columns, -1), axis=0)
        parts = torch.stack([part for y in zip(_folded(even_y, axis=1), _folded(odd_y, axis=1), strict=True) for part in y])
        moved = torch.bmm(blocks, parts.reshape(4, blocks.shape[2], -1)).reshape(parts.shape)
        even_y, odd_y = (_unfolded(moved[y], moved[2 + y], axis=1) for y in (0, 1))     # PARITIES' order: x outside, y inside
        return 0.25 * _unfolded(even_y, odd_y, axis=0).reshape(rows * columns, -1)

    def precondition(self, x: torch.Tensor) -> torch.Tensor:
        """Approximate inverse of `single`: the compliance's stencil."""
        rows, columns = self.shape
        reach = max(offset for offset, _ in self._offsets)
        around = torch.nn.functional.pad(x.reshape(rows, columns, -1), (0, 0, reach, reach, reach, reach))
        out = torch.zeros_like(x).reshape(rows, columns, -1)
        for weight, (dj, di) in zip(self._weights, self._offsets, strict=True):
            out.addcmul_(weight[:, :, None], around[reach + dj:reach + dj + rows, reach + di:reach + di + columns])
        return out.reshape(rows * columns, -1)


def _folded(values, *, axis):
    """Sum and difference of the two halves of a side that is symmetric about its middle place, from there on."""
    middle = values.shape[axis] // 2
    upper, lower = values.narrow(axis, middle, middle + 1), values.narrow(axis, 0, middle + 1).flip(axis).clone()
    lower.select(axis, 0).zero_()     # the middle place mirrors itself
    return upper + lower, upper - lower


def _unfolded(even, odd, *, axis):
    """Values on the whole side from their even and odd parts."""
    upper, lower = even + odd, (even - odd).flip(axis)
    return torch.cat([lower.narrow(axis, 0, lower.shape[axis] - 1), upper], dim=axis)


def _offsets(stencil):
    reach = stencil.values.shape[2] // 2
    return ((dj, di) for dj in range(-reach, reach + 1) for di in range(-reach, reach + 1))


def _stencil_weights(compliance):
    """The stencil's weights (offsets, ny, nx): of each node's neighbours at each offset."""
    (rows, columns), values = compliance.grid.shape, compliance.stencil.values
    reach = values.shape[2] // 2
    j, i = np.meshgrid((np.arange(rows) - rows // 2) % 2, (np.arange(columns) - columns // 2) % 2, indexing="ij")
    return np.stack([values[j, i, dj + reach, di + reach] for dj, di in _offsets(compliance.stencil)])


def press_layers(compliance: Compliance, heights: Sequence[np.ndarray] | np.ndarray, forces_n: Sequence[float] | np.ndarray, *,
                 device: str | torch.device, settings: ContactSettings | None = None) -> Iterator[LayerPress]:
    """Yield the `LayerPress` of each object with `heights` (p, n) in mm over the grid's nodes, in their order.

    forces_n (l,): in N, rising;  device: of torch. A load step that does not settle is marked by the contact's `settled`.
    """
    surface = DeviceSurface(compliance, device)
    at_once = max(1, COLUMNS_AT_ONCE // len(forces_n))
    for start in range(0, len(heights), at_once):
        yield from _press_some(compliance, surface, heights[start:start + at_once], np.asarray(forces_n, dtype=float),
                               settings or ContactSettings())


def _press_some(compliance, surface, heights, forces_n, settings):
    grid = compliance.grid
    area = grid.areas(np.arange(grid.count))
    first = np.stack([_depth_at_first(height, area, forces_n / compliance.foundation_modulus) for height in heights])
    on_device = [torch.as_tensor(values, device=surface.device)
                 for values in (np.stack(heights, axis=1), np.tile(forces_n, (len(heights), 1)), first)]
    areas = torch.as_tensor(area, dtype=torch.float64, device=surface.device)
    load_steps = press_columns(surface, *on_device, area=areas, settings=settings)
    moved = surface.double(load_steps.force).reshape(*surface.shape, -1)
    deformation = grid.with_held_sides(moved.permute(2, 0, 1).cpu().numpy())
    arrays = {field.name: getattr(load_steps, field.name).cpu().numpy() for field in fields(load_steps)}
    for press in range(len(heights)):
        own = slice(press * len(forces_n), (press + 1) * len(forces_n))
        contact = ContactLoadSteps(**{name: values[..., own] for name, values in arrays.items()})
        yield LayerPress(fields=deformation[own], areas=area, contact=contact)


def _depth_at_first(height, area, force_over_modulus):
    lowest, there = height.min(), height < NO_CONTACT_MM
    return lowest + depth_on_springs(height[there] - lowest, area[there], force_over_modulus)
