"""The look of an open hand: its pads are as far apart as the document says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recording import RecordingMeshcat

from burg_drake.core import inverse, make_pose, rotation_from_rpy, transform_points
from burg_drake.station import locate_hand
from burg_drake.visualization import GRIPPER_PATH, GripperView, hand_visuals


@pytest.mark.parametrize("name", ["panda_hand", "wsg_50"])
def test_pads_of_the_open_hand(name: str) -> None:
    """Around the grasp frame there is nothing within the opening, and something at its end."""
    hand, model, _ = locate_hand(name)
    visuals = hand_visuals(hand, model)
    assert len(visuals) >= 3
    X_GH = inverse(hand.X_HG.matrix())
    points = np.vstack([transform_points(X_GH @ v.X_HV, v.corners) for v in visuals])
    low = points[points[:, 2] > -0.005]  # what reaches as far as the pads
    assert np.abs(low[:, 0]).min() == pytest.approx(hand.opening[1] / 2, abs=2e-3)
    assert low[:, 0].min() == pytest.approx(-low[:, 0].max(), abs=1e-3)  # symmetric
    assert points[:, 2].max() < 0.03  # tips end shortly behind G, the rest is before it


def test_other_shapes(tmp_path: Path) -> None:
    """A hand with round visuals, by the bounds that it must have."""
    hand, model, _ = locate_hand("wsg_50")
    text = model.read_text()
    rounds = (
        "<sphere><radius>0.03</radius></sphere>",
        "<cylinder><radius>0.02</radius><length>0.1</length></cylinder>",
        "<capsule><radius>0.02</radius><length>0.1</length></capsule>",
        "<ellipsoid><radii>0.01 0.02 0.03</radii></ellipsoid>",
    )
    extra = "".join(
        f'<visual name="round{k}"><geometry>{shape}</geometry></visual>'
        for k, shape in enumerate(rounds)
    )
    link = f'<link name="{hand.body}">'
    assert link in text
    changed = tmp_path / "hand.sdf"
    changed.write_text(
        text.replace(link, link + extra).replace("meshes/", f"{model.parent}/meshes/")
    )
    before = len(hand_visuals(hand, model))
    visuals = hand_visuals(hand, changed)
    assert len(visuals) == before + 4
    sizes = sorted(tuple(np.round(np.ptp(v.corners, axis=0), 9)) for v in visuals)
    for size in [(0.06,) * 3, (0.04, 0.04, 0.1), (0.04, 0.04, 0.14), (0.02, 0.04, 0.06)]:
        assert size in sizes


def test_opacity() -> None:
    hand, model, _ = locate_hand("panda_hand")
    assert {v.color.a() for v in hand_visuals(hand, model, opacity=0.25)} == {0.25}


@pytest.mark.parametrize("name", ["panda_hand", "wsg_50"])
@pytest.mark.parametrize("width", [0.02, 0.05])
def test_pads_of_a_gripper_that_is_closed_to_a_width(
    recorder: RecordingMeshcat, name: str, width: float
) -> None:
    hand, model, _ = locate_hand(name)
    gripper = GripperView(recorder, hand, model)  # type: ignore[arg-type]
    assert recorder.properties[GRIPPER_PATH, "visible"] is False
    X_WG = make_pose(rotation_from_rpy([2.9, 0.2, 1.0]), (0.3, 0.1, 0.2))
    gripper.place(X_WG, width)
    assert recorder.properties[GRIPPER_PATH, "visible"] is True
    points = []
    for k, visual in enumerate(hand_visuals(hand, model)):
        (path,) = (p for p in recorder.transforms if p.endswith(f"/{k}") and p.count("/") == 4)
        points.append(transform_points(inverse(X_WG) @ recorder.X_WP(path), visual.corners))
    low = np.vstack(points)
    low = low[low[:, 2] > -0.005]  # what reaches as far as the pads
    assert np.abs(low[:, 0]).min() == pytest.approx(width / 2, abs=2e-3)
    gripper.place(X_WG, 1.0)
    assert gripper.closing_distance(1.0) == 0.0 and gripper.shown
