"""How Sphinx builds the site: `make docs`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from numpydoc.xref import DEFAULT_LINKS

import velodrome

project = "Velodrome"
author = "The Velodrome contributors"
project_copyright = author
release = version = velodrome.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "executed",
    "generated",
    "mathml",
    "rides",
]
exclude_patterns = ["made"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

# Formulas are MathML: nothing is loaded from elsewhere, and pages are whole without a script.
html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = f"Velodrome {release}"
html_static_path = ["_static"]
html_css_files = ["velodrome.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "show_nav_level": 1,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {name: [] for name in ("index", "theory", "gallery")}

default_role = "autolink"
autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say the types
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
# Types link to names of this site only: others would need the network.
DEFAULT_LINKS.clear()
numpydoc_xref_param_type = True
numpydoc_xref_aliases = {name: f"velodrome.{name}" for name in velodrome.__all__}
numpydoc_xref_ignore = "all"  # but those
toc_object_entries = False  # each has a heading of its own
