"""The panel of the check: what is wrong with the scene, line by line."""

from __future__ import annotations

import viser

from burg_drake.compose.editing import STATUS, SessionView
from burg_drake.core import listing as names_of
from burg_drake.ui.widgets import all_of, box, dot, listing, quiet, style_of
from burg_drake.visualization.style import Child, element

MAX_ROWS = 30
"""Lines that are shown."""


class CheckPanel:
    """Lists issues.

    Args:
        gui: of viser, in whose container the panel goes.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Validate"):
            self._text = gui.add_html("")

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        text = all_of(box(*findings(view)))
        if self._text.content != text:
            self._text.content = text


def findings(view: SessionView) -> list[Child]:
    """What there is to say about the scene."""
    if not view.instances:
        return [quiet("Add objects; they are checked as they are moved.")]
    unknown = [name for name, status in view.status.items() if status == "unknown"]
    if not view.issues and not unknown:
        return [dot(style_of("ok").hex), "All objects are on the board, free and supported."]
    rows = [
        element("span", dot(style_of(STATUS[issue.kind]).hex), issue.message)
        for issue in view.issues[:MAX_ROWS]
    ]
    if unknown:
        line = f"cannot be checked: {names_of(unknown)}"
        rows.insert(0, element("span", dot(style_of("unknown").hex), line))
    more = len(view.issues) - MAX_ROWS
    return [listing(rows), quiet(f"and {more} more" if more > 0 else None)]
