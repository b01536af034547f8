"""The page's style sheet, with the colours of the outcome groups as CSS classes."""

from __future__ import annotations

from burg_drake.visualization.style import GROUPS, contrast, page_style

STYLES = {group.name: f"g{i}" for i, group in enumerate(GROUPS)}
THEMED = {
    "hand collides": ("#9aa2a9", "#6b747b"),
    "arm has no path": ("#1a3373", "#8fa6e8"),
    "simulation failed": ("#1d2328", "#f4f6f7"),
}
"""Greys, black and dark blue need one tone on a light page and another on a dark one."""
STROKES = {GROUPS[1].hex: "#b59f00"}
"""Thin lines in yellow cannot be seen on white: a darker one of its hue."""
TEXT = ("#101418", "#ffffff")
"""Of numbers on the colours: whichever stands out more."""


def style_sheet() -> str:
    """All styles of the page."""
    sheet = page_style("burg_drake.evaluation.report", "style.css")
    light = "".join(_rule(g.name, THEMED.get(g.name, (g.hex,))[0]) for g in GROUPS)
    dark = "".join(_rule(name, tones[1]) for name, tones in THEMED.items())
    return f"{sheet}{light}@media screen and (prefers-color-scheme: dark) {{\n{dark}}}\n"


def _rule(group: str, colour: str) -> str:
    text = max(TEXT, key=lambda text: contrast(text, colour))
    name = STYLES[group]
    fill = f".{name} {{ background: {colour}; fill: {colour}; color: {text}; }}"
    return f"{fill} .grasp.{name} {{ stroke: {STROKES.get(colour, colour)}; }}\n"
