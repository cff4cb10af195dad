"""Material cards, and the laws made from them, for all stages after the fit (docs/reference/materials.md)."""

from pathlib import Path
from typing import Annotated, Any

import pydantic

from softtact.errors import InputError
from softtact.files import digest, read_json, write_json
from softtact.materials.config import validated
from softtact.materials.curves import principal_window
from softtact.materials.inelastic import Inelastic
from softtact.materials.laws.base import SIMPLE_SHEAR, Law
from softtact.materials.laws.registry import FOAM_LAWS, make_law
from softtact.materials.linear import LinearConstants
from softtact.materials.mullins import Mullins
from softtact.materials.prony import PronySeries


def _positive(windows):
    if mode := next((mode for mode, (low, _) in windows.items() if mode != SIMPLE_SHEAR and low <= 0), None):
        raise ValueError(f"the window of {mode} is of stretches or volume ratios, above 0")
    return windows


_Window = Annotated[list[pydantic.FiniteFloat], pydantic.Field(min_length=2, max_length=2)]


class _CardLaw(pydantic.BaseModel):
    """The part of a card's law that presses use."""

    model_config = pydantic.ConfigDict(strict=True)
    parameters: dict[str, pydantic.FiniteFloat]
    bulk_modulus_mpa: pydantic.FiniteFloat | None = None


class CardMullins(pydantic.BaseModel):
    """The constants of the Mullins effect."""

    model_config = pydantic.ConfigDict(strict=True)
    r: pydantic.FiniteFloat
    m_mpa: pydantic.FiniteFloat
    beta: pydantic.FiniteFloat


class CardProny(pydantic.BaseModel):
    """The Prony series of the shear modulus."""

    model_config = pydantic.ConfigDict(strict=True)
    g: list[pydantic.FiniteFloat]
    tau_s: list[pydantic.FiniteFloat]
    moduli: str


class _Card(pydantic.BaseModel):
    """The part of a card that presses use."""

    model_config = pydantic.ConfigDict(strict=True)
    material: str
    kind: str
    chosen: str
    laws: dict[str, _CardLaw]
    strain_window: Annotated[dict[str, _Window], pydantic.AfterValidator(_positive)] = {}
    mullins: CardMullins | None = None
    prony: CardProny | None = None


def write_card(path: str | Path, card: dict[str, Any]) -> None:
    """Write a card as JSON with a digest of its contents."""
    write_json(path, card | {"digest": digest(card)})


def load_card(path: str | Path) -> dict[str, Any]:
    """Read a card, the mapping that `write_card` wrote; others are refused, and one whose contents do not fit its digest."""
    card = read_json(path)
    stated = card.pop("digest", None) if isinstance(card, dict) else None
    if stated is not None and stated != digest(card):
        raise InputError(f"{path}, field 'digest': the contents are not those that were written; delete the field if you edited "
                         "them on purpose, else take a copy of the file or fit again.")
    missing = [key for key in ("material", "kind", "chosen", "laws") if not isinstance(card, dict) or key not in card]
    if missing:
        raise InputError(f"{path}: not a material card, it lacks {', '.join(missing)}; write it with `softtact fit`.")
    validated(_Card, card, where=str(path))
    try:
        inelastic_of(card)
    except InputError as error:     # of constants: the message does not name the file
        raise InputError(f"{path}: {error}") from None
    return card


def mullins_from_card(card: dict[str, Any]) -> Mullins | None:
    """The `Mullins` softening of a card, which acts on its chosen law; None for a card without."""
    block = card.get("mullins")
    return None if block is None else Mullins(**CardMullins(**block).model_dump())


def prony_from_card(card: dict[str, Any]) -> PronySeries | None:
    """The `PronySeries` of a card; None for a card without."""
    block = card.get("prony")
    return None if block is None else PronySeries(**CardProny(**block).model_dump())


def inelastic_of(card: dict[str, Any]) -> Inelastic | None:
    """Softening and relaxation of a card, or of the blocks `mullins` and `prony` alone; None without both."""
    mullins, prony = mullins_from_card(card), prony_from_card(card)
    return Inelastic(mullins, prony) if mullins or prony else None


def law_from_card(card: dict[str, Any], law: str | None = None) -> Law:
    """The `Law` of a card: the chosen one, or the one named. It warns where it is used outside the card's strain window.

    Raises InputError for a law that the card does not have, and for another one than that whose softening (`mullins`) it states.
    """
    name = law or card["chosen"]
    available = [key for key in card["laws"] if key != "linear"]
    if name not in available:
        raise InputError(
            f"The card of material {card['material']} has no hyperelastic law {name!r}; it has {', '.join(available)}."
        )
    softened = (card.get("mullins") or {}).get("law", card["chosen"])
    if card.get("mullins") and name != softened:
        raise InputError(f"The card of material {card['material']} states the Mullins effect of its law {softened!r}, which is not "
                         f"that of {name!r}; take {softened!r}, or fit the cycles again with {name!r} chosen.")
    try:
        made = law_of_entry(name, card["laws"][name])
    except InputError as error:     # of constants: the message does not name the card
        raise InputError(f"The card of material {card['material']}: {error}") from None
    made.stretch_window = principal_window(card.get("strain_window", {}))
    made.inelastic = inelastic_of(card)
    return made


def law_of_entry(name: str, entry: dict[str, Any]) -> Law:
    """The `Law` of one entry of a card, without a window."""
    if entry.get("bulk_modulus_mpa") is None and name not in FOAM_LAWS:
        raise InputError(f"The card's law {name} has no bulk_modulus_mpa; write the card again with `softtact fit`.")
    return make_law(name, entry["parameters"], bulk_modulus=entry.get("bulk_modulus_mpa"))


def linear_from_card(card: dict[str, Any]) -> LinearConstants:
    """The `LinearConstants` (E, nu) of a card."""
    if "linear" not in card["laws"]:
        raise InputError(
            f"The card of material {card['material']} has no linear constants;"
            " fit it with a uniaxial curve and a stated poisson."
        )
    return LinearConstants.of(card["laws"]["linear"]["parameters"])
