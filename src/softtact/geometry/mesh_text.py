"""The text of mesh files: in one encoding, with one line end."""

import math
from pathlib import Path

from softtact.errors import InputError

_UTF8_MARK, _UTF16_MARKS = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")


def is_text(data: bytes) -> bool:
    """Whether a file begins like text: with a mark of UTF-16, or without zero bytes, which binary numbers have."""
    return data.startswith(_UTF16_MARKS) or b"\0" not in data[:512]


def plain_text(path: Path, data: bytes) -> bytes:
    """The text without a byte-order mark, its lines separated by line feeds; UTF-16 raises InputError."""
    if data.startswith(_UTF16_MARKS):
        raise InputError(f"{path}: it is text in UTF-16; save it as UTF-8.")
    data = data.removeprefix(_UTF8_MARK)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def line_at(data: bytes, offset: int) -> int:
    """Number of the line, from 1, of a byte of a text."""
    return data.count(b"\n", 0, offset) + 1


def shown(word: bytes) -> str:
    """A word of a file, shortened for a message."""
    text = word.decode("utf-8", errors="replace")
    return repr(text if len(text) <= 40 else f"{text[:37]}...")


def is_finite(word: bytes) -> bool:
    """Whether a word is a finite number in the notation of text files."""
    try:
        return b"_" not in word and math.isfinite(float(word))     # Python reads 1_0 as a number
    except ValueError:
        return False


def no_number(path: Path, line: int, word: bytes) -> InputError:
    """The refusal of a word in place of a finite number."""
    remedy = "write decimals with points" if b"," in word else "export the mesh again"
    return InputError(f"{path}: line {line}: {shown(word)} is no finite number; {remedy}.")
