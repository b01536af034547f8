"""What is drawn beside objects: where they would come to rest, and how far they are above what is
below them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from burg_drake.compose.background import SettlingProposal, moved_names
from burg_drake.compose.document import bounds, name_of
from burg_drake.compose.editing import SessionView
from burg_drake.core import Array, BurgError, quaternion_from_rotation
from burg_drake.ui.view.object_meshes import ObjectMeshes
from burg_drake.ui.widgets import Rgb8

GHOST_COLOR: Rgb8 = (245, 159, 0)
GHOST_OPACITY = 0.5
MIN_SHOWN_MOTION, MIN_SHOWN_TURN_DEG = 2e-3, 2.0
"""What moves by less [m, degrees] has no shade, which would flicker within the object."""


class GhostView:
    """Shows a proposal of the session.

    Args:
        scene: of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: SettlingProposal | None = None
        self._handles: list[Any] = []

    def show(self, proposal: SettlingProposal | None, shapes: ObjectMeshes) -> None:
        """Brings the browser to a proposal, or to none.

        Args:
            proposal: of the view.
            shapes: of the library's objects.
        """
        if proposal is self._shown:
            return
        self._shown = proposal
        for handle in self._handles:
            handle.remove()
        self._handles = []
        if proposal is None:
            return
        moved = moved_names(proposal, MIN_SHOWN_MOTION, MIN_SHOWN_TURN_DEG)
        for instance in proposal.document.instances:
            if name_of(instance) in moved:
                self._add(name_of(instance), instance.object, instance.X_SO.matrix(), shapes)

    def _add(self, name: str, object: str, X_SO: Any, shapes: ObjectMeshes) -> None:
        try:
            shape = shapes[object]
        except BurgError:  # what is wrong with it is told elsewhere
            return
        self._handles.append(
            self._scene.add_mesh_simple(
                f"/ghosts/{name}",
                shape.vertices,
                shape.faces,
                color=GHOST_COLOR,
                opacity=GHOST_OPACITY,
                side="double",
                cast_shadow=False,
                position=X_SO[:3, 3],
                wxyz=quaternion_from_rotation(X_SO[:3, :3]),
            )
        )


GAP_COLOR = (64, 140, 230)
"""As the status of what hovers."""
GAP_LINE_WIDTH = 2.0
"""[pixel]."""


@dataclass(eq=False)
class _GapLine:
    """A line and its label."""

    line: viser.LineSegmentsHandle
    label: viser.LabelHandle


class HeightView:
    """Shows how far selected objects are above what is below them.

    Args:
        scene: of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: dict[str, _GapLine] = {}

    def show(self, view: SessionView) -> None:
        """Brings the browser to a view."""
        for name in [name for name in self._shown if name not in view.gaps]:
            self._shown.pop(name).line.remove()  # and the label below it
        for name, gap in view.gaps.items():
            lower, upper = bounds(view.state, name)
            x, y = (lower[:2] + upper[:2]) / 2.0
            ends = np.array([[x, y, lower[2]], [x, y, lower[2] - gap]])
            shown = self._shown.get(name) or self._made(name, ends)
            self._shown[name] = shown
            shown.line.points = ends[None].astype(np.float32)
            shown.label.position = ends.mean(axis=0)
            shown.label.text = f"{1e3 * gap:.1f} mm"

    def _made(self, name: str, ends: Array) -> _GapLine:
        line = self._scene.add_line_segments(
            f"/heights/{name}",
            ends[None],
            GAP_COLOR,
            thickness=GAP_LINE_WIDTH,
            thickness_units="screen",
        )
        label = self._scene.add_label(f"/heights/{name}/label", "", anchor="center-left")
        return _GapLine(line, label)
