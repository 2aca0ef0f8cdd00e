"""Sphinx reads this: `make docs`."""

from __future__ import annotations

import importlib.util
import re

from evenhand import __version__

project = "Evenhand"
author = "The Evenhand contributors"
copyright = author
release = version = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
suppress_warnings = ["config.cache"]
html_theme = "furo"
html_title = f"Evenhand {release}"
html_copy_source = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True


def _plain(app, what, name, obj, options, lines: list[str]) -> None:
    """Docstrings are written for reading: bars are bars, and tables are shown as they stand."""
    out: list[str] = []
    table = False
    for line in lines:
        row = line.lstrip().startswith("| ") or line.lstrip().startswith("|--")
        if row and not table:
            out += ["", "::", ""]
        elif table and not row:
            out.append("")
        table = row
        out.append("    " + line.lstrip() if row else _bars(line))
    lines[:] = out


def _bars(line: str) -> str:
    """A line whose bars mean nothing to docutils, but for those in code."""
    parts = line.split("``")
    parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
    return "``".join(parts)


def _without_extras(app, name: str, source: list[str]) -> None:
    """What needs Stable-Baselines3 is left out where that is not installed: it is large."""
    if name == "api" and importlib.util.find_spec("stable_baselines3") is None:
        source[0] = re.sub(
            r"(### adapters\.sb3\n\n).*?(?=\n## )",
            r"\1Not built here: this needs the extra `sb3`.\n",
            source[0],
            flags=re.DOTALL,
        )


def setup(app) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _without_extras)
    app.connect("autodoc-process-docstring", _plain, priority=1)
