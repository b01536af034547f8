"""Batched forward kinematics against Drake's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.motion import ArmLinks
from burg_drake.scene import load_scene
from burg_drake.station import build_station_diagram, load_station
from tests.motion.gantry import gantry_diagram


@pytest.mark.parametrize("station", ["panda_offset", "panda_wsg", "ur5e_tabletop", "gantry"])
def test_all_bodies_are_where_drake_puts_them(station: str, tmp_path: Path) -> None:
    """The gantry's joints slide."""
    if station == "gantry":
        built = gantry_diagram(tmp_path)
    else:
        built = build_station_diagram(
            load_scene("tabletop_six"), load_station(station), robot="arm", weld_objects=True
        )
    links = ArmLinks.from_diagram(built)
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (20, len(built.arm_joints)))
    poses = links.poses(q)
    context = built.plant.CreateDefaultContext()
    positions = built.plant.GetPositions(context)
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (4, 3))
    assert set(links.frame_of) == set(built.robot_bodies)
    for k, x in enumerate(q):
        positions[[joint.position_start() for joint in built.arm_joints]] = x
        built.plant.SetPositions(context, positions)
        for body, frame in links.frame_of.items():
            X_WB = built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(body))
            X_FB = links.X_FB[body]
            in_frame = (points @ X_FB[:3, :3].T + X_FB[:3, 3]).astype(np.float32)
            placed = poses.transform_points(frame, in_frame)[:, :, k]
            np.testing.assert_allclose(placed, X_WB.multiply(points.T), atol=2e-6)
            own = poses.transform_per_frame(np.array([frame] * 4), in_frame)
            np.testing.assert_array_equal(own[:, :, k], placed)
            each = poses.transform_per_node(
                np.array([frame]), in_frame.T[:, :, None], np.array([k])
            )
            np.testing.assert_array_equal(each[:, :, 0], placed)


def test_poses_between_frames(tmp_path: Path) -> None:
    """Of a turning and of a sliding arm, against poses in the world."""
    panda = build_station_diagram(
        load_scene("tabletop_six"), load_station("panda_offset"), robot="arm", weld_objects=True
    )
    rng = np.random.default_rng(2)
    for links in map(ArmLinks.from_diagram, (panda, gantry_diagram(tmp_path))):
        q = rng.uniform(-1.0, 1.0, (5, len(links.turns)))
        table = links.poses(q).table.astype(float)
        X_WF = np.zeros((4, 4, *table.shape[2:]))
        X_WF[:3], X_WF[3, 3] = table.swapaxes(0, 1), 1.0
        X_WF = np.moveaxis(X_WF, (0, 1), (-2, -1))
        for first, last in ((0, 2), (1, 2), (1, 1), (0, 3)):
            X = links.relative_poses(tuple(range(first, last)), q[:, first:last])
            np.testing.assert_allclose(X_WF[first] @ X, X_WF[last], atol=1e-6)
