"""What the decks of both programs share: keyword lines, rows of numbers, and the parts of a model that they write alike."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from softtact.contact.friction import Coulomb
from softtact.contact.penalty import Contact
from softtact.decks.laws import LawCard
from softtact.decks.mesh import Tie
from softtact.decks.model import DeckModel

_PER_LINE = 16     # both programs read up to 16 numbers a line


def number(value: float) -> str:
    """A number in at most 20 characters: CalculiX reads no more of a field."""
    return f"{value:.12g}"


def rows(values: Iterable[float], *, per_line: int = _PER_LINE) -> str:
    """Numbers separated by commas, `per_line` a line; a line that goes on ends with a comma."""
    texts = [number(value) for value in values]
    lines = [", ".join(texts[k:k + per_line]) for k in range(0, len(texts), per_line)]
    return ",\n".join(lines)


def heading(model: DeckModel, program: str) -> list[str]:
    """Title, units and remarks."""
    lines = ["*HEADING", f"{model.title}; units: mm, N, MPa", f"** softtact export for {program}"]
    return lines + [f"** {remark}" for remark in model.remarks]


def nodes(points: Iterable[np.ndarray], first: int, *, name: str | None = None) -> list[str]:
    """*NODE with points (n, 3) numbered from `first`."""
    head = "*NODE" + (f", NSET={name}" if name else "")
    return [head] + [f"{first + k}, {number(x)}, {number(y)}, {number(z)}" for k, (x, y, z) in enumerate(points)]


def elements(kind: str, name: str, numbers: Iterable[int], connectivity: Iterable[np.ndarray]) -> list[str]:
    """*ELEMENT with the elements' numbers (e,) and nodes (e, k), both as they stand in the deck."""
    head = f"*ELEMENT, TYPE={kind}, ELSET={name}"
    return [head] + [rows([n, *row]) for n, row in zip(numbers, connectivity, strict=True)]


def node_set(name: str, numbers: np.ndarray) -> list[str]:
    """*NSET with the nodes' numbers as they stand in the deck."""
    return [f"*NSET, NSET={name}", rows(numbers)] if len(numbers) else []


def surface(name: str, faces: Iterable[Sequence[int]]) -> list[str]:
    """*SURFACE of element faces (f, 2): element number as it stands in the deck, and face."""
    return [f"*SURFACE, NAME={name}, TYPE=ELEMENT"] + [f"{element}, S{face}" for element, face in faces]


def equations(ties: Iterable[Tie]) -> list[str]:
    """One *EQUATION for all ties: for each component 0 = -slave + sum(weights * masters)."""
    return _equation([[(tie.slave + 1, component, -1.0), *((master + 1, component, weight)
                                                           for master, weight in zip(tie.masters, tie.weights, strict=True))]
                      for tie in ties for component in (1, 2, 3)])


def moving_along(nodes: Iterable[int], reference: int, component: int) -> list[str]:
    """One *EQUATION by which each node moves along a component (1..3) as the reference node does."""
    return _equation([[(node, component, -1.0), (reference, component, 1.0)] for node in nodes])


def _equation(sums):
    """*EQUATION of sums [(node, component, factor)] that are zero; the first node is eliminated. Four terms a line."""
    lines = ["*EQUATION"] if sums else []
    for terms in sums:
        texts = [f"{node}, {component}, {number(factor)}" for node, component, factor in terms]
        lines += [str(len(terms)), ",\n".join(", ".join(texts[k:k + 4]) for k in range(0, len(texts), 4))]
    return lines


def held(model: DeckModel) -> list[str]:
    """Data lines of *BOUNDARY for the rubber: node and one component."""
    return [f"{node + 1}, {component + 1}, {component + 1}" for node, component in model.held]


def material(name: str, card: LawCard) -> list[str]:
    """*MATERIAL with the constants of its law, eight a line."""
    return [f"*MATERIAL, NAME={name}", f"*{card.keyword}, {card.form}", rows(card.constants, per_line=8)]


def rubber(model: DeckModel, kinds: dict[str, str], wedge: str, cards: dict[str, LawCard]) -> list[str]:
    """Nodes, elements, sets, laws and surfaces of the rubber.

    kinds: type of the bricks by part;  wedge: type of the wedges;  cards: `LawCard` by part
    """
    lines = nodes(model.points, 1, name="RUBBER")
    for part in model.parts:
        lines += elements(kinds[part.name], part.name, part.hex_elements + 1, part.hexes + 1)
        if len(part.wedges):
            lines += elements(wedge, part.name, part.wedge_elements + 1, part.wedges + 1)
    for name, members in model.node_sets.items():
        lines += node_set(name, np.asarray(members) + 1)
    for part in model.parts:
        lines += material(f"RUBBER_{part.name}", cards[part.name])
        lines += [f"*SOLID SECTION, ELSET={part.name}, MATERIAL=RUBBER_{part.name}"]
    for name, faces in model.surfaces.items():
        lines += surface(name, np.asarray(faces) + [1, 0])
    return lines


def element_count(model: DeckModel) -> int:
    """Number of the rubber's elements."""
    return sum(len(part.elements) for part in model.parts)


def contacts(model: DeckModel, behaviour: Callable[[Contact], list[str]], friction: Callable[[Coulomb], list[str]]) -> list[str]:
    """Contact laws and pairs, slave surface first. A rigid body NAME has the surface NAME_SURFACE.

    behaviour(settings): the lines of *SURFACE BEHAVIOR for a pair's `Contact`;  friction(law): of *FRICTION for its `Coulomb`
    """
    lines, rigid = [], {body.name for body in model.rigid}
    for pair in model.contacts:
        master = f"{pair.master}_SURFACE" if pair.master in rigid else pair.master
        lines += [f"*SURFACE INTERACTION, NAME={pair.name}", *behaviour(pair.contact),
                  *(friction(pair.friction) if pair.friction else ()),
                  f"*CONTACT PAIR, INTERACTION={pair.name}, TYPE=SURFACE TO SURFACE", f"{pair.slave}, {master}"]
    return lines
