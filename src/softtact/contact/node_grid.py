"""The free nodes of a sensor's surface, as a grid of four like quarters."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NodeGrid:
    """Free nodes of a surface on lines x (nx,), y (ny,) in mm, symmetric about 0; numbered x fastest."""

    x: np.ndarray
    y: np.ndarray

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
        """The grid of every second node, from the second one on: the map's, without its outer rows and columns."""
        return NodeGrid(self.x[1::2], self.y[1::2])

    def from_middle(self, nodes: np.ndarray) -> np.ndarray:
        """How many steps (n, 2) in x and y nodes (n,) lie from the middle."""
        j, i = np.divmod(nodes, len(self.x))
        return np.column_stack([i - len(self.x) // 2, j - len(self.y) // 2])

    def quarter(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of nodes (n,): their numbers (n,) in the quarter x, y >= 0, from the middle, x fastest; and signs (n, 2) of x and y."""
        place = self.from_middle(nodes)
        away = np.abs(place)
        return away[:, 1] * (len(self.x) // 2 + 1) + away[:, 0], np.where(place < 0, -1, 1)
