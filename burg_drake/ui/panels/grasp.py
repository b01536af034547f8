"""The panel of grasps: how many of each object are clear and reachable, and what is in the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import viser

from burg_drake.compose.editing import SessionView
from burg_drake.ui.widgets import PageActions, all_of, box, quiet, table

if TYPE_CHECKING:
    from burg_drake.evaluation.stages import GraspCount

GRASPS = 50
"""Sampled of each object."""
MOST = 2
"""Of what is in the way, so many are named."""


class GraspPanel:
    """Counts grasps.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._session = actions.session
        with gui.add_folder("Grasps"):
            self._on = actions.chosen(
                gui.add_checkbox(
                    "Count grasps",
                    False,
                    hint=f"Of {GRASPS} sampled on each object; again after each change",
                ),
                lambda on: self._session.watch_grasps(GRASPS if on else None),
            )
            self._text = gui.add_html("")

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        text = ""
        if self._on.value:
            late = view.grasps_revision != view.revision
            text = all_of(box(_counts(view.grasps), quiet("Counting ...") if late else None))
        if self._text.content != text:
            self._text.content = text


def _counts(grasps: Mapping[str, GraspCount]) -> str | None:
    if not grasps:
        return None
    rows = [
        (name, _blockers_text(count.in_the_way), count.clear, _reachable(count))
        for name, count in grasps.items()
    ]
    return table(("Object", "In the way", "Clear", "Reached"), rows, numbers=2)


def _reachable(count: GraspCount) -> str:
    return "–" if count.reachable is None else str(count.reachable)


def _blockers_text(blockers: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {number}" for name, number in list(blockers.items())[:MOST])
