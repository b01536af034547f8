"""Sphinx's settings for the site. `tools/site.py` builds it: this folder, with generated pages."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from burg_drake import __version__

project = "burg_drake"
author = "burg_drake contributors"
copyright = author
release = version = __version__
REPOSITORY = "https://github.com/burg-drake/burg_drake"

extensions = [
    "_schemas",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["**.ipynb"]
# Words of types in docstrings need not name one object only.
suppress_warnings = ["ref.python"]

myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 4

default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
python_use_unqualified_type_names = True
napoleon_use_rtype = False
napoleon_custom_sections = [
    (f"{way} port{s}", "params_style") for way in ("Input", "Output") for s in ("", "s")
] + [("Ports", "params_style")]
napoleon_use_ivar = True
napoleon_numpy_docstring = False
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"burg_drake {version}"
html_baseurl = "https://burg-drake.github.io/burg_drake/"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {
    "source_repository": REPOSITORY,
    "source_branch": "main",
    "source_directory": "docs/",
    "light_css_variables": {"color-brand-primary": "#0b5c8a", "color-brand-content": "#0b5c8a"},
    "dark_css_variables": {"color-brand-primary": "#7cc4ee", "color-brand-content": "#7cc4ee"},
}
pygments_style = "a11y-light"
pygments_dark_style = "a11y-dark"


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _as_written, priority=900)  # after napoleon
    app.connect("html-page-context", _link_only_stored_pages)


def _link_only_stored_pages(
    app: Any, pagename: str, templatename: str, context: dict[str, Any], doctree: Any
) -> None:
    """Leaves the links to view and edit a page out where the repository has no such page."""
    if "generated" in (context.get("meta") or {}):
        context["page_source_suffix"] = ""


def _as_written(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Takes back what napoleon makes of colons in properties, and of attributes told together."""
    text = "\n".join(lines).replace("numpy.str_", "str")
    if what in ("property", "attribute"):
        text = re.sub(r"\A(.*?)\n+:type: (.*?)\n*\Z", r"\2: \1\n", text, flags=re.DOTALL)
    text = re.sub(
        r"^:ivar ((?:\w+, )+\w+):((?:.*\n)(?:[ ]+.*\n)*)",
        lambda found: "".join(f":ivar {one}:{found[2]}" for one in found[1].split(", ")),
        text,
        flags=re.MULTILINE,
    )
    lines[:] = text.split("\n")
