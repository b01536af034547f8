"""An editor that also settles the scene and counts its grasps in the background."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from burg_drake.compose.background_tasks import (
    GraspCounts,
    GraspWatch,
    SettlingProposal,
    SettlingTask,
)
from burg_drake.compose.background_worker import BackgroundJob, BackgroundWorker
from burg_drake.compose.editor import Editor
from burg_drake.compose.opening import OpenedScene
from burg_drake.compose.scene_checker import restore_missing_objects, scene_of_known_objects
from burg_drake.compose.session_view import SessionView
from burg_drake.core import InvalidInputError, TaskCancelled
from burg_drake.station import Station

if TYPE_CHECKING:
    from burg_drake.evaluation import GraspCount


class BackgroundEditor(Editor):
    """An editor with processes for what takes long; see `ComposeSession`.

    Args:
        opened: the scene.
        station: where it stands.
    """

    def __init__(self, opened: OpenedScene, station: Station) -> None:
        self._settler = BackgroundWorker()
        self._settling: BackgroundJob[SettlingProposal] | None = None
        self._proposal: SettlingProposal | None = None
        self._grasp_watch: GraspWatch | None = None
        self._grasps: tuple[Mapping[str, GraspCount], int] = ({}, 0)
        super().__init__(opened, station)

    def settle(self, *, time_limit: float = 10.0) -> BackgroundJob[SettlingProposal]:
        """Lets the scene come to rest in a worker process; editing goes on meanwhile.

        What comes of it is `SessionView.proposal`. What was asked before is cancelled.

        Args:
            time_limit: simulated time allowed [s].
        """
        with self._exclusive():
            self._drop_settling()
            scene = scene_of_known_objects(self._history.state, self._storage.place)
            self._settling = self._settler.submit(
                SettlingTask(scene, self.station, time_limit), self._settled
            )
            self._publish()
            return self._settling

    def accept(self, proposal: SettlingProposal | None = None) -> SessionView:
        """Makes a proposal a step.

        Args:
            proposal: the one in the view if None.

        Raises:
            InvalidInputError: there is none, or the scene has changed since it was made.
        """
        with self._exclusive():
            proposal = proposal or self._proposal
            if proposal is None:
                raise InvalidInputError("there is no proposal to accept; settle the scene first")
            before = self._history.state
            if scene_of_known_objects(before, self._storage.place).document != proposal.start:
                raise InvalidInputError(
                    "the scene has changed since it was settled; settle it again, or undo"
                )
            self._proposal = None
            self._drag = None
            state = replace(before, document=restore_missing_objects(proposal.document, before))
            moved = [n for n, i in state.instances.items() if i != before.instance(n)]
            return self._edit(proposal.label, state.select(moved))

    def revert(self) -> SessionView:
        """Drops the proposal, and what is being done for one."""
        with self._exclusive():
            self._drop_settling()
            return self._publish()

    def watch_grasps(self, grasps_per_object: int | None = 50) -> SessionView:
        """Counts grasps from now on, in a worker process, a while after each change: how many of
        each object are clear and reachable, and what is in the way of the others. They are in
        `SessionView.grasps`.

        Args:
            grasps_per_object: grasps that are sampled for each object; no more counting if None.
        """
        with self._exclusive():
            watch, self._grasp_watch = self._grasp_watch, None
            if grasps_per_object is not None:
                self._grasp_watch = GraspWatch(self.station, grasps_per_object, self._counted)
            view = self._publish()
        if watch is not None:
            watch.close()
        return view

    def _end_background(self) -> None:
        """Ends all processes."""
        self.watch_grasps(None)
        self._settler.close()

    def _counted(self, found: GraspCounts) -> None:
        """Called by the worker's thread."""
        with self._exclusive():
            if self._grasp_watch is None:
                return
            if found.error is not None:
                self.notify(f"grasps cannot be counted: {found.error}")
                self._grasps = ({}, found.revision)  # nobody waits for more
            elif found.complete:
                self._grasps = (found.counts, found.revision)
            else:
                self._grasps = ({**self._grasps[0], **found.counts}, self._grasps[1])
            self._publish()

    def _settled(self, job: BackgroundJob[SettlingProposal]) -> None:
        """Called by the worker's thread."""
        with self._exclusive():
            if job is not self._settling:
                return
            if job.done:
                self._settling = None
                if job.error is None:
                    self._proposal = job.result
                elif not isinstance(job.error, TaskCancelled):
                    self.notify(f"cannot settle the scene: {job.error}")
            self._publish()

    def _drop_settling(self) -> None:
        job, self._settling = self._settling, None
        self._proposal = None
        if job is not None:
            job.cancel()

    def _with_background(self, view: SessionView) -> SessionView:
        if self._grasp_watch is not None:
            scene = scene_of_known_objects(self._history.state, self._storage.place)
            self._grasp_watch.update(scene, self._revision, self._state.selection)
        working = None
        if self._settling is not None:
            share, word = self._settling.progress
            working = f"settling: {word}" if share == 0.0 else f"settling: {share:.0%}, {word}"
        grasps, revision = self._grasps
        return replace(
            view,
            working=working,
            proposal=self._proposal,
            grasps=grasps,
            grasps_revision=revision,
        )
