"""Formulas as MathML, which browsers draw by themselves: no script, no font and no network."""

from __future__ import annotations

from html import escape
from typing import Any, cast

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator


def convert_formula(latex: str, *, block: bool) -> str:
    """Translate a formula to a ``<math>`` element that keeps its LaTeX as an annotation-like title.

    Parameters
    ----------
    latex : str
        Without dollar signs. Lines that align at ``&`` are put into the environment ``aligned``.
    block : bool
        Whether it stands in a paragraph of its own.

    Returns
    -------
    str
    """
    if block and (r"\\" in latex) and r"\begin" not in latex:
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    return convert(latex, display="block" if block else "inline")


def _visit_inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(f'<span class="math">{convert_formula(node.astext(), block=False)}</span>')
    raise nodes.SkipNode


def _visit_block(self: HTML5Translator, node: nodes.math_block) -> None:
    number = ""
    if node["number"]:
        # Sphinx declares the node as the base class.
        label = escape(str(get_node_equation_number(self, cast(Any, node))))
        number = f'<span class="eqno">({label})</span>'
    begin = self.starttag(node, "div", CLASS="math")
    self.body.append(f"{begin}{convert_formula(node.astext(), block=True)}{number}</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (_visit_inline, None), (_visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
