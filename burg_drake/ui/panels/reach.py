"""The panel of reach: where on the board the arm grasps from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import viser

from burg_drake.compose.background import BackgroundJob, BackgroundWorker
from burg_drake.compose.editing import SessionView
from burg_drake.core import TaskCancelled
from burg_drake.scene.document import Board
from burg_drake.ui.panels.reach_task import ReachTask
from burg_drake.ui.view import BoardLayers, BoardOverlay
from burg_drake.ui.widgets import PageActions, all_of, box, quiet

if TYPE_CHECKING:
    from burg_drake.motion.workspace import ReachLayer

HEIGHT_MM = 50.0
MAX_HEIGHT_MM = 1000.0
LAYER_OPACITY = 0.55
PIXELS_PER_CELL = 8
"""Of the picture, a cell; so that its cells keep sharp edges."""


class ReachPanel:
    """Shows what the arm reaches.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
        layers: of the board.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, layers: BoardLayers) -> None:
        self._actions, self._layers = actions, layers
        self._worker = BackgroundWorker()
        self._shown_for: tuple[Board, float] | None = None
        self._job: BackgroundJob[ReachLayer] | None = None
        with gui.add_folder("Reach"):
            self._on = gui.add_checkbox(
                "Arm's reach", False, hint="Where the arm can grasp straight from above"
            )
            self._height = gui.add_number(
                "Height [mm]",
                HEIGHT_MM,
                min=0.0,
                max=MAX_HEIGHT_MM,
                step=5.0,
                hint="Of the middle between the fingers above the board",
            )
            self._text = gui.add_html("")
            actions.chosen(self._on, lambda on: self.show(actions.session.view))
            actions.typed(self._height, lambda height: self.show(actions.session.view))

    def close(self) -> None:
        """Ends the worker process."""
        self._worker.close()

    def show(self, view: SessionView) -> None:
        """Brings layer and panel to a view; computes what is not known yet."""
        self._height.visible = bool(self._on.value)
        if not self._on.value:
            self._discard()
            return
        asked = view.document.board, 1e-3 * float(self._height.value)
        if asked == self._shown_for:
            return
        self._discard()
        self._shown_for = asked
        station = self._actions.session.station
        if station.document.arm is None:
            self._show_line("The station has no arm.")
            return
        self._show_line("Computing; the first time takes half a minute ...")
        self._job = self._worker.submit(ReachTask(station, *asked), self._on_job_change)

    def _discard(self) -> None:
        self._shown_for = None
        job, self._job = self._job, None
        if job is not None:
            job.cancel()
        self._layers.show("reach", None)
        self._show_line("")

    def _on_job_change(self, job: BackgroundJob[ReachLayer]) -> None:
        """Called by the worker's thread."""
        if job.done:
            self._actions.submit(lambda: self._finish(job), wait_for_typing=True)

    def _finish(self, job: BackgroundJob[ReachLayer]) -> None:
        if job is not self._job:
            return
        if job.error is not None:
            if not isinstance(job.error, TaskCancelled):
                self._show_line(str(job.error))
            return
        from burg_drake.visualization.pictures import reach_image, reachability_key

        layer = job.wait()
        width, depth = self._actions.session.view.document.board.size
        pixels = reach_image(layer, pixels=PIXELS_PER_CELL)
        self._layers.show("reach", BoardOverlay(pixels, (0.0, 0.0), (width, depth), LAYER_OPACITY))
        share = f"Some orientation of the hand reaches {layer.covered:.0%} of the board."
        self._text.content = all_of(box(reachability_key(), quiet(share)))

    def _show_line(self, line: str) -> None:
        content = all_of(box(quiet(line))) if line else ""
        if self._text.content != content:
            self._text.content = content
