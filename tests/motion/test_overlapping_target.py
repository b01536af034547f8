"""An object that stands in an obstacle may get at most 1 mm deeper on its way up."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake import sample_grasps
from burg_drake.core import Array, Pose, grasp_from_axes, inverse, transform_points
from burg_drake.motion import ArmPath, ArmReach, HandSweep, ReachSettings
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene, placed_vertices
from burg_drake.station import GraspMotion, Obstacle, Station, load_station

BOTTLE = Instance(name="bottle", object="bottle", X_SO=Pose((0.45, 0.0, 0.0)))
MOST = 1e-3
"""Metres deeper than at the start that the object may get."""


def place(instance: Instance, **background: Obstacle) -> tuple[Scene, Station]:
    """A scene whose frame is the world."""
    station = load_station("panda_tabletop")
    document = replace(station.document, X_WS=Pose(), background=background)
    few = SceneDocument(name="few", library="household", instances=(instance,))
    scene = Scene(few, load_scene("tabletop_six").library, Path("few.yaml"))
    return scene, replace(station, document=document)


def bottle_in_pole(depth: float) -> tuple[Scene, Station]:
    """The pole is on the far side of the bottle, which is that deep in it [m]."""
    edge = placed_vertices(place(BOTTLE)[0], "bottle")[:, 0].max() - depth
    pole = Obstacle(X_WB=Pose((edge + 0.015, 0.0, 0.3)), size=(0.03, 0.03, 0.6))
    return place(BOTTLE, pole=pole)


def leaning(drift: float) -> GraspMotion:
    """A lift that drives the object into the pole by a distance [m]."""
    return GraspMotion(lift_direction=(drift / 0.3, 0.0, 1.0))


def deepening(path: ArmPath, reach: ArmReach, p_WV: Array) -> float:
    """How much farther along x the bottle gets than at the start [m]."""
    arm = reach.diagram.station.document.arm
    assert arm is not None
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    q = [a + share * (b - a) for a, b in itertools.pairwise(path.lift)]
    X_WH = arm.X_WA.matrix() @ reach.kinematics.forward(np.vstack(q))[0]
    moved = X_WH @ inverse(X_WH[0])
    far = np.array([transform_points(X, p_WV)[:, 0].max() for X in moved])
    return float((far - far[0]).max())


@pytest.mark.parametrize(("drift", "found"), [(0.99e-3, False), (0.94e-3, True)])
def test_no_path_drives_an_object_deeper_than_allowed(drift: float, found: bool) -> None:
    """The hand deviates by up to 0.5 mm from the straight lift where it has room, and so does the
    object."""
    scene, station = bottle_in_pole(2.4e-3)
    sampled = sample_grasps(scene, station, 24, seed=1)
    reach = ArmReach(scene, station, settings=ReachSettings(motion=leaning(drift)))
    X_WG = reach.diagram.X_WO("bottle") @ sampled.X_OG
    verdicts = reach.check_all(["bottle"] * len(X_WG), X_WG, sampled.width)
    paths = [verdict.path for verdict in verdicts if verdict.path is not None]
    p_WV = placed_vertices(scene, "bottle")
    deeper = [deepening(path, reach, p_WV) for path in paths]
    assert max(deeper, default=0.0) <= MOST
    assert (len(deeper) > 5) == found


@pytest.mark.parametrize(("deepest", "free"), [(1.2e-3, True), (1.35e-3, False)])
def test_the_deepest_overlap_may_lie_between_two_samples(deepest: float, free: bool) -> None:
    """Two edges pass each other: the depth rises from 0.3 mm and falls by 0.7 mm a millimetre."""
    turned = {"rpy_deg": (0.0, 45.0, 0.0)}
    box = Instance(name="box", object="box", X_SO=Pose((0.4, 0.0, 0.2), **turned))
    # The box is 60 x 158 x 210 mm and turned about the middle of its bottom.
    x, z = np.sqrt(0.5) * np.array([0.03 + 0.21, 0.21 - 0.03]) + (0.4, 0.2)
    half = 0.05 * np.sqrt(0.5)  # of the diagonal of the rail
    rise = (deepest - 0.3e-3) * np.sqrt(2.0)
    edge = x + half - deepest * np.sqrt(2.0), 0.0, z + rise
    rail = Obstacle(X_WB=Pose(edge, **turned), size=(0.05, 0.3, 0.05))
    sweep = HandSweep(*place(box, rail=rail), GraspMotion())
    aside = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, 0.6, 0.3))
    found = sweep.lift("box", aside[None], np.array([0.06]))
    assert found.free[0] == free
    if free:
        assert found.room[0] <= 2.0 * (1.3e-3 - deepest)
    else:
        assert found.blocker[0] == "rail"
        assert -found.clearance[0] == pytest.approx(deepest, abs=5e-5)
        assert found.at[0] == pytest.approx(rise, abs=1e-4)
