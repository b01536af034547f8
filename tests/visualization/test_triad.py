"""Arrows along the axes of a frame, in the colours that everybody gives them."""

from __future__ import annotations

import numpy as np
import pytest
from recording import RecordingMeshcat

from burg_drake.core import make_pose, rotation_from_rpy
from burg_drake.visualization import AXIS_COLORS, TriadStyle, draw_triad


def test_tips_are_on_the_axes_and_shafts_behind_them(recorder: RecordingMeshcat) -> None:
    X_WF = make_pose(rotation_from_rpy((0.3, -1.1, 2.0)), (0.1, 0.2, 0.3))
    style = TriadStyle(length=0.05, radius=0.002, head=0.01)
    draw_triad(recorder, "/f", X_WF, style)  # type: ignore[arg-type]
    assert recorder.X_WP("/f") == pytest.approx(X_WF)
    for k, name in enumerate("xyz"):
        axis = X_WF[:3, k]
        tip, middle = (recorder.X_WP(f"/f/{name}/{part}") for part in ("head", "shaft"))
        assert tip[:3, 3] == pytest.approx(X_WF[:3, 3] + 0.05 * axis)
        assert tip[:3, 2] == pytest.approx(-axis)  # cones open from their tip along z
        assert middle[:3, 3] == pytest.approx(X_WF[:3, 3] + 0.02 * axis)
        assert np.abs(middle[:3, 2] @ axis) == pytest.approx(1.0)


def test_x_is_red_y_is_green_z_is_blue() -> None:
    for k, color in enumerate(AXIS_COLORS):
        assert int(np.argmax([color.r(), color.g(), color.b()])) == k
