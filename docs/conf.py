"""How Sphinx builds these pages: ``sphinx-build -W docs docs/_build``; needs ``pip install '.[plot,docs]'``."""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

import fastcontact

project = "fastcontact"
author = "The fastcontact developers"
copyright = "The fastcontact developers"
version = release = fastcontact.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3

# Types stand in the docstrings, with shapes and dimensions; names in single backquotes become links where they can.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_param = False  # types are prose with shapes, not names to link
napoleon_use_rtype = False
default_role = "py:obj"

html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"fastcontact {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]


def types_as_prose(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Put the types of attributes into their descriptions: there, too, they are shapes and not names to link."""
    found = [re.match(r":vartype ([^:]+): (.*)", line) for line in lines]
    kinds = {match[1]: match[2] for match in found if match}
    kept = [line for line, match in zip(lines, found, strict=True) if not match]

    def described(match: re.Match[str]) -> str:
        # Without spaces, or Sphinx takes the first of several names for a type.
        return f":ivar {match[1].replace(' ', '')}: *{kinds.get(match[1], '')}* --"

    lines[:] = [re.sub(r"^:ivar ([^:]+):", described, line) for line in kept]


def colons_as_prose(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep napoleon from taking what stands before a colon, in the first line on a property, for its type."""
    if what in ("attribute", "data", "property"):
        lines.insert(0, "")


def inline_math(translator: Any, node: nodes.math) -> None:
    """Write a formula in a line as MathML, which browsers show without scripts and without the network."""
    translator.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def block_math(translator: Any, node: nodes.math_block) -> None:
    """Write a formula that stands alone as MathML."""
    translator.body.append(f'<div class="formula">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Register with Sphinx; colons are kept before napoleon runs, types rewritten after it."""
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))
    app.connect("autodoc-process-docstring", colons_as_prose, priority=100)
    app.connect("autodoc-process-docstring", types_as_prose, priority=900)
