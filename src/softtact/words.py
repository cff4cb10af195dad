"""Numbers in sentences for people."""

import math


def plain(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and no exponent, such as 0.0073, 123 or 4560."""
    if not math.isfinite(value) or value == 0:
        return f"{value:g}"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, decimals)
    text = f"{rounded:.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def numbered(count: int, noun: str) -> str:
    """A number of things, such as "1 test" or "2 bodies"."""
    plural = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{count} {noun if count == 1 else plural}"
