"""A report as one HTML file: what was asked, found, how sure it is, what is synthetic; figures, tables and claims with their files.

Figures are embedded; the page loads nothing from elsewhere.
"""

import base64
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd
from markupsafe import Markup

import softtact
from softtact.files import atomic_path, read_csv
from softtact.reporting.page_template import SCRIPT, STYLE, TEMPLATE
from softtact.reporting.run_record import machine
from softtact.reporting.words import header, in_words

Links = Sequence[tuple[str, Sequence[tuple[str, str]]]]
"""Groups of links: a label ("" for none), and (text, address) of each link."""

Sentences = str | Iterable[str | tuple[str, str | Path | None]]
"""One sentence or several, each alone or with the file that holds its numbers, or with a place of a page, such as "#design"."""

CONFIGURATION = "#configuration"
"""The place of a page that `Page.configuration` makes."""
_MOST_LINKS = 4      # of a group below a figure; the others are folded


class Page:
    """A report with parts in the order in which they are added; a part without content is left out.

    title, name: of the heading, the name in italics;  folder: of the page, to which links are relative
    """

    def __init__(self, title: str, name: str, *, folder: str | Path) -> None:
        self.title, self.name, self.folder = title, name, Path(folder)
        self._parts: list[dict] = []
        self._other_pages: list[tuple[str, str]] = []

    def link(self, path: str | Path) -> str:
        """The address of a file relative to the page."""
        return os.path.relpath(path, self.folder)

    def text(self, text: str, *, links: Links = ()) -> None:
        """A paragraph, followed by its links."""
        if text or links:
            self._add("text", text=text, links=links)

    def opening(self, *, asked: Sentences, found: Sentences, sure: Sentences = (), synthetic: Sentences = ()) -> None:
        """The head of the page: what was asked, what was found, how sure that is, what is synthetic."""
        named = (("What was asked", "asked", asked), ("What was found", "found", found), ("How sure this is", "sure", sure),
                 ("What is synthetic", "synthetic", synthetic))
        blocks = [(heading, style, items) for heading, style, given in named if (items := self._items(given))]
        self._add("opening", blocks=blocks)

    def section(self, title: str, *, anchor: str | None = None) -> None:
        """A heading with a link in the navigation; its anchor is by default its first word."""
        self._add("section", title=title, anchor=anchor or title.split()[0].lower())

    def other_page(self, text: str, address: str) -> None:
        """A link to another page, at the end of the navigation."""
        self._other_pages.append((text, address))

    def figure(self, source: Path | bytes, caption: str, *, remark: str = "", links: Links = ()) -> None:
        """A picture inside the page: a PNG, as bytes or as a file with its SVG beside it, or a file of HTML.

        caption: below the picture, and its alternative text;  remark: after the caption
        """
        about = {"caption": caption, "remark": remark}
        if isinstance(source, bytes):
            self._add("figure", anchor="", links=links, image=base64.b64encode(source).decode(), **about)
            return
        files = [source, *([source.with_suffix(".svg")] if source.with_suffix(".svg").is_file() else [])]
        shown = ({"html": Markup(source.read_text(encoding="utf-8"))} if source.suffix == ".html" else
                 {"image": base64.b64encode(source.read_bytes()).decode()})
        named = [(path.suffix[1:].upper(), self.link(path)) for path in files]
        self._add("figure", anchor=source.stem, links=[("", named), *links], **about, **shown)

    def table(self, frame: pd.DataFrame, title: str = "", *, file: str | Path | None = None, links: Links = (),
              most_rows: int | None = None) -> None:
        """A table with its columns and values in words; file: of the same as CSV; of many rows the first `most_rows`."""
        shown = frame.iloc[:most_rows]
        headings = [(header(name), pd.api.types.is_numeric_dtype(kind) and not pd.api.types.is_bool_dtype(kind))
                    for name, kind in frame.dtypes.items()]
        remark = f"The first {len(shown)} of {len(frame)} rows." if len(shown) < len(frame) else ""
        self._add("table", title=title, headings=headings, remark=remark, links=[*_csv(file and self.link(file)), *links],
                  rows=[[in_words(value) for value in row] for row in shown.itertuples(index=False, name=None)])

    def figures(self, captioned: Iterable[tuple[Path, str]]) -> None:
        """The section of a study's figures: file and caption of each."""
        self.section("Figures")
        for path, caption in captioned:
            self.figure(path, caption)

    def tables(self, titles: Mapping[str, str], files: Mapping[str, Path], *, most_rows: int | None = None) -> None:
        """The section of a study's tables: those of {name: title} with a file in {name: CSV}, each with its first rows."""
        self.section("Tables")
        for name, title in titles.items():
            if name in files:
                self.table(read_csv(files[name]), title, file=files[name], most_rows=most_rows)

    def claims(self, claims: pd.DataFrame, *, title: str = "The paper's claims", file: str | Path, links: Links = ()) -> None:
        """The section of a study's claims (see `evaluation.decisions`), coloured by verdict, with links to their evidence."""
        self.section(title, anchor="claims")
        self.text(f"Each verdict is computed by the rule beside it: {counted(claims)}",
                  links=[*_csv(self.link(file)), *links])
        rows = claims.fillna("").to_dict("records")
        for row in rows:
            there = row.get("evidence") and (self.folder / row["evidence"]).is_file()
            row["link"] = row["evidence"] if there else ""
        self._add("claims", columns=list(claims.columns), rows=rows)

    def configuration(self, text: str) -> None:
        """The section with a study's configuration, or a design, and all its defaults."""
        self.section("Configuration", anchor=CONFIGURATION.removeprefix("#"))
        self.text("With all defaults.")
        self.code(text)

    def code(self, text: str, *, title: str = "") -> None:
        """A preformatted text, such as a configuration or a program; the title is also its anchor."""
        self._add("code", text=text, title=title, anchor=title)

    def render(self) -> str:
        """The page as text."""
        parts = list(self._parts)
        first = next((number for number, part in enumerate(parts) if part["kind"] == "section"), len(parts))
        sections = [(part["title"], f"#{part['anchor']}") for part in parts if part["kind"] == "section"]
        if sections:
            parts.insert(first, {"kind": "navigation", "links": [*sections, *self._other_pages]})
        return TEMPLATE.render(title=self.title, name=self.name, parts=parts, style=STYLE, script=SCRIPT, header=header,
                               most=_MOST_LINKS, version=softtact.__version__, machine=machine())

    def write(self, path: str | Path) -> None:
        """Write the page, completely or not at all."""
        text = self.render()
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def _items(self, sentences):
        """Dicts of text and address of each sentence that is not empty."""
        pairs = [(one, None) if isinstance(one, str) else one for one in ([sentences] if isinstance(sentences, str) else sentences)]
        return [{"text": text, "address": file and (str(file) if "#" in str(file) else self.link(file))}
                for text, file in pairs if text]

    def _add(self, kind, **values):
        self._parts.append({"kind": kind} | values)


def counted(claims: pd.DataFrame) -> str:
    """How many claims there are, and how many of each verdict."""
    counts = ", ".join(f"{number} {verdict}" for verdict, number in claims.verdict.value_counts().items())
    return f"{len(claims)} claims: {counts}."


def _csv(address):
    return [("", [("CSV", address)])] if address else []
