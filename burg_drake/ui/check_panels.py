"""Panels that check the scene: issues, settling, grasp counts and reach."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import TYPE_CHECKING

import viser

from burg_drake.compose import (
    STATUS_OF_ISSUE,
    BackgroundJob,
    BackgroundWorker,
    SessionView,
    SettlingProposal,
    names_of_moved_instances,
)
from burg_drake.core import TaskCancelled, list_names
from burg_drake.scene import Board
from burg_drake.ui.background_pictures import ReachTask
from burg_drake.ui.board_view import BoardLayers, BoardOverlay
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_parts import (
    SidePanel,
    color_dot,
    html_list,
    html_table,
    notice_html,
    paragraph,
    secondary_text,
    status_style,
)
from burg_drake.visualization import Child, element

if TYPE_CHECKING:
    from burg_drake.evaluation import GraspCount
    from burg_drake.motion import ReachLayer


class CheckPanel:
    """Lists issues.

    Args:
        gui: API of viser, inside the container for the panel.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("Validate"):
            self._text = gui.add_html("")

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        self._text.content = paragraph(*issues_html(view))


def issues_html(view: SessionView) -> list[Child]:
    """The issues of the scene as HTML."""
    max_rows = 30  # Maximum number of issues shown.
    if not view.instances:
        return [secondary_text("Add objects; they are checked as they are moved.")]
    unknown = [name for name, status in view.status.items() if status == "unknown"]
    if not view.issues and not unknown:
        return [
            color_dot(status_style("ok").hex),
            "All objects are on the board, free and supported.",
        ]
    rows = [
        element("span", color_dot(status_style(STATUS_OF_ISSUE[issue.kind]).hex), issue.message)
        for issue in view.issues[:max_rows]
    ]
    if unknown:
        line = f"cannot be checked: {list_names(unknown)}"
        rows.insert(0, element("span", color_dot(status_style("unknown").hex), line))
    more = len(view.issues) - max_rows
    return [html_list(rows), secondary_text(f"and {more} more" if more > 0 else None)]


class SettlePanel(SidePanel):
    """Settles the scene."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        session, icon = actions.session, viser.Icon
        with gui.add_folder("Simulate"):
            self._text = gui.add_html("")
            self._settle = self._button(
                "Settle in physics",
                session.settle,
                primary=True,
                icon=icon.PLAYER_PLAY,
                hint="Settle (Shift+S)",
            )
            self._accept = self._button(
                "Accept", session.accept, primary=True, width=6, icon=icon.CHECK, color="green"
            )
            self._revert = self._button("Revert", session.revert, width=6, icon=icon.X)
            self._cancel = self._button("Cancel", session.revert, icon=icon.PLAYER_STOP)

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        self._settle.visible = view.working is None and view.proposal is None
        self._settle.disabled = not view.instances
        self._accept.visible = self._revert.visible = view.proposal is not None
        self._cancel.visible = view.working is not None
        self._text.content = paragraph(*_status_lines(view))


def _status_lines(view: SessionView) -> list[Child]:
    if view.working is not None:
        return [view.working[:1].upper() + view.working[1:]]
    if view.proposal is None:
        return [secondary_text("Lets all objects come to rest, and shows what would move.")]
    return _proposal_html(view.proposal, outdated=view.proposal.start != view.document)


def _proposal_html(proposal: SettlingProposal, *, outdated: bool) -> list[Child]:
    max_rows = 20  # Maximum number of moved objects shown.
    moved = [(name, proposal.displacements[name]) for name in names_of_moved_instances(proposal)]
    moved.sort(key=lambda item: -item[1].distance)
    rows = [(name, f"{1e3 * d.distance:.1f} mm", f"{degrees(d.angle):.1f}°") for name, d in moved]
    lines: list[Child] = []
    if outdated:
        lines.append(notice_html("The scene has changed since; settle it again."))
    lines += [notice_html(f"{name} falls off the table") for name in proposal.fallen]
    lines += [notice_html(f"{name} still moves: {how}") for name, how in proposal.moving.items()]
    if rows:
        lines.append(html_table(("Moves", "by", "turns by"), rows[:max_rows], numbers=2))
    elif not proposal.fallen:
        lines.append("Everything stays where it is.")
    lines.append(secondary_text(f"{proposal.duration:.1f} s were simulated."))
    return lines


GRASPS_PER_OBJECT = 50
"""Grasps that are sampled on each object."""


class GraspPanel:
    """Counts grasps.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._session = actions.session
        with gui.add_folder("Grasps"):
            self._enabled = actions.on_choice(
                gui.add_checkbox(
                    "Count grasps",
                    False,
                    hint=f"Of {GRASPS_PER_OBJECT} sampled on each object; again after each change",
                ),
                lambda on: self._session.watch_grasps(GRASPS_PER_OBJECT if on else None),
            )
            self._text = gui.add_html("")

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        text = ""
        if self._enabled.value:
            late = view.grasps_revision != view.revision
            text = paragraph(
                _grasp_count_table(view.grasps), secondary_text("Counting ...") if late else None
            )
        self._text.content = text


def _grasp_count_table(grasps: Mapping[str, GraspCount]) -> str | None:
    if not grasps:
        return None
    rows = []
    for name, count in grasps.items():
        blockers = [f"{blocker} {number}" for blocker, number in count.in_the_way.items()]
        reachable = "–" if count.reachable is None else str(count.reachable)
        rows.append((name, ", ".join(blockers[:2]), count.clear, reachable))
    return html_table(("Object", "In the way", "Clear", "Reached"), rows, numbers=2)


class ReachPanel:
    """Shows the area that the arm reaches.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
        layers: layers of the board.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, layers: BoardLayers) -> None:
        self._actions, self._layers = actions, layers
        self._worker = BackgroundWorker()
        self._shown_request: tuple[Board, float] | None = None
        self._job: BackgroundJob[ReachLayer] | None = None
        with gui.add_folder("Reach"):
            self._enabled = gui.add_checkbox(
                "Arm's reach", False, hint="Where the arm can grasp straight from above"
            )
            self._height = gui.add_number(
                "Height [mm]",
                50.0,
                min=0.0,
                max=1000.0,
                step=5.0,
                hint="Of the middle between the fingers above the board",
            )
            self._text = gui.add_html("")
            actions.on_choice(self._enabled, lambda on: self.show(actions.session.view))
            actions.typed_field(self._height, lambda height: self.show(actions.session.view))

    def close(self) -> None:
        """Ends the worker process."""
        self._worker.close()

    def show(self, view: SessionView) -> None:
        """Updates layer and panel from a view; starts to compute a new layer if needed."""
        self._height.visible = bool(self._enabled.value)
        if not self._enabled.value:
            self._discard()
            return
        request = view.document.board, 1e-3 * float(self._height.value)
        if request == self._shown_request:
            return
        self._discard()
        self._shown_request = request
        station = self._actions.session.station
        if station.document.arm is None:
            self._show_line("The station has no arm.")
            return
        self._show_line("Computing; the first time takes half a minute ...")
        self._job = self._worker.submit(ReachTask(station, *request), self._on_job_change)

    def _discard(self) -> None:
        self._shown_request = None
        job, self._job = self._job, None
        if job is not None:
            job.cancel()
        self._layers.show("reach", None)
        self._show_line("")

    def _on_job_change(self, job: BackgroundJob[ReachLayer]) -> None:
        """Called in the thread of the worker."""
        if job.done:
            self._actions.submit(lambda: self._finish(job), wait_for_typing=True)

    def _finish(self, job: BackgroundJob[ReachLayer]) -> None:
        if job is not self._job:
            return
        if job.error is not None:
            if not isinstance(job.error, TaskCancelled):
                self._show_line(str(job.error))
            return
        from burg_drake.visualization import reach_image, reachability_key

        layer = job.wait()
        width, depth = self._actions.session.view.document.board.size
        pixels = reach_image(layer, pixels=8)  # per cell, so that cells keep sharp edges
        self._layers.show("reach", BoardOverlay(pixels, (0.0, 0.0), (width, depth), opacity=0.55))
        share = f"Some orientation of the hand reaches {layer.covered:.0%} of the board."
        self._text.content = paragraph(reachability_key(), secondary_text(share))

    def _show_line(self, line: str) -> None:
        self._text.content = paragraph(secondary_text(line)) if line else ""
