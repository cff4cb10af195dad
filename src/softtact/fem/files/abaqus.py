"""Input files of Abaqus and CalculiX: nodes, elements, sets and surfaces of the whole assembly.

A part is read once for each of its instances, moved and turned as its rows say. Sets may hold sets, may be continued under one
name, and may be defined after what uses them. A surface on sides of elements becomes a face. The regions are the sets that
*SOLID SECTION names; without those the sets of *ELEMENT lines if each element is in one; else all sets.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.fem.files.abaqus_deck import Deck, ElementSet, ElementSurface
from softtact.fem.files.raw_mesh import Flags, RawMesh, corners_of, dimension_of, side_corners


@dataclass
class _Cells:
    """Elements of an instance and of one kind."""

    instance: str
    kind: str
    numbers: np.ndarray
    nodes: np.ndarray


def read_abaqus(path: Path) -> RawMesh:
    """The `RawMesh` of a deck. Raises InputError with file and line for what cannot be read right."""
    return _Assembly(Deck(path)).mesh()


class _Assembly:
    """The elements of all instances of a deck."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.points, self.cells = self._assembled()

    def _assembled(self):
        points, cells, first = [np.zeros((0, 3))], [], 0
        for key, instance in self.deck.instances.items():
            nodes: dict[int, tuple[float, ...]] = {}
            for scope in instance.scopes:
                nodes |= scope.nodes
            numbers, at = np.array(sorted(nodes), dtype=np.int64), np.array([nodes[one] for one in sorted(nodes)]).reshape(-1, 3)
            for kind, rows in _by_kind(instance.scopes):
                table = np.array(rows, dtype=np.int64)
                cells.append(_Cells(key, kind, table[:, 0], first + self._numbered(instance, table, numbers)))
            points.append(_placed(at, instance.place))
            first += len(at)
        for key, instance in self.deck.instances.items():
            _refuse_repeated(self.deck.path, instance.name, [one.numbers for one in cells if one.instance == key])
        return np.concatenate(points), cells

    def _numbered(self, instance, table, numbers):
        """Positions of the elements' nodes among the instance's node numbers."""
        nodes = table[:, 1:]
        at = np.searchsorted(numbers, nodes).clip(0, max(len(numbers) - 1, 0))
        missing = numbers[at] != nodes if len(numbers) else np.ones(nodes.shape, dtype=bool)
        if missing.any():
            row, column = np.argwhere(missing)[0]
            of = f" of the instance {instance.name}" if instance.name else ""
            raise InputError(f"{self.deck.path}: element {table[row, 0]}{of} has the node {nodes[row, column]}, which is not "
                             "defined; write all nodes.")
        return at

    # --- sets and surfaces ---

    def _flags(self, key: str, name: str, seen: tuple = ()) -> Flags:
        """Which elements of all cells belong to a set of an instance."""
        flags = [np.zeros(len(cells.numbers), dtype=bool) for cells in self.cells]
        if (key, name) in seen:
            raise InputError(f"{self.deck.path}: the set {name} contains itself; correct its rows.")
        for found in self._sets_of(key).get(name, []):
            by_instance: dict[str, list[int]] = {}
            for owner, number in found.numbers:
                by_instance.setdefault(self._owner(key, owner), []).append(number)
            for cells, chosen in zip(self.cells, flags, strict=True):
                if cells.instance in by_instance:
                    chosen |= np.isin(cells.numbers, by_instance[cells.instance])
                for owner, first, last, step in found.ranges:
                    if cells.instance == self._owner(key, owner):
                        chosen |= (cells.numbers >= first) & (cells.numbers <= last) & ((cells.numbers - first) % step == 0)
            for owner, inner, block, line in found.names:
                place = self._owner(key, owner)
                if inner.upper() not in self._sets_of(place):
                    raise block.refusal(f"there is no set {inner!r} of elements; define it, or correct the name", line)
                for chosen, more in zip(flags, self._flags(place, inner.upper(), (*seen, (key, name))), strict=True):
                    chosen |= more
        return flags

    def _owner(self, key, owner):
        if owner is None:
            return key
        if owner.upper() not in self.deck.instances:
            raise InputError(f"{self.deck.path}: there is no instance {owner!r}, which a set names; the instances are "
                             f"{', '.join(one.name for one in self.deck.instances.values() if one.name) or 'none'}.")
        return owner.upper()

    def _sets_of(self, key: str) -> dict[str, list[ElementSet]]:
        found: dict[str, list[ElementSet]] = {}
        for scope in self.deck.instances[key].scopes:
            for name, one in scope.sets.items():
                found.setdefault(name, []).append(one)
        return found

    def _corners(self, key: str, surface: ElementSurface) -> list[np.ndarray]:
        """Corners (f, k) of the sides of elements that make a surface."""
        found = []
        for of, side, block, line in surface.rows:
            owner, _, name = of.rpartition(".")
            place = self._owner(key, owner or None)
            if name.isdigit():
                flags = [(cells.numbers == int(name)) & (cells.instance == place) for cells in self.cells]
                lost = f"the surface {surface.name} is without element {of}, which is not among the elements that are read"
                if not any(chosen.any() for chosen in flags) and lost not in self.deck.remarks:
                    self.deck.remarks.append(lost)
            elif name.upper() in self._sets_of(place):
                flags = self._flags(place, name.upper())
            else:
                raise block.refusal(f"there is no set {of!r} of elements; define it, or correct the name", line)
            found += [corners for cells, chosen in zip(self.cells, flags, strict=True) if chosen.any()
                      for corners in self._sides(cells, chosen, side, block, line)]
        return found

    def _sides(self, cells, chosen, side, block, line) -> Iterator[np.ndarray]:
        sides, nodes = side_corners(cells.kind), cells.nodes[chosen]
        if dimension_of(cells.kind) < self.dimension:      # facets: shells and membranes
            yield nodes[:, :corners_of(cells.kind)]
        elif side in ("", "SPOS", "SNEG"):
            for columns in sides:
                facets = nodes[:, columns]
                yield facets[[tuple(sorted(facet)) in self._outside for facet in facets.tolist()]]
        elif int(side[1:]) > len(sides):
            raise block.refusal(f"elements of {len(sides)} sides have no side {side}; correct it", line)
        else:
            yield nodes[:, sides[int(side[1:]) - 1]]

    @cached_property
    def dimension(self) -> int:
        """Dimension of the elements of the body."""
        return max((dimension_of(cells.kind) for cells in self.cells), default=0)

    @cached_property
    def _outside(self) -> set[tuple[int, ...]]:
        """Sorted corners of all sides that belong to one element only."""
        sides = [tuple(facet) for cells in self.cells if dimension_of(cells.kind) == self.dimension
                 for columns in side_corners(cells.kind) for facet in np.sort(cells.nodes[:, columns], axis=1).tolist()]
        return {facet for facet, count in Counter(sides).items() if count == 1}

    # --- the mesh ---

    def mesh(self) -> RawMesh:
        """The deck as a `RawMesh`."""
        sets = self._labelled("sets")
        body = [dimension_of(cells.kind) == self.dimension for cells in self.cells]
        regions, faces, sides, shown = {}, {}, {}, []
        for label, (members, internal) in sets.items():
            flags = [np.zeros(len(cells.numbers), dtype=bool) for cells in self.cells]
            for key, name in members:
                for chosen, more in zip(flags, self._flags(key, name), strict=True):
                    chosen |= more
            if any(chosen.any() for chosen, of_body in zip(flags, body, strict=True) if of_body):
                regions[label] = [chosen & of_body for chosen, of_body in zip(flags, body, strict=True)]
                shown += [] if internal else [label]
            if any(chosen.any() for chosen, of_body in zip(flags, body, strict=True) if not of_body) and not internal:
                faces[label] = [chosen & (not of_body) for chosen, of_body in zip(flags, body, strict=True)]
        for label, (members, _) in self._labelled("surfaces").items():
            sides[label] = [corners for key, name in members for scope in self.deck.instances[key].scopes if name in scope.surfaces
                            for corners in self._corners(key, scope.surfaces[name])]
        return RawMesh(self.points, [(cells.kind, cells.nodes) for cells in self.cells], regions, faces, sides,
                       default_regions=self._default(sets, regions, shown),
                       geometry=self.deck.geometry if self.dimension == 2 else None, remarks=self.deck.all_remarks())

    def _labelled(self, what) -> dict[str, tuple[list[tuple[str, str]], bool]]:
        """{label: ([(instance, name)], internal)} of sets or surfaces: those of one part's instances are one.

        Where several parts have the same name, that of the part precedes it.
        """
        owners: dict[str, dict[str, tuple[str, str, list, bool]]] = {}
        for key, instance in self.deck.instances.items():
            for scope in instance.scopes:
                for name, one in getattr(scope, what).items():
                    new: tuple[str, str, list, bool] = (scope.name, one.name, [], getattr(one, "internal", False))
                    owners.setdefault(name, {}).setdefault(scope.name.upper(), new)[2].append((key, name))
        found = {}
        for of in owners.values():
            for owner, name, members, internal in of.values():
                found[f"{owner}.{name}" if owner and len(of) > 1 else name] = (members, internal)
        return found

    def _default(self, sets, regions, shown) -> list[str]:
        """The sets that are regions: of sections, or of *ELEMENT lines, or all that are shown."""
        scopes = [(key, scope) for key, instance in self.deck.instances.items() for scope in instance.scopes]
        of_sections = {(key, name) for key, scope in scopes for name in scope.sections}
        of_lines = {(key, name) for key, scope in scopes for name in scope.of_elements}
        for wanted in (of_sections, of_lines):
            named = [label for label in regions if wanted.intersection(sets[label][0])]
            if not named:
                continue
            uses = [np.sum([regions[label][k] for label in named], axis=0) for k, cells in enumerate(self.cells)
                    if dimension_of(cells.kind) == self.dimension]
            if wanted is of_sections or all((use == 1).all() for use in uses):
                return named
        return shown


def _by_kind(scopes):
    """(kind, rows) of the elements of scopes, in their order, those of one kind joined."""
    rows: dict[str, list] = {}
    for scope in scopes:
        for kind, more in scope.elements:
            rows.setdefault(kind, []).extend(more)
    return [(kind, found) for kind, found in rows.items() if found]


def _refuse_repeated(path, instance, numbers):
    found, counts = np.unique(np.concatenate([*numbers, np.zeros(0, np.int64)]), return_counts=True)
    if (counts > 1).any():
        of = f" of the instance {instance}" if instance else ""
        raise InputError(f"{path}: element {found[counts.argmax()]}{of} is defined {counts.max()} times; give each element a "
                         "number of its own.")


def _placed(points, place):
    """Points (n, 3) moved by the first row of an instance and turned about the axis of the second, by degrees."""
    if place:
        points = points + [*place[0], 0.0, 0.0, 0.0][:3]
    if len(place) < 2:
        return points
    turn = np.array([*place[1], *[0.0] * 7])
    a, b, angle = turn[:3], turn[3:6], np.radians(turn[6])
    length = np.linalg.norm(b - a)
    if length == 0:
        return points
    axis, arm = (b - a) / length, points - a
    return a + arm * np.cos(angle) + np.cross(axis, arm) * np.sin(angle) + np.outer(arm @ axis, axis) * (1 - np.cos(angle))
