"""Elimination of the inner unknowns of many like bodies layer by layer: a layer's Schur complement is an element of the next layer.

Layers share only their common planes, so this takes half the operations and memory of one dense matrix for each body.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from softtact.fem.static_condensation import Condensation, Springs, packed
from softtact.linalg.workers import SERIAL, Workers


@dataclass(frozen=True)
class Stage:
    """The elimination of one layer: a body's eliminated unknowns inner (i,), its remaining ones outer (o,), and the matrices.

    place (n + 1,): row of each of a body's unknowns in the layer's matrix, -1 if absent; the last entry is for no unknown (-1)
    """

    inner: np.ndarray
    outer: np.ndarray
    place: np.ndarray
    condensed: Condensation


class LayerwiseElimination:
    """Bodies with unknowns numbered from 0 to n - 1 in each; `outer` are the ones that remain at the end, in rising order."""

    def __init__(self, bodies: int, inner: np.ndarray, layers: Sequence[Sequence[np.ndarray]], *,
                 coupled: Sequence[np.ndarray] | None = None) -> None:
        """inner (n,): whether an unknown is eliminated

        layers: layer by layer the unknowns (k, w) of each group of like elements, -1 where fixed
        coupled: layer by layer the unknowns that its springs act on, in addition to those of its elements
        """
        coupled = [np.zeros(0, dtype=np.int64)] * len(layers) if coupled is None else coupled
        members = [_members([*groups, also]) for groups, also in zip(layers, coupled, strict=True)]
        self.stages, left = [], np.zeros(0, dtype=np.int64)
        for k, groups in enumerate(layers):
            here = np.union1d(left, members[k])
            ends = inner[here] & ~np.isin(here, _members(members[k + 1:]))
            eliminated, carried, left = here[ends], left, here[~ends]
            place = np.full(len(inner) + 1, -1, dtype=np.int64)
            place[np.concatenate([eliminated, left])] = np.arange(len(here))
            elements = [place[group] for group in groups] + ([place[carried][None]] if k else [])
            condensed = Condensation(bodies, len(eliminated), len(left), elements)
            self.stages.append(Stage(inner=eliminated, outer=left, place=place, condensed=condensed))
        self.outer = left

    @property
    def matrices(self) -> np.ndarray:
        """Schur complement (bodies, m, m) of each body on the m `outer` unknowns."""
        return self.last.outer

    @property
    def last(self) -> Condensation:
        """The last layer, whose Schur complements are `matrices`."""
        return self.stages[-1].condensed

    def set(self, bodies: np.ndarray, layers: Iterable[tuple[Sequence[np.ndarray], Springs | None]], *,
            damping: np.ndarray | None = None) -> None:
        """Repeat the elimination in the given bodies (b,).

        layers: for each layer the tangents of its groups and its `Springs` or None, taken one after the other
        For these and the damping see `Condensation.set`.
        """
        carried: list[np.ndarray] = []
        for stage, (tangents, springs) in zip(self.stages, layers, strict=True):
            stage.condensed.set(bodies, [*tangents, *carried], springs, damping=damping)
            carried = [packed(stage.condensed.outer[bodies][:, None])]

    def residual(self, force: np.ndarray, *, bodies: np.ndarray | None = None, workers: Workers = SERIAL) -> list[np.ndarray]:
        """Eliminate the inner forces (b, n) of some bodies (b,), or of all, in place; returns the forward-solved right-hand sides
        that `recover` needs."""
        forward_solved = []
        for stage in self.stages:
            passed_on, half = stage.condensed.residual(force[:, stage.inner], bodies=bodies, workers=workers)
            force[:, stage.outer] += passed_on
            forward_solved.append(half)
        return forward_solved

    def recover(self, forward_solved: Sequence[np.ndarray], step: np.ndarray, *, bodies: np.ndarray | None = None,
                workers: Workers = SERIAL) -> None:
        """Compute the inner unknowns of a Newton step (b, n) of some bodies, or of all, from the outer ones, in place."""
        for stage, half in zip(self.stages[::-1], forward_solved[::-1], strict=True):
            step[:, stage.inner] = stage.condensed.recover(half, step[:, stage.outer], bodies=bodies, workers=workers)


def _members(groups):
    """All unknowns in arrays of any shape, each once, in rising order."""
    unknowns = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(group.ravel() for group in groups)]))
    return unknowns[unknowns >= 0]
