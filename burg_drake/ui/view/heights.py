"""Lines from objects that touch nothing below them down to what is there, with the distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser

from burg_drake.compose.document import bounds
from burg_drake.compose.editing import SessionView
from burg_drake.core import Array

COLOR = (64, 140, 230)
"""As the status of what hovers."""
WIDTH = 2.0
"""[pixel]."""


@dataclass(eq=False)
class _Shown:
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
        self._shown: dict[str, _Shown] = {}

    def show(self, view: SessionView) -> None:
        """Brings the browser to a view."""
        for name in [name for name in self._shown if name not in view.gaps]:
            shown = self._shown.pop(name)
            shown.line.remove()
            shown.label.remove()
        for name, gap in view.gaps.items():
            lower, upper = bounds(view.state, name)
            x, y = (lower[:2] + upper[:2]) / 2.0
            ends = np.array([[x, y, lower[2]], [x, y, lower[2] - gap]])
            shown = self._shown.get(name) or self._made(name, ends)
            self._shown[name] = shown
            shown.line.points = ends[None].astype(np.float32)
            shown.label.position = ends.mean(axis=0)
            shown.label.text = f"{1e3 * gap:.1f} mm"

    def _made(self, name: str, ends: Array) -> _Shown:
        line = self._scene.add_line_segments(
            f"/heights/{name}", ends[None], COLOR, thickness=WIDTH, thickness_units="screen"
        )
        label = self._scene.add_label(f"/heights/{name}/label", "", anchor="center-left")
        return _Shown(line, label)
