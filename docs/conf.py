"""The documentation site: `make docs` builds it into site/, without a network.

Sphinx reads the Markdown pages as they are (MyST). Equations become MathML when the site is built, so that a page loads no
script and no font from anywhere. Docstrings are shown as they stand in the code, in its own narrow markup.
"""

import re

from docutils import nodes
from latex2mathml.converter import convert

import softtact

project, author, copyright = "softtact", "the authors of softtact", "2025, the authors of softtact; Apache-2.0"
version = release = softtact.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton"]
exclude_patterns = ["conf.py"]
root_doc = "index"
html_theme = "furo"     # its columns fold away on a narrow screen, its blocks of code scroll, and it loads nothing from elsewhere
html_title = "softtact"
copybutton_selector = "div:not(.highlight-none) > div.highlight pre"     # not on docstrings
html_math_renderer = "mathml"
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"


def visit_inline(self, node):
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def visit_block(self, node):
    self.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>\n')
    raise nodes.SkipNode


def as_it_stands(app, what, name, obj, options, lines):
    """A docstring's first paragraph as text, the rest in its own lines: its markup is neither Markdown nor reStructuredText."""
    text = "\n".join(lines).strip()
    first, _, rest = text.partition("\n\n")
    plain = re.sub(r"([*_|\\])", r"\\\1", " ".join(first.split()))
    lines[:] = [re.sub(r"`([^`]*)`", r"**\1**\\ ", plain), ""]
    if rest.strip():
        lines += [".. code-block:: none", "", *("   " + line for line in rest.splitlines()), ""]


def setup(app):
    app.add_html_math_renderer("mathml", inline_renderers=(visit_inline, None), block_renderers=(visit_block, None))
    app.connect("autodoc-process-docstring", as_it_stands)
