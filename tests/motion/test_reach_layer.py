"""Where over a board an arm grasps from above, held against motions of single points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Pose,
    make_pose,
    rot_z,
    rotation_from_rpy,
    transform_points,
)
from burg_drake.motion import (
    ArmReach,
    ReachLayer,
    answers_by_refinement,
    empty_scene,
    reach_from_above,
)
from burg_drake.scene import Board
from burg_drake.station import Station, load_station
from burg_drake.visualization import map_colors, reach_image

BOARD = Board(size=(0.5, 0.3))


def placed(name: str, X_WA: Pose) -> Station:
    """A station with its arm elsewhere."""
    station = load_station(name)
    assert station.document.arm is not None
    arm = replace(station.document.arm, X_WA=X_WA)
    return replace(station, document=replace(station.document, arm=arm))


@pytest.fixture(scope="module")
def back() -> Station:
    """The Panda so far from the board that it reaches a part of it."""
    return placed("panda_tabletop", Pose((-0.42, 0.05, 0.0)))


@pytest.fixture(scope="module")
def layer(back: Station) -> ReachLayer:
    return reach_from_above(back, BOARD, spacing=0.04, yaws=2)


@pytest.mark.thorough
def test_points_are_as_when_asked_alone(layer: ReachLayer, back: Station) -> None:
    """Whole motions of some points, also of such as were not asked."""
    assert 0.2 < layer.covered < 0.9
    reach = ArmReach(empty_scene(), back)
    rng = np.random.default_rng(5)
    rows = rng.choice(layer.reached.size, 12, replace=False)
    j, i, k = np.unravel_index(rows, layer.reached.shape)
    p_SG = np.column_stack([layer.x[i], layer.y[j], np.full(len(rows), layer.height)])
    down = rotation_from_rpy((np.pi, 0.0, 0.0))
    R_WG = np.array([down @ rot_z(layer.yaw[n]) for n in k])
    X_WG = make_pose(R_WG, transform_points(back.document.X_WS.matrix(), p_SG))
    alone = [found.outcome is None for found in reach.check_all([""] * len(rows), X_WG)]
    assert (layer.reached[j, i, k] == alone).mean() > 0.9


def test_nothing_beyond_the_arms_length(layer: ReachLayer, back: Station) -> None:
    """A stretched Panda's flange is 0.855 m from its shoulder, 0.333 m above the base; its fingers
    hang below."""
    y, x = np.meshgrid(layer.y, layer.x, indexing="ij")
    p_SG = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    arm = back.document.arm
    assert arm is not None
    p_WG = transform_points(back.document.X_WS.matrix(), p_SG) - arm.X_WA.matrix()[:3, 3]
    beside = np.hypot(p_WG[:, 0], p_WG[:, 1]).reshape(x.shape)
    assert (beside > 0.9).any()
    assert not layer.reached[beside > 0.9].any()
    assert layer.reached[beside < 0.62].all()


def test_points_that_are_asked() -> None:
    """A disc is found with its edge, by asking few points outside of it; a speck may be missed."""
    y, x = np.mgrid[:40, :50]
    disc = np.hypot(x - 21.0, y - 17.0) < 12.0
    asked = np.zeros(disc.shape, int)

    def ask(j: np.ndarray, i: np.ndarray) -> np.ndarray:
        asked[j, i] += 1
        return disc[j, i][:, None]

    found = answers_by_refinement(40, 50, 1, ask)[..., 0]
    assert (found == disc).mean() > 0.99
    assert asked.max() == 1
    assert asked.sum() < 0.35 * disc.size
    np.testing.assert_array_equal(
        answers_by_refinement(1, 1, 1, lambda j, i: disc[17:18, 21:22]), True
    )


def test_shares_of_points(layer: ReachLayer) -> None:
    middle = [layer.x[3], layer.y[2]]
    beside = [[-0.01, 0.1], [0.51, 0.1], [0.1, 0.31]]
    assert layer.share_at([middle])[0] == layer.share[2, 3]
    np.testing.assert_array_equal(layer.share_at(beside), 0.0)


def test_image(layer: ReachLayer) -> None:
    image = reach_image(layer, pixels=3, opacity=0.5)
    rows, columns, _ = layer.reached.shape
    assert image.shape == (3 * rows, 3 * columns, 4)
    assert (image[..., 3] == 128).all()
    for j, i in ((0, 0), (rows - 1, 2), (3, columns - 1)):
        expected = np.round(255 * map_colors(layer.share[j, i]))
        np.testing.assert_array_equal(image[3 * (rows - 1 - j) + 1, 3 * i + 1, :3], expected)


def test_what_is_refused() -> None:
    station = load_station("panda_tabletop")
    for wrong in ({"spacing": 0.0}, {"height": -0.1}, {"yaws": 0}, {"height": np.nan}):
        with pytest.raises(InvalidInputError, match=r"spacing .* must be above 0, height"):
            reach_from_above(station, BOARD, **wrong)
    with pytest.raises(InvalidInputError, match=r"'wsg_tabletop' .* has no arm"):
        reach_from_above(load_station("wsg_tabletop"), BOARD)
