"""The free nodes of a sensor's surface, as a grid of four like quarters: with those on its sides where these are free."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NodeGrid:
    """Free nodes of a surface on lines x (nx,), y (ny,) in mm, symmetric about 0; numbered x fastest.

    sides: whether the outermost nodes lie on the surface's sides; else these are held and one step beyond
    """

    x: np.ndarray
    y: np.ndarray
    sides: bool = False

    def arrays(self) -> dict[str, np.ndarray]:
        """The grid as arrays by name, for a file; `of` reads them back."""
        return {"x": self.x, "y": self.y, "sides": np.array(self.sides)}

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> "NodeGrid":
        """The grid whose `arrays` these are."""
        return cls(arrays["x"], arrays["y"], bool(arrays["sides"]))

    @property
    def step(self) -> np.ndarray:
        """Distances (2,) of nodes in x and y."""
        return np.array([self.x[1] - self.x[0], self.y[1] - self.y[0]])

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return len(self.y), len(self.x)

    @property
    def points(self) -> np.ndarray:
        """All nodes (n, 2)."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1).reshape(-1, 2)

    @property
    def count(self) -> int:
        return len(self.x) * len(self.y)

    @property
    def every_second(self) -> "NodeGrid":
        """The grid of every second node with the middle one: the map's, without its outer rows and columns where these are held."""
        first = self.first_of_second
        return NodeGrid(self.x[first::2], self.y[first::2], self.sides)

    @property
    def first_of_second(self) -> int:
        """The place along both lines at which `every_second` begins."""
        return 0 if self.sides else 1

    @property
    def second_nodes(self) -> np.ndarray:
        """Numbers (m,) in this grid of the nodes of `every_second`."""
        first = self.first_of_second
        return np.arange(self.count).reshape(self.shape)[first::2, first::2].ravel()

    def areas(self, nodes: np.ndarray) -> np.ndarray:
        """Area (n,) in mm2 of the surface about each of nodes (n,): a rectangle of a step's sides, cut off at the surface's own."""
        return np.prod(self.step) * self.share_inside(nodes)

    def share_inside(self, nodes: np.ndarray) -> np.ndarray:
        """Which share (n,) of a node's rectangle lies on the surface: half at a side, a quarter at a corner, else all."""
        if not self.sides:
            return np.ones(len(nodes))
        j, i = np.divmod(nodes, len(self.x))
        return np.where((i == 0) | (i == len(self.x) - 1), 0.5, 1.0) * np.where((j == 0) | (j == len(self.y) - 1), 0.5, 1.0)

    def with_held_sides(self, fields: np.ndarray) -> np.ndarray:
        """Fields (..., ny, nx) of this grid on the map's points: with a border of zeros where its sides are held."""
        if self.sides:
            return fields
        return np.pad(fields, [(0, 0)] * (fields.ndim - 2) + [(1, 1), (1, 1)])

    def from_middle(self, nodes: np.ndarray) -> np.ndarray:
        """How many steps (n, 2) in x and y nodes (n,) lie from the middle."""
        j, i = np.divmod(nodes, len(self.x))
        return np.column_stack([i - len(self.x) // 2, j - len(self.y) // 2])

    def quarter(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of nodes (n,): their numbers (n,) in the quarter x, y >= 0, from the middle, x fastest; and signs (n, 2) of x and y."""
        place = self.from_middle(nodes)
        away = np.abs(place)
        return away[:, 1] * (len(self.x) // 2 + 1) + away[:, 0], np.where(place < 0, -1, 1)
