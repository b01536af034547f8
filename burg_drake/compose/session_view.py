"""The view of a session at one moment: all that a page needs to draw."""

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
        serial: rises with every view of a session, whatever changed; of two, the larger is newer.
        revision: rises with every change of the scene; a drag's moves do not count until its end.
        state: the scene, its library and the selection; while something is dragged, as it is held.
        issues: what is wrong with the scene.
        status: of every instance, the worst first; background is `ok` unless something is in it.
        undo_label: of the step that undo takes back; None if there is none.
        redo_label: of the step that redo takes again; None if there is none.
        saved: the file holds the scene as it is.
        changed: there are changes that are in no file.
        path: the file; None if the scene was never saved.
        planar: objects that are moved keep their tilt, and their height unless they are raised.
        gaps: of selected instances that touch nothing below, how far they are above it [m].
        dragging: instances that are being dragged.
        notices: what the user should know, one line each, until `ComposeSession.dismiss`.
        working: what is being done beside, and how far it is; None if nothing is.
        proposal: what came of it, to be accepted or reverted.
        grasps: how many grasps of each instance are clear and reachable, as far as they are
            counted; see `ComposeSession.watch_grasps`.
        grasps_revision: the revision that all of these counts belong to; while a newer one is
            counted, some are of that one already.
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
        """That the instances refer to."""
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
    """The worst that is said of each instance; both of a pair that overlaps are in collision.

    Args:
        state: with the instances.
        issues: of the scene; None if it cannot be checked.
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
