"""What an input file of Abaqus or CalculiX consists of: parts, instances, and in each nodes, elements, sets and surfaces.

Keywords that make nodes or elements by rules are refused; of the rest of the deck nothing is read.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.fem.files.abaqus_keywords import Block, fields, read_blocks

_BODY = re.compile(r"(C3D|CPE|CPEG|CPS|CAX|CGAX)(\d+)[RHIMSTPE]*")
_FACET = re.compile(r"(?:S|M3D|R3D|SFM3D|DS|STRI)(3|4|65?|8|9)(?:[RHTSW]+|5|R5|RT)?")
_LINE = re.compile(r"(?:T2D|B2|SAX|MAX|SFMAX|RAX|R2D)([123])[HT]*")
_LEFT_OUT = re.compile(r"(?:T2D|T3D|B\d|PIPE|ELBOW|FRAME|SPRING|DASHPOT|MASS|ROTARYI|CONN|JOINT|GAP|DCOUP|ITS|DRAG|HEATCAP|"
                       r"RB\dD).*")
_SHAPES = {("solid", 4): "tetra", ("solid", 10): "tetra10", ("solid", 8): "hexahedron", ("solid", 20): "hexahedron20",
           ("solid", 6): "wedge", ("solid", 15): "wedge15", ("solid", 5): "pyramid",
           ("plane", 3): "triangle", ("plane", 6): "triangle6", ("plane", 65): "triangle6", ("plane", 4): "quad",
           ("plane", 8): "quad8", ("plane", 9): "quad9"}
_NODES = {"line": 2, "line3": 3, "triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 9, "tetra": 4, "tetra10": 10,
          "hexahedron": 8, "hexahedron20": 20, "wedge": 6, "wedge15": 15, "pyramid": 5}
_THREE_NODES = {"T2D3", "B22", "SAX2", "MAX2", "SFMAX2"}
_MAKING = {"NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "PARAMETER", "IMPORT", "SYMMETRIC MODEL GENERATION",
           "SUBMODEL", "MESHED BEAM"}
_TOLD = ("MATERIAL", "TIE", "EQUATION", "MPC", "COUPLING", "RIGID BODY", "EMBEDDED ELEMENT", "CONTACT PAIR", "BOUNDARY", "STEP",
         "NSET")     # keywords that are told where a deck has them
TOP = ""     # the instance of what stands in no part


@dataclass
class ElementSet:
    """A set of elements or, where rows are pairs, a surface: members by number, range or name, each in an instance or None."""

    name: str
    internal: bool = False
    numbers: list[tuple[str | None, int]] = field(default_factory=list)
    ranges: list[tuple[str | None, int, int, int]] = field(default_factory=list)
    names: list[tuple[str | None, str, Block, int]] = field(default_factory=list)


@dataclass
class ElementSurface:
    """Rows of a surface on elements: (a number or the name of a set, side, the block and the line)."""

    name: str
    rows: list[tuple[str, str, Block, int]] = field(default_factory=list)


@dataclass
class Scope:
    """What stands in a part, in an instance, or outside both."""

    name: str
    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: list[tuple[str, list[list[int]]]] = field(default_factory=list)     # (kind, rows of number and nodes)
    sets: dict[str, ElementSet] = field(default_factory=dict)
    surfaces: dict[str, ElementSurface] = field(default_factory=dict)
    of_elements: set[str] = field(default_factory=set)      # sets that *ELEMENT lines name
    sections: dict[str, Block] = field(default_factory=dict)


@dataclass
class Instance:
    """An instance of a part: its scopes, its place, and from which number on its nodes stand in the mesh."""

    name: str
    scopes: list[Scope]
    place: list[list[float]] = field(default_factory=list)


class Deck:
    """The parts, instances, sets and surfaces of a deck, and what is left out of it.

    Raises InputError with file and line for what cannot be read right.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.top = Scope(TOP)
        self.parts: dict[str, Scope] = {}
        self.instances = {TOP: Instance(TOP, [self.top])}
        self.left_out: dict[str, int] = {}
        self.types: set[str] = set()
        self.told: set[str] = set()
        self.remarks: list[str] = []
        self._scope, self._in_step = self.top, False
        for block in read_blocks(path):
            self._take(block)
        self._place_parts()

    def _take(self, block: Block) -> None:
        if block.keyword in _TOLD:
            self.told.add(block.keyword)
        if self._in_step or block.keyword in ("STEP", "END STEP"):
            self._in_step = block.keyword != "END STEP"
            return
        if block.keyword in _MAKING:
            raise block.refusal(f"*{block.keyword} changes nodes or elements by a rule, which is not read; let the program write "
                                "the mesh with all its nodes and elements")
        taken = {"PART": self._part, "INSTANCE": self._instance, "NODE": self._nodes, "ELEMENT": self._elements,
                 "ELSET": self._elset, "SURFACE": self._surface, "SOLID SECTION": self._section}.get(block.keyword)
        if taken:
            taken(block)
        elif block.keyword in ("END PART", "END INSTANCE"):
            self._scope = self.top

    def _part(self, block):
        name = block.required("NAME")
        if name.upper() in self.parts:
            raise block.refusal(f"a second part is called {name!r}; rename one")
        self._scope = self.parts[name.upper()] = Scope(name)

    def _instance(self, block):
        if "LIBRARY" in block.parameters or "INSTANCE" in block.parameters:
            raise block.refusal("an instance from the results of another analysis is not read; write its mesh")
        name, part = block.required("NAME"), block.required("PART").upper()
        if name.upper() in self.instances:
            raise block.refusal(f"a second instance is called {name!r}; rename one")
        if part not in self.parts:
            raise block.refusal(f"there is no part {block.parameters['PART']!r} before it; the parts are "
                                f"{', '.join(one.name for one in self.parts.values()) or 'none'}")
        place = [block.numbers(text, line) for line, text in block.rows]
        if len(place) > 2 or any(len(row) > length for row, length in zip(place, (3, 7), strict=False)):
            raise block.refusal("the rows below *INSTANCE are a translation and a rotation, of three and seven numbers; correct "
                                "them")
        if not np.isfinite([value for row in place for value in row]).all():
            raise block.refusal("its place has a number that is not finite; correct it")
        self._scope = Scope(name)
        self.instances[name.upper()] = Instance(name, [self.parts[part], self._scope], place)

    def _nodes(self, block):
        if block.parameters.get("SYSTEM", "R").upper() != "R":
            raise block.refusal("nodes in cylindrical or spherical coordinates are not read; write them in Cartesian ones")
        nodes = self._scope.nodes
        for line, text in block.rows:
            number, *place = block.numbers(text, line)
            here = (*place[:3], 0.0, 0.0, 0.0)[:3]
            if not (0 < number < 2**31 and number == int(number)):
                raise block.refusal(f"{fields(text)[0]!r} is no number of a node; correct it", line)
            if nodes.setdefault(int(number), here) != here:
                raise block.refusal(f"node {int(number)} has a second place; leave one out", line)

    def _elements(self, block):
        type_ = block.required("TYPE").upper()
        kind = self._kind(block, type_)
        if kind is None:
            self.left_out[type_] = self.left_out.get(type_, 0) + len(block.rows)
            return
        self.types.add(type_)
        width, rows, row = 1 + _NODES[kind], [], []
        for line, text in block.rows:
            row += block.whole_numbers(text, line)
            if len(row) > width:
                raise block.refusal(f"an element {type_} has {len(row) - 1} nodes in place of {width - 1}; correct it", line)
            if len(row) == width:
                rows.append(row)
                row = []
        if row:
            raise block.refusal(f"its last element {type_} has {len(row) - 1} nodes in place of {width - 1}; correct it")
        self._scope.elements.append((kind, rows))
        if name := block.parameters.get("ELSET"):
            self._scope.of_elements.add(name.upper())
            self._set(name).numbers += [(None, row[0]) for row in rows]

    def _kind(self, block, type_):
        """meshio's name of the cells of an element type, None of those that are left out."""
        if found := _BODY.fullmatch(type_):
            kind = _SHAPES.get(("solid" if found[1] == "C3D" else "plane", int(found[2])))
        elif found := _FACET.fullmatch(type_):
            kind = _SHAPES.get(("plane", int(found[1])))
        elif _LINE.fullmatch(type_):
            kind = "line3" if type_.rstrip("HT") in _THREE_NODES else "line"
        elif _LEFT_OUT.fullmatch(type_):
            return None
        else:
            kind = None
        if kind is None:
            raise block.refusal(f"elements {type_} are not taken; use solid elements such as C3D10 or C3D8, or plane ones such as "
                                "CAX8 or CPE8")
        return kind

    def _set(self, name):
        return self._scope.sets.setdefault(name.upper(), ElementSet(name))

    def _elset(self, block):
        found = self._set(block.required("ELSET"))
        found.internal |= "INTERNAL" in block.parameters
        instance = block.parameters.get("INSTANCE")
        for line, text in block.rows:
            if "GENERATE" in block.parameters:
                first, last, step = (*block.whole_numbers(text, line), 1, 1)[:3] if len(fields(text)) > 1 else (1, 0, 0)
                if last < first or step < 1:
                    raise block.refusal(f"{text!r} is no range; write first, last and step", line)
                found.ranges.append((instance, first, last, step))
                continue
            for one in filter(None, fields(text)):
                owner, _, name = one.rpartition(".")
                owner = owner or instance
                if name.isdigit():
                    found.numbers.append((owner, int(name)))
                else:
                    found.names.append((owner, name, block, line))

    def _surface(self, block):
        name = block.required("NAME")
        if block.parameters.get("TYPE", "ELEMENT").upper() != "ELEMENT" or "COMBINE" in block.parameters:
            self.remarks.append(f"the surface {name}, which is not on sides of elements, is left out")
            return
        rows = self._scope.surfaces.setdefault(name.upper(), ElementSurface(name)).rows
        for line, text in block.rows:
            of, side = (*fields(text), "", "")[:2]
            if side.upper() not in ("", "SPOS", "SNEG", "S1", "S2", "S3", "S4", "S5", "S6"):
                raise block.refusal(f"{side!r} is no side of an element; write S1 to S6", line)
            rows.append((of, side.upper(), block, line))

    def _section(self, block):
        self._scope.sections[block.required("ELSET").upper()] = block

    def _place_parts(self):
        """A single part without an assembly is taken as it is."""
        used = {id(scope) for instance in self.instances.values() for scope in instance.scopes}
        without = {key: part for key, part in self.parts.items() if id(part) not in used}
        if len(without) == len(self.parts) == 1:
            (key, part), = without.items()
            self.instances[key] = Instance(part.name, [part])
        elif without and len(without) == len(self.parts):
            names = ", ".join(part.name for part in without.values())
            raise InputError(f"{self.path}: its parts {names} have no *INSTANCE; write the assembly, too.")
        else:
            self.remarks += [f"the part {part.name} has no instance and is left out" for part in without.values()]

    @property
    def geometry(self) -> str | None:
        """What plane elements stand for by their names, None where there are none or several."""
        names = [found[1] for type_ in self.types if (found := _BODY.fullmatch(type_)) and found[1] not in ("C3D", "CPS")]
        stated = {"axisymmetric" if "AX" in name else "plane_strain" for name in names}
        return stated.pop() if len(stated) == 1 else None


    def all_remarks(self) -> list[str]:
        """What is left out."""
        counts = [f"{count} {type_}" for type_, count in self.left_out.items()]
        return [*self.remarks, *([f"elements that are no part of a body are left out: {', '.join(counts)}"] if counts else []),
                *([f"left out of the deck: {', '.join('*' + one for one in _TOLD if one in self.told)}"] if self.told else [])]
