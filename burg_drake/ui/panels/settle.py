"""The panel that lets the scene settle in physics: what moves and how far, to accept or to drop."""

from __future__ import annotations

from math import degrees

import viser

from burg_drake.compose.background import SettlingProposal, moved_names
from burg_drake.compose.editing import SessionView
from burg_drake.ui.widgets import (
    PageActions,
    all_of,
    box,
    notice,
    quiet,
    quiet_button,
    strong_button,
    table,
)
from burg_drake.visualization.style import Child

MAX_ROWS = 20
"""Rows that are shown."""


class SettlePanel:
    """Settles the scene.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        session, icon = actions.session, viser.Icon
        with gui.add_folder("Simulate"):
            self._text = gui.add_html("")
            self._settle = actions.clicked(
                strong_button(
                    gui, "Settle in physics", icon=icon.PLAYER_PLAY, hint="Settle (Shift+S)"
                ),
                session.settle,
            )
            self._accept = actions.clicked(
                strong_button(gui, "Accept", width=6, icon=icon.CHECK, color="green"),
                session.accept,
            )
            self._revert = actions.clicked(
                quiet_button(gui, "Revert", width=6, icon=icon.X), session.revert
            )
            self._cancel = actions.clicked(
                quiet_button(gui, "Cancel", icon=icon.PLAYER_STOP), session.revert
            )

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        self._settle.visible = view.working is None and view.proposal is None
        self._settle.disabled = not view.instances
        self._accept.visible = self._revert.visible = view.proposal is not None
        self._cancel.visible = view.working is not None
        text = all_of(box(*_status_lines(view)))
        if self._text.content != text:
            self._text.content = text


def _status_lines(view: SessionView) -> list[Child]:
    if view.working is not None:
        return [view.working[:1].upper() + view.working[1:]]
    if view.proposal is None:
        return [quiet("Lets all objects come to rest, and shows what would move.")]
    return _outcome(view.proposal, outdated=view.proposal.start != view.document)


def _outcome(proposal: SettlingProposal, *, outdated: bool) -> list[Child]:
    moved = [(name, proposal.displacements[name]) for name in moved_names(proposal)]
    moved.sort(key=lambda item: -item[1].distance)
    rows = [(name, f"{1e3 * d.distance:.1f} mm", f"{degrees(d.angle):.1f}°") for name, d in moved]
    lines: list[Child] = []
    if outdated:
        lines.append(notice("The scene has changed since; settle it again."))
    lines += [notice(f"{name} falls off the table") for name in proposal.fallen]
    lines += [notice(f"{name} still moves: {how}") for name, how in proposal.moving.items()]
    if rows:
        lines.append(table(("Moves", "by", "turns by"), rows[:MAX_ROWS], numbers=2))
    elif not proposal.fallen:
        lines.append("Everything stays where it is.")
    lines.append(quiet(f"{proposal.duration:.1f} s were simulated."))
    return lines
