"""Replays: the same outcome as without a picture, an animation, and a camera with a clear view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from eye import VIEWS, in_view, messages, placed

from burg_drake.core import (
    InvalidInputError,
    Margins,
    Outcome,
    Pose,
    grasp_from_axes,
    make_pose,
    rotation_from_rpy,
    transform_points,
)
from burg_drake.scene import Scene
from burg_drake.simulation import HandTrial, TrialResult, TrialSettings
from burg_drake.station import ENGINES, GraspMotion, Obstacle, Station, load_station
from burg_drake.visualization import (
    PREFERRED_HEADING,
    SIGHT_CLEARANCE,
    camera_offset,
    describe_trial,
    open_meshcat,
    record_trial,
)
from tests.evaluation.composed import tabletop

X_OG = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the box, from above."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return tabletop("box", "mug")


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


def test_a_lift_is_recorded_and_ends_as_without_a_picture(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    early = HandTrial(scene, station).run("box", X_OG)
    whole = replace(ENGINES["standard"], whole_trial=True)
    shown = HandTrial(scene, station, engine=whole, meshcat=meshcat)
    result = record_trial(shown, "box", X_OG, meshcat)
    again = HandTrial(scene, station, engine=whole).run("box", X_OG)
    assert repr(result) == repr(again)  # NaN is not equal to itself
    assert result.outcome is early.outcome is Outcome.LIFTED
    assert result.margins.end_time > early.margins.end_time + 1.0
    recording = meshcat.get_mutable_recording()
    assert recording.autoplay()
    assert recording.loop_mode() == type(recording).LoopMode.kLoopRepeat
    page = meshcat.StaticHtml()
    assert b"set_animation" in b"".join(messages(page))
    (x, y), X_WS = scene.board.size, station.document.X_WS.matrix()
    board = transform_points(X_WS, [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]])
    X_WO = X_WS @ scene.X_SO("box")
    hand = X_WO @ X_OG @ make_pose(p_AB=(0.0, 0.0, -0.15))  # behind its palm
    raised = hand[:3, 3] + (0.0, 0.0, station.document.motion.lift_height)
    for view in VIEWS:
        seen = in_view(page, np.vstack([board, hand[:3, 3], raised]), view)
        assert np.abs(seen).max() < 1.0, view


def test_a_collision_is_a_still_picture(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    trial = HandTrial(scene, station, meshcat=meshcat)
    result = record_trial(trial, "box", X_OG @ make_pose(p_AB=(0, 0, 0.1)), meshcat)
    assert result.outcome is Outcome.COLLISION_TARGET
    assert b"set_animation" not in b"".join(messages(meshcat.StaticHtml()))
    assert meshcat.HasPath("/drake/visualizer/hand/panda_hand")


def test_a_collision_before_the_approach_is_shown_where_it_is(
    scene: Scene, station: Station
) -> None:
    """A rail is in the palm at the pregrasp, and above the hand at the grasp."""
    X_WG = station.document.X_WS.matrix() @ scene.X_SO("box") @ X_OG
    far = GraspMotion(standoff=0.30)
    above = tuple(float(x) for x in X_WG[:3, 3] + (0.0, 0.0, 0.35))
    rail = Obstacle(X_WB=Pose(above), size=(0.3, 0.3, 0.01))
    document = replace(station.document, background={"rail": rail}, motion=far)
    meshcat = open_meshcat()
    trial = HandTrial(
        scene,
        replace(station, document=document),
        settings=TrialSettings(approach=True),
        meshcat=meshcat,
    )
    result = record_trial(trial, "box", X_OG, meshcat)
    assert (result.outcome, result.blocker) == (Outcome.HAND_COLLISION_APPROACH, "rail")
    X_WH = station.hand.X_AH(X_WG @ make_pose(p_AB=(0.0, 0.0, -far.standoff)))
    shown = placed(meshcat.StaticHtml(), "/drake/visualizer/hand/panda_hand")
    np.testing.assert_allclose(shown, X_WH, atol=1e-6)


def test_unknown_target(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    trial = HandTrial(scene, station, meshcat=meshcat)
    with pytest.raises(InvalidInputError, match=r"'table' is not a free instance.*mug"):
        record_trial(trial, "table", X_OG, meshcat)


@pytest.mark.parametrize("yaw", np.deg2rad([0, 35, 90, 200]))
def test_the_camera_looks_across_the_fingers(yaw: float) -> None:
    X_WG = make_pose(rotation_from_rpy([np.pi, 0.0, yaw]), (0.4, 0.1, 0.2))
    offset = camera_offset(X_WG, np.empty((0, 3)))
    heading = offset[:2] / np.linalg.norm(offset[:2])
    assert abs(heading @ X_WG[:2, 0]) < 0.5  # at least 60 degrees from the closing direction
    assert heading @ PREFERRED_HEADING > 0.0
    assert offset[2] > 0.0


def test_the_camera_avoids_what_is_in_the_way() -> None:
    X_WG = make_pose(rotation_from_rpy([np.pi, 0.0, 0.3]), (0.4, 0.1, 0.2))
    free = camera_offset(X_WG, np.empty((0, 3)))
    behind = X_WG[:3, 3] - 0.3 * free
    assert np.allclose(camera_offset(X_WG, behind[None]), free)
    obstacle = X_WG[:3, 3] + 0.3 * free
    around = camera_offset(X_WG, obstacle[None])
    flat = (1.0, 1.0, 0.0)
    beside = np.linalg.norm(np.cross(around * flat, 0.3 * free * flat)) / np.linalg.norm(around[:2])
    assert beside > SIGHT_CLEARANCE or around[:2] @ free[:2] < 0.0


@pytest.mark.parametrize("yaw", np.deg2rad([0, 80, 160, 250, 330]))
def test_the_camera_is_not_behind_a_hand_that_comes_from_the_side(yaw: float) -> None:
    approach = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    X_WG = grasp_from_axes((-np.sin(yaw), np.cos(yaw), 0.0), approach, (0.4, 0.1, 0.2))
    heading = camera_offset(X_WG, np.empty((0, 3)))[:2] / 0.8
    assert heading @ approach[:2] > -0.3


def test_a_vertical_closing_axis_has_a_camera() -> None:
    X_WG = grasp_from_axes((0, 0, 1), (1, 0, 0), (0.4, 0.1, 0.2))
    assert np.isfinite(camera_offset(X_WG, np.empty((0, 3)))).all()


def test_describe() -> None:
    lifted = TrialResult(
        outcome=Outcome.LIFTED_DISTURBED,
        margins=Margins(
            overlap=0.0,
            slip=0.0012,
            tilt=np.deg2rad(2.0),
            pad_force=39.96,
            patch_area=1.234e-4,
            lift=0.2996,
            others_moved=0.0123,
            others_turned=np.deg2rad(50.0),
            end_time=2.5,
        ),
        displacements={"bowl": 0.0004, "can": 0.0123, "box": 0.0},
        toppled="can",
    )
    assert describe_trial(lifted) == [
        "lifted disturbed",
        "lift 300 mm, slip 1.2 mm, tilt 2.0 deg, pad force 40.0 N, patch 123 mm²,"
        " others moved 12.3 mm, others turned 50.0 deg",
        "moved can 12.3 mm, bowl 0.4 mm",
        "toppled can",
    ]
    blocked = TrialResult(
        outcome=Outcome.COLLISION_CLUTTER, margins=Margins(overlap=0.0034), blocker="mug"
    )
    assert describe_trial(blocked) == ["collision clutter (mug, 3.4 mm deep)"]
    arm = TrialResult(outcome=Outcome.ARM_COLLISION, margins=Margins(overlap=0.0), blocker="shelf")
    assert describe_trial(arm) == ["arm collision (shelf)"]
