"""Postures over the objects of a scene, by Drake's own kinematics."""

from __future__ import annotations

import numpy as np

from burg_drake.motion import ArmLinks, ObjectViewLimits, postures_over_objects
from burg_drake.scene import load_scene
from burg_drake.station import build_station_diagram, load_station


def test_the_hand_looks_at_an_object() -> None:
    station = load_station("panda_tabletop")
    diagram = build_station_diagram(load_scene("tabletop_six"), station, weld_objects=True)
    plant, joints = diagram.plant, diagram.arm_joints
    lower, upper = np.array(
        [(j.position_lower_limits()[0], j.position_upper_limits()[0]) for j in joints]
    ).T
    assert station.document.arm is not None
    home = np.array(station.document.arm.home)
    q = postures_over_objects(diagram, ArmLinks.from_diagram(diagram), home, lower, upper)
    assert len(q) > 200 and (lower <= q).all() and (q <= upper).all()
    context = plant.CreateDefaultContext()
    hand = plant.GetBodyByName(station.hand.body, plant.GetModelInstanceByName("hand"))
    objects = np.array([diagram.X_WO(name)[:3, 3] for name in diagram.scene.instances])
    for row in q[:100]:
        for joint, position in zip(joints, row, strict=True):
            joint.set_angle(context, position)
        X_WG = plant.EvalBodyPoseInWorld(context, hand).GetAsMatrix4() @ station.hand.X_HG.matrix()
        way = objects - X_WG[:3, 3]
        distance = np.linalg.norm(way, axis=1)
        near = (distance > ObjectViewLimits.min_distance - 1e-5) & (
            distance < ObjectViewLimits.max_distance + 1e-5
        )
        assert (near & (way @ X_WG[:3, 2] > (ObjectViewLimits.min_cosine - 1e-4) * distance)).any()
