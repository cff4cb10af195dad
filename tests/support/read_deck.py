"""Reading a deck of either dialect back, as far as `softtact` writes one: for comparison with what was meant."""

from dataclasses import dataclass, field
from pathlib import Path

from softtact.errors import InputError


@dataclass
class Deck:
    """What a deck says, with its own numbers (from 1).

    nodes {number: (x, y, z)}; elements {set: {type: {number: nodes}}}; node_sets {name: numbers}; materials {name: (form,
    constants)}; sections {element set: material}; surfaces {name: entries}; equations [[(node, component, factor)]];
    contacts [(slave, master, behaviour, table)]; friction {(slave, master): elastic slip where given, numbers};
    rigid_bodies {element set: reference node}; steps [DeckStep]
    """

    title: str = ""
    nodes: dict = field(default_factory=dict)
    elements: dict = field(default_factory=dict)
    node_sets: dict = field(default_factory=dict)
    materials: dict = field(default_factory=dict)
    sections: dict = field(default_factory=dict)
    surfaces: dict = field(default_factory=dict)
    equations: list = field(default_factory=list)
    contacts: list = field(default_factory=list)
    friction: dict = field(default_factory=dict)
    rigid_bodies: dict = field(default_factory=dict)
    steps: list = field(default_factory=list)


@dataclass
class DeckStep:
    """name; `boundary` rows (node or set, first component, last component, value); `loads` rows (node, component, value);
    `pressures` rows (element, face such as P1, MPa)."""

    name: str
    boundary: list = field(default_factory=list)
    loads: list = field(default_factory=list)
    pressures: list = field(default_factory=list)


def read_deck(path: Path) -> Deck:
    """The `Deck` of a file."""
    deck, behaviours, frictions, comment = Deck(), {}, {}, ""
    current = {"material": "", "interaction": ""}
    for keyword, options, data, before in _blocks(path):
        comment = before or comment
        reader = _READERS.get(keyword)
        if reader:
            reader(deck, options, data, current)
        elif keyword == "SURFACE BEHAVIOR":
            behaviours[current["interaction"]] = (options["PRESSURE-OVERCLOSURE"], [_floats(line) for line in data])
        elif keyword == "FRICTION":
            frictions[current["interaction"]] = [*_floats(options.get("ELASTIC SLIP", "")), *_floats(data[0])]
        elif keyword == "CONTACT PAIR":
            slave, master = _fields(data[0])
            if options["INTERACTION"] in frictions:
                deck.friction[slave, master] = frictions[options["INTERACTION"]]
            deck.contacts.append((slave, master, *behaviours[options["INTERACTION"]]))
        elif keyword == "STEP":
            deck.steps.append(DeckStep(options.get("NAME") or comment))
    return deck


def _blocks(path):
    """(keyword, options, data lines, step name in the comment before it) of each keyword."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable deck ({error}).") from None
    block, comment = None, ""
    for line in lines:
        if line.startswith("**"):
            comment = line.removeprefix("** STEP: ") if line.startswith("** STEP: ") else comment
        elif line.startswith("*"):
            if block:
                yield block
            keyword, *options = _fields(line[1:])
            pairs = (option.partition("=") for option in options)
            block = (keyword.upper(), {key.strip().upper(): value.strip() for key, _, value in pairs}, [], comment)
            comment = ""
        elif block:
            block[2].append(line)
    if block:
        yield block


def _fields(line):
    return [text.strip() for text in line.split(",") if text.strip()]


def _floats(line):
    return [float(text) for text in _fields(line)]


def _joined(data):
    """Data lines, those that end with a comma joined with the next."""
    whole = ""
    for line in data:
        whole += line
        if not line.rstrip().endswith(","):
            yield whole
            whole = ""


def _heading(deck, options, data, current):
    deck.title = data[0]


def _node(deck, options, data, current):
    rows = [_floats(line) for line in data]
    deck.nodes |= {int(number): tuple(position) for number, *position in rows}
    if "NSET" in options:
        deck.node_sets[options["NSET"]] = [int(row[0]) for row in rows]


def _element(deck, options, data, current):
    rows = [[int(text) for text in _fields(line)] for line in _joined(data)]
    kinds = deck.elements.setdefault(options["ELSET"], {})
    kinds.setdefault(options["TYPE"], {}).update({number: nodes for number, *nodes in rows})


def _nset(deck, options, data, current):
    deck.node_sets[options["NSET"]] = [int(text) for line in _joined(data) for text in _fields(line)]


def _surface(deck, options, data, current):
    deck.surfaces[options["NAME"]] = [tuple(_fields(line)) for line in data]


def _material(deck, options, data, current):
    current["material"] = options["NAME"]


def _hyperelastic(deck, options, data, current):
    terms = options.pop("N", None)
    form = ", ".join(options) + (f", N={terms}" if terms else "")
    deck.materials[current["material"]] = (form, [float(text) for line in _joined(data) for text in _fields(line)])


def _foam(deck, options, data, current):
    deck.materials[current["material"]] = (f"HYPERFOAM, N={options['N']}", [float(text) for line in _joined(data)
                                                                           for text in _fields(line)])


def _pressure(deck, options, data, current):
    deck.steps[-1].pressures += [(int(element), face, float(value)) for element, face, value in map(_fields, data)]


def _section(deck, options, data, current):
    deck.sections[options["ELSET"]] = options["MATERIAL"]


def _equation(deck, options, data, current):
    lines = iter(_joined(data))
    for count in lines:
        values = _floats(next(lines, ""))
        terms = list(zip(map(int, values[0::3]), map(int, values[1::3]), values[2::3], strict=True))
        if len(terms) != int(count):
            raise InputError(f"An equation announces {count} terms and has {len(terms)}; write the deck again.")
        deck.equations.append(terms)


def _interaction(deck, options, data, current):
    current["interaction"] = options["NAME"]


def _rigid(deck, options, data, current):
    deck.rigid_bodies[options["ELSET"]] = int(options["REF NODE"])


def _boundary(deck, options, data, current):
    for line in data:
        node, first, *rest = _fields(line)
        last = int(rest[0]) if rest else int(first)
        deck.steps[-1].boundary.append((node, int(first), last, float(rest[1]) if len(rest) > 1 else 0.0))


def _load(deck, options, data, current):
    deck.steps[-1].loads += [(node, int(component), float(value)) for node, component, value in map(_fields, data)]


_READERS = {"HEADING": _heading, "NODE": _node, "ELEMENT": _element, "NSET": _nset, "SURFACE": _surface, "MATERIAL": _material,
            "HYPERELASTIC": _hyperelastic, "HYPERFOAM": _foam, "DLOAD": _pressure, "SOLID SECTION": _section, "EQUATION": _equation,
            "SURFACE INTERACTION": _interaction, "RIGID BODY": _rigid, "BOUNDARY": _boundary, "CLOAD": _load}
