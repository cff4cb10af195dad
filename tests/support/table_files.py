"""Tables as programs write them, for tests of what reads them: one dialect drawn at random, and faults in the text."""

from dataclasses import dataclass

from hypothesis import strategies as st

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "cp1252")
LINE_ENDS = ("\n", "\r\n", "\r")


@dataclass(frozen=True)
class Dialect:
    """How a table is written; `above` are lines over its header."""

    separator: str = ","
    decimal: str = "."
    quoted: bool = False
    encoding: str = "utf-8"
    line_end: str = "\n"
    above: tuple = ()
    last_line_ends: bool = True

    def line(self, cells):
        """A row of text cells; a cell that holds the separator or a quote is quoted in any case."""
        quoted = [f'"{cell}"' if self.quoted or self.separator in cell else cell for cell in cells]
        return self.separator.join(quoted)

    def number(self, value, digits):
        """A number with so many decimals."""
        return f"{value:.{digits}f}".replace(".", self.decimal)

    def text(self, rows):
        """The whole file as text."""
        lines = [*self.above, *map(self.line, rows)]
        return self.line_end.join(lines) + self.line_end * self.last_line_ends

    def bytes(self, rows):
        """The whole file."""
        return self.text(rows).encode(self.encoding)


@st.composite
def dialects(draw, *, decimals=(".", ",")):
    """A `Dialect` that the documentation lists."""
    separator, decimal = draw(st.sampled_from(",;\t")), draw(st.sampled_from(decimals))
    stated = (f"sep={separator}",) * draw(st.booleans())
    return Dialect(separator, decimal, draw(st.booleans()) or separator == decimal, draw(st.sampled_from(ENCODINGS)),
                   draw(st.sampled_from(LINE_ENDS)), stated, draw(st.booleans()))


FAULTS = ("cell removed", "cell inserted", "separator changed", "cut off", "decimal changed", "name removed", "line removed")


@st.composite
def faults(draw, text, separator, line_end):
    """The text with one of `FAULTS`."""
    fault = draw(st.sampled_from(FAULTS))
    if fault == "cut off":
        return text[:draw(st.integers(0, len(text) - 1))]
    lines = text.split(line_end)
    filled = [k for k, line in enumerate(lines) if line]
    at = filled[0] if fault == "name removed" else draw(st.sampled_from(filled))
    cells = lines[at].split(separator)
    where = draw(st.integers(0, len(cells) - 1))
    if fault == "separator changed":
        lines[at] = lines[at].replace(separator, draw(st.sampled_from([other for other in ",;\t| " if other != separator])))
    elif fault == "decimal changed":
        lines[at] = lines[at].replace(".", ",")
    elif fault == "line removed":
        del lines[at]
    else:
        cells[where:where + (fault != "cell inserted")] = [""] * (fault == "cell inserted")
        lines[at] = separator.join(cells)
    return line_end.join(lines)
