"""The page's style sheet, with the colours of the outcome groups as CSS classes."""

from __future__ import annotations

from importlib.resources import files

from burg_drake.visualization.palette import GROUPS

STYLES = {group.name: f"g{i}" for i, group in enumerate(GROUPS)}
THEMED = {
    "hand collides": "var(--collides)",
    "arm has no way": "var(--no-way)",
    "simulation failed": "var(--failed)",
}
"""Greys, black and dark blue need another tone on a dark page."""


def style_sheet() -> str:
    """All styles of the page."""
    sheet = (files("burg_drake.evaluation.report") / "style.css").read_text(encoding="utf-8")
    colours = "".join(
        f".{STYLES[g.name]} {{ background: {c}; fill: {c}; }}\n"
        for g in GROUPS
        for c in [THEMED.get(g.name, g.hex)]
    )
    return sheet + colours
