"""Bounds on distances to solids against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import make_pose, rotation_from_rpy
from burg_drake.geometry import Shape
from burg_drake.motion import (
    DistanceField,
    DistanceFieldSettings,
    HullSolid,
    ProximitySolid,
    solid_of,
)

X_WP = make_pose(rotation_from_rpy((0.3, -0.5, 0.8)), (0.4, 0.1, 0.2))
HALF = np.array((0.03, 0.05, 0.02))


def box_distance(p: np.ndarray) -> np.ndarray:
    beyond = np.abs((p - X_WP[:3, 3]) @ X_WP[:3, :3]) - HALF
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def box() -> ProximitySolid:
    return solid_of(Shape.box(X_WP, HALF), np.eye(4))


def box_of_planes() -> ProximitySolid:
    polytope = Shape.box(X_WP, HALF).polytope
    assert polytope is not None
    moved = polytope.moved(X_WP)
    return HullSolid(moved.normals, moved.offsets, moved.vertices)


def ball_distance(p: np.ndarray) -> np.ndarray:
    return np.linalg.norm(p - X_WP[:3, 3], axis=1) - 0.04


def cylinder_distance(p: np.ndarray) -> np.ndarray:
    q = (p - X_WP[:3, 3]) @ X_WP[:3, :3]
    beyond = np.column_stack([np.hypot(q[:, 0], q[:, 1]) - 0.03, np.abs(q[:, 2]) - 0.06])
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


CASES = {
    "box": (box, box_distance),
    "planes": (box_of_planes, box_distance),
    "ball": (lambda: solid_of(Shape.ball(X_WP, 0.04), np.eye(4)), ball_distance),
    "cylinder": (
        lambda: solid_of(Shape.cylinder(X_WP, 0.03, 0.06), np.eye(4)),
        cylinder_distance,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bounds_hold_and_are_tight(case: str) -> None:
    solid, distance = CASES[case][0](), CASES[case][1]
    field = DistanceField.of([solid])
    rng = np.random.default_rng(0)
    p = np.concatenate(
        [rng.uniform(-1.0, 1.5, (20_000, 3)), X_WP[:3, 3] + rng.uniform(-0.15, 0.15, (60_000, 3))]
    )
    true = distance(p)
    single = p.T.astype(np.float32)
    lower, upper = field.lower_at(single), field.upper_at(single)
    assert np.all(lower <= true + 1e-6)
    assert np.all(upper >= true - 1e-6)
    near = np.abs(true) < 0.05
    assert np.isfinite(upper[near]).all()
    assert (upper - lower)[near].max() < 6.0 * DistanceFieldSettings.cell_size
    assert np.median((upper - lower)[near]) < 3.0 * DistanceFieldSettings.cell_size


def test_large_boxes_are_exact() -> None:
    table = Shape.box(make_pose(p_AB=(0.3, 0.0, -0.05)), np.array((0.6, 0.7, 0.05)))
    field = DistanceField.of([solid_of(table, np.eye(4))])
    p = np.array([(0.1, 0.2, 0.123), (0.3, 0.9, 0.0), (0.0, 0.0, -0.01), (1.0, 0.8, 0.1)])
    single = p.T.astype(np.float32)
    exact = [0.123, 0.2, -0.01, np.sqrt(0.1**2 + 0.1**2 + 0.1**2)]
    np.testing.assert_allclose(field.upper_at(single), exact, atol=1e-6)
    np.testing.assert_allclose(field.lower_at(single)[:3], exact[:3], atol=1e-6)
    assert 0.0 < field.lower_at(single)[3] <= exact[3]


def test_nothing_is_infinitely_far() -> None:
    assert np.isinf(DistanceField.of([]).lower_at(np.zeros((3, 2), dtype=np.float32))).all()
