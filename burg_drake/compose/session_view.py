"""The view of a session at one moment, with all that a page draws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from burg_drake.compose.scene_checker import missing_objects
from burg_drake.compose.state import State
from burg_drake.core import Array
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, SceneDocument, SceneIssue

if TYPE_CHECKING:
    from burg_drake.compose.background_tasks import SettlingProposal
    from burg_drake.evaluation import GraspCount

InstanceStatus = Literal[
    "ok", "collision", "in_ground", "out_of_bounds", "hovering", "sunken", "unknown"
]
"""`unknown`: the library has no such object any more, or the scene cannot be checked."""

STATUS_OF_ISSUE: Mapping[str, InstanceStatus] = {
    "overlap": "collision",
    "obstacle_overlap": "collision",
    "surface_overlap": "collision",
    "in_ground": "in_ground",
    "sunken": "sunken",
    "out_of_bounds": "out_of_bounds",
    "hovering": "hovering",
}
"""Status of an instance by the kind of its `SceneIssue`."""


@dataclass(frozen=True, eq=False)
class SessionView:
    """A session at one moment.

    Attributes:
        serial: increases with every view of a session; of two views, the larger is newer.
        revision: increases with every change of the scene, once at the end of a drag.
        state: the scene, its library and the selection, with the current poses of a drag.
        issues: issues of the scene.
        status: worst status of every instance; background is `ok` unless something is in it.
        undo_label: label of the step that undo takes back; None if there is none.
        redo_label: label of the step that redo takes again; None if there is none.
        saved: whether the file holds the current scene.
        changed: whether there are unsaved changes.
        path: the file; None if the scene was never saved.
        planar: whether moved objects keep their tilt, and their height unless they are raised.
        gaps: heights of selected instances above the surface below, if they do not touch it [m].
        dragging: instances that are being dragged.
        notices: texts for the user, one line each, until `ComposeSession.dismiss`.
        working: progress of settling, as text; None if no settling runs.
        proposal: result of settling, to be accepted or reverted.
        grasps: how many grasps of each instance are clear and reachable, as far as they are
            counted; see `ComposeSession.watch_grasps`.
        grasps_revision: the revision of these counts; while a newer revision is counted, some
            counts already belong to the newer one.
    """

    serial: int
    revision: int
    state: State
    issues: tuple[SceneIssue, ...]
    status: Mapping[str, InstanceStatus]
    undo_label: str | None
    redo_label: str | None
    saved: bool
    changed: bool
    path: Path | None
    planar: bool
    gaps: Mapping[str, float] = field(default_factory=dict)
    dragging: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()
    working: str | None = None
    proposal: SettlingProposal | None = None
    grasps: Mapping[str, GraspCount] = field(default_factory=dict)
    grasps_revision: int = 0

    @property
    def document(self) -> SceneDocument:
        """The scene."""
        return self.state.document

    @property
    def library(self) -> ObjectLibrary:
        """The library that the instances refer to."""
        return self.state.library

    @property
    def selection(self) -> tuple[str, ...]:
        """Names of selected instances."""
        return self.state.selection

    @property
    def instances(self) -> dict[str, Instance]:
        """All instances by name: the free ones first, then the background."""
        return self.state.instances

    def X_SO(self, name: str) -> Array:
        """(4, 4) pose of an instance in the scene frame."""
        return self.state.X_SO(name)


def instance_statuses(
    state: State, issues: Iterable[SceneIssue] | None
) -> dict[str, InstanceStatus]:
    """The worst status of each instance; both instances of an overlap are in collision.

    Args:
        state: state with the instances.
        issues: issues of the scene; None if the scene cannot be checked.
    """
    worst_first = ("collision", "in_ground", "out_of_bounds", "hovering", "sunken", "ok")
    if issues is None:
        return dict.fromkeys(state.instances, "unknown")
    found: dict[str, InstanceStatus] = dict.fromkeys(state.instances, "ok")
    for issue in issues:
        status = STATUS_OF_ISSUE[issue.kind]
        for name in (issue.instance, issue.other):
            stands_below = issue.kind == "hovering" and name == issue.other
            if name in found and not stands_below:
                found[name] = min(status, found[name], key=worst_first.index)
    return found | dict.fromkeys(missing_objects(state), "unknown")
