"""The map of what an arm reaches, held against Drake's checker and other inverse kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Pose,
    inverse,
    make_pose,
    swap_fingers,
    transform_points,
)
from burg_drake.motion import (
    ArmCollision,
    ArmKinematics,
    ArmSpan,
    ReachabilityMap,
    ReachabilitySettings,
    empty_scene,
    map_reachability,
    solve_ik,
    without_free_objects,
)
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, build_station_diagram, load_station

COARSE = ReachabilitySettings(
    spacing=0.2, heights=(0.06, 0.2), tilts_deg=(0.0, 50.0), headings=(1, 3), yaws=2
)
STARTS = 48
SOME = slice(None, None, 3)


@pytest.fixture(scope="module")
def six() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def shelf_map(six: Scene) -> ReachabilityMap:
    return map_reachability(six, load_station("panda_shelf"), settings=COARSE)


def grasps(reachability: ReachabilityMap, station: Station) -> np.ndarray:
    """(Z, Y, X, K, 4, 4) the grasps of a map in the world, one by one."""
    shape = reachability.reached.shape
    X_WG = np.empty((*shape, 4, 4))
    X_WS = station.document.X_WS.matrix()
    for k, j, i, o in np.ndindex(*shape):
        p_SG = [[reachability.x[i], reachability.y[j], reachability.heights[k]]]
        X_WG[k, j, i, o] = make_pose(reachability.R_WG[o], transform_points(X_WS, p_SG)[0])
    return X_WG


def test_agrees_with_drake_and_numeric_inverse_kinematics(
    six: Scene, shelf_map: ReachabilityMap
) -> None:
    """Among shelf and objects, from many random starts for each grasp, exactly checked."""
    station = load_station("panda_shelf")
    diagram = build_station_diagram(six, station, robot="arm", weld_objects=True)
    arm, collision = ArmKinematics.of(diagram), ArmCollision(diagram)
    assert station.document.arm is not None
    X_WG = grasps(shelf_map, station).reshape(-1, 4, 4)[SOME]
    X_AG = inverse(station.document.arm.X_WA.matrix()) @ X_WG
    rng = np.random.default_rng(3)
    found = np.zeros(len(X_AG), dtype=bool)
    for X in (X_AG, swap_fingers(X_AG)):
        pose = np.repeat(np.flatnonzero(~found), STARTS)
        start = rng.uniform(arm.lower, arm.upper, (len(pose), 7))
        goal = station.hand.X_AH(X)[pose]
        q, met = solve_ik(arm, goal, start, iterations=40, tolerance=1e-6, margin=0.01)
        for k in np.flatnonzero(met):
            if not found[pose[k]]:
                found[pose[k]] = collision.is_free(q[k])
    reached = shelf_map.reached.ravel()[SOME]
    assert 0.2 < found.mean() < 0.9
    assert (reached == found).mean() > 0.97


def test_orientations() -> None:
    settings = ReachabilitySettings()
    tilt, R_WG = settings.orientations
    assert len(tilt) == (1 + 6 + 10) * 4
    np.testing.assert_allclose(np.arccos(np.clip(-R_WG[:, 2, 2], -1, 1)), tilt, atol=1e-7)
    np.testing.assert_allclose(np.linalg.det(R_WG), 1.0)
    grasp = make_pose(R_WG)
    either = np.stack([grasp, swap_fingers(grasp)], axis=1)[..., :3, :3].reshape(-1, 9)
    apart = np.abs(either[:, None] - either).max(axis=-1) + np.eye(len(either))
    assert apart.min() > 0.1  # all different, however the fingers are put


@pytest.mark.thorough
def test_nothing_is_reached_beyond_the_span() -> None:
    """Half of the board is out of reach of an arm that stands 40 cm back."""
    station = load_station("panda_tabletop")
    assert station.document.arm is not None
    arm = replace(station.document.arm, X_WA=Pose((-0.4, 0.0, 0.0)))
    far = replace(station, document=replace(station.document, arm=arm))
    scene = empty_scene()
    reachability = map_reachability(scene, far, settings=replace(COARSE, spacing=0.05))
    diagram = build_station_diagram(scene, far, robot="arm", weld_objects=True)
    span = ArmSpan.of(ArmKinematics.of(diagram), far)
    p_WG = grasps(reachability, far)[..., :3, 3]
    distance = np.linalg.norm(p_WG - span.p_WJ, axis=-1)
    assert (distance[reachability.reached] < span.radius).all()
    assert (distance > span.radius).mean() > 0.2
    assert 0.1 < reachability.covered[0] < 0.9


def test_objects_are_in_the_way(six: Scene, shelf_map: ReachabilityMap) -> None:
    empty = map_reachability(
        without_free_objects(six), load_station("panda_shelf"), settings=COARSE
    )
    assert not (shelf_map.reached & ~empty.reached).any()
    assert shelf_map.reached.mean() < 0.95 * empty.reached.mean()


@pytest.mark.thorough
def test_a_point_does_not_depend_on_the_others(shelf_map: ReachabilityMap, six: Scene) -> None:
    low = replace(COARSE, heights=COARSE.heights[:1])
    alone = map_reachability(six, load_station("panda_shelf"), settings=low)
    np.testing.assert_array_equal(alone.reached, shelf_map.reached[:1])


def test_shares() -> None:
    reached = np.zeros((1, 2, 3, 4), dtype=bool)
    reached[0, 1, 2] = (True, False, True, True)
    reached[0, 0, 0] = (False, False, False, True)
    reachability = ReachabilityMap(
        x=np.array([0.1, 0.3, 0.5]),
        y=np.array([0.1, 0.3]),
        heights=np.array([0.05]),
        tilt=np.array([0.0, 0.0, 1.0, 1.0]),
        R_WG=np.tile(np.eye(3), (4, 1, 1)),
        reached=reached,
        cell=(0.2, 0.2),
    )
    np.testing.assert_array_equal(reachability.share, [[[0.25, 0, 0], [0, 0, 0.75]]])
    np.testing.assert_array_equal(reachability.share_from_above, [[[0, 0, 0], [0, 0, 0.5]]])
    assert reachability.covered == pytest.approx([2 / 6])
    assert reachability.covered_from_above == pytest.approx([1 / 6])
    near = [[0.11, 0.12, 0.3], [0.59, 0.4, 0.0], [0.3, 0.3, 0.05]]
    np.testing.assert_array_equal(reachability.share_at(near), [0.25, 0.75, 0.0])


def test_cells_cover_the_board(shelf_map: ReachabilityMap) -> None:
    assert shelf_map.cell == pytest.approx((0.594 / 3, 0.42 / 3))
    assert shelf_map.x == pytest.approx([0.099, 0.297, 0.495])
    assert shelf_map.y == pytest.approx([0.07, 0.21, 0.35])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"spacing": 0.0}, "spacing must be above 0 m, and each height at least 0 m"),
        ({"heights": ()}, "spacing must be above 0 m, and each height at least 0 m"),
        ({"headings": (1, 6)}, "3 tilts_deg and 2 headings; give one number of headings for each"),
        (
            {"tilts_deg": (0.0, 30.0, 200.0)},
            "tilts_deg is [0.0, 30.0, 200.0]; each must be from 0 to 180",
        ),
        ({"yaws": 0}, "yaws, headings and redundant must be whole numbers above 0"),
    ],
)
def test_bad_settings(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError) as error:
        ReachabilitySettings(**wrong)  # type: ignore[arg-type]
    assert message in str(error.value)


def test_a_station_without_an_arm() -> None:
    with pytest.raises(InvalidInputError, match=r"'wsg_tabletop' .* has no arm"):
        map_reachability(empty_scene(), load_station("wsg_tabletop"))
