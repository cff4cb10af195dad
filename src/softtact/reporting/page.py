"""A report as one HTML file with boxes, figures, tables and claims, each with links to its files; figures are embedded."""

import base64
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

import softtact
from softtact.files import atomic_path, read_csv
from softtact.reporting.run_record import machine
from softtact.reporting.words import header

Links = Sequence[tuple[str, Sequence[tuple[str, str]]]]
"""Groups of links: a label ("" for none), and (text, address) of each link."""

_MOST_LINKS = 4      # of a group below a figure; the others are folded
_STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:2em auto;padding:0 1em;color:#222}
h1,h2{line-height:1.2}table{border-collapse:collapse;font-size:13px;margin:1em 0;display:block;overflow-x:auto}
td,th{border-bottom:1px solid #ddd;padding:4px 8px;text-align:left;vertical-align:top}th{background:#f4f4f4}
figure{margin:2em 0}img{max-width:100%}figcaption,.links{font-size:14px;color:#444}nav a{margin-right:1em}
.box{background:#fff6e0;border-left:4px solid #e0a000;padding:.6em 1em;margin:1em 0}
.reproduced{background:#d9f0d9}.not{background:#f7d7d7}
.contradicts{background:#ffe9c7}.needs{background:#e6e6f5}.undecided{background:#eee}
.consistent{background:#e4eef8}summary{cursor:pointer}
figure .links{margin-top:.4em}a{overflow-wrap:anywhere}
pre{font-size:12px;line-height:1.35;background:#f8f8f8;padding:1em;overflow-x:auto}"""
_TEMPLATE = Environment(autoescape=True, trim_blocks=True).from_string("""
{%- macro addresses(pairs) -%}
{% for text, address in pairs %}<a href="{{ address }}">{{ text }}</a>{{ ", " if not loop.last }}{% endfor %}
{%- endmacro %}
{%- macro linked(groups, most=none) %}
{% for label, pairs in groups if pairs %}{{ label ~ ": " if label }}{{ addresses(pairs[:most]) -}}
{% if most and pairs|length > most %}<details><summary>and {{ pairs|length - most }} more files</summary>
{{ addresses(pairs[most:]) }}</details>{% else %}.{% endif %}

{% endfor %}{% endmacro -%}
<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: {{ title }} {{ name }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>{{ title }} <i>{{ name }}</i></h1>
{% for part in parts %}
{% if part.kind == "navigation" %}
<nav>{% for text, address in part.links %}<a href="{{ address }}">{{ text }}</a>{% endfor %}</nav>
{% elif part.kind == "section" %}
<h2 id="{{ part.anchor }}">{{ part.title }}</h2>
{% elif part.kind == "text" %}
<p>{{ part.text }} {{ linked(part.links) }}</p>
{% elif part.kind == "box" %}
<div class="box">{% if part.title %}<b>{{ part.title }}</b> {% endif %}{{ part.text }}
{% if part.sentences %}<ul>{% for sentence in part.sentences %}<li>{{ sentence }}</li>{% endfor %}</ul>{% endif %}</div>
{% elif part.kind == "figure" %}
<figure id="{{ part.anchor }}">
{% if part.html %}{{ part.html }}{% else %}<img alt="{{ part.caption }}" src="data:image/png;base64,{{ part.image }}">{% endif %}

<figcaption>{{ part.caption }} {{ part.remark }}</figcaption><div class="links">{{ linked(part.links, most) }}</div></figure>
{% elif part.kind == "table" %}
{% if part.title %}<h3>{{ part.title }}</h3>{% endif %}{{ part.html }}
<p class="links">{{ linked(part.links) }}</p>
{% elif part.kind == "claims" %}
<table><tr>{% for name in part.columns %}<th>{{ header(name) }}</th>{% endfor %}</tr>
{% for row in part.rows %}<tr class="{{ row.verdict.split()[0] }}">{% for name in part.columns %}
<td>{% if name == "evidence" and row.link %}<a href="{{ row.link }}">{{ row[name] }}</a>{% else %}{{ row[name] }}{% endif %}</td>
{% endfor %}</tr>
{% endfor %}</table>
{% else %}
{% if part.title %}<h3 id="{{ part.anchor }}">{{ part.title }}</h3>{% endif %}<pre>{{ part.text }}</pre>
{% endif %}
{% endfor %}
<p>softtact {{ version }}; {{ machine }}.</p></body></html>
""")


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

    def box(self, title: str, text: str | Iterable[str]) -> None:
        """A highlighted paragraph or list of sentences."""
        whole, sentences = (text, []) if isinstance(text, str) else ("", list(text))
        if whole or sentences:
            self._add("box", title=title, text=whole, sentences=sentences)

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

    def table(self, frame: pd.DataFrame, title: str = "", *, file: str | Path | None = None, links: Links = ()) -> None:
        """A table with its columns in words and numbers in four digits; file: of the same as CSV."""
        html = frame.rename(columns=header).to_html(index=False, na_rep="", border=0, float_format=lambda value: f"{value:.4g}")
        self._add("table", title=title, html=Markup(html), links=[*_csv(file and self.link(file)), *links])

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
                self.table(read_csv(files[name]).iloc[:most_rows], title, file=files[name])

    def claims(self, claims: pd.DataFrame, *, title: str = "The paper's claims", file: str | Path, links: Links = ()) -> None:
        """The section of a study's claims (see `evaluation.decisions`), coloured by verdict, with links to their evidence."""
        counts = ", ".join(f"{number} {verdict}" for verdict, number in claims.verdict.value_counts().items())
        self.section(title, anchor="claims")
        self.text(f"Each verdict is computed by the rule beside it: {len(claims)} claims, {counts}.",
                  links=[*_csv(self.link(file)), *links])
        rows = claims.fillna("").to_dict("records")
        for row in rows:
            there = row.get("evidence") and (self.folder / row["evidence"]).is_file()
            row["link"] = row["evidence"] if there else ""
        self._add("claims", columns=list(claims.columns), rows=rows)

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
        return _TEMPLATE.render(title=self.title, name=self.name, parts=parts, style=Markup(_STYLE), header=header,
                                most=_MOST_LINKS, version=softtact.__version__, machine=machine())

    def write(self, path: str | Path) -> None:
        """Write the page, completely or not at all."""
        text = self.render()
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")

    def _add(self, kind, **values):
        self._parts.append({"kind": kind} | values)


def _csv(address):
    return [("", [("CSV", address)])] if address else []
