"""Material cards, and the laws made from them: what every stage after the fit reads (docs/materials.md)."""

from softtact.errors import InputError
from softtact.files import read_json
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants
from softtact.materials.windows import principal_window


def load_card(path):
    """Read a card; a file that is none is refused."""
    card = read_json(path)
    missing = [key for key in ("material", "kind", "chosen", "laws") if key not in card]
    if missing:
        raise InputError(f"{path}: not a material card, it lacks {', '.join(missing)}; write it with `softtact fit`.")
    return card


def law_from_card(card, law=None):
    """The `Law` of a card: the chosen one, or the one named. It warns where it is used outside the card's strain window."""
    name = law or card["chosen"]
    available = [key for key in card["laws"] if key != "linear"]
    if name not in available:
        raise InputError(
            f"The card of material {card['material']} has no hyperelastic law {name!r}; it has {', '.join(available)}."
        )
    made = law_of_entry(name, card["laws"][name])
    made.stretch_window = principal_window(card.get("strain_window", {}))
    return made


def law_of_entry(name, entry):
    """The `Law` of one entry of a card, without a window of its own."""
    return make_law(name, entry["parameters"], bulk_modulus=entry["bulk_modulus_mpa"])


def linear_from_card(card):
    """The `LinearConstants` (E, nu) of a card."""
    if "linear" not in card["laws"]:
        raise InputError(
            f"The card of material {card['material']} has no linear constants;"
            " fit it with a uniaxial curve and a stated poisson."
        )
    return LinearConstants(**card["laws"]["linear"]["parameters"])
