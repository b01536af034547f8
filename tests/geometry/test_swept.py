"""Swept shapes against their support function, which is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import inverse, make_pose, transform_points
from burg_drake.geometry import (
    SWEPT_CYLINDER_SIDES,
    Ball,
    Body,
    Cylinder,
    Shape,
    swept_body,
    swept_shape,
)


def support(shape: Shape, u: np.ndarray) -> np.ndarray:
    """How far a shape reaches along unit vectors (K, 3)."""
    u_P = u @ shape.X_BP[:3, :3]
    match shape.convex:
        case Ball(radius=radius):
            own = np.full(len(u), radius)
        case Cylinder(radius=radius, half_length=half_length):
            own = radius * np.hypot(u_P[:, 0], u_P[:, 1]) + half_length * np.abs(u_P[:, 2])
        case _:
            assert shape.polytope is not None
            own = (u_P @ shape.polytope.vertices.T).max(axis=1)
    return own + u @ shape.X_BP[:3, 3]


def random_pose(rng: np.random.Generator) -> np.ndarray:
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return make_pose(R * np.sign(np.linalg.det(R)), rng.uniform(-0.1, 0.1, 3))


def shape(kind: str, rng: np.random.Generator) -> Shape:
    X_BP = random_pose(rng)
    match kind:
        case "box":
            return Shape.box(X_BP, rng.uniform(0.01, 0.05, 3))
        case "hull":
            return Shape.hull(X_BP, rng.uniform(-0.05, 0.05, (12, 3)))
        case "ball":
            return Shape.ball(X_BP, rng.uniform(0.01, 0.05))
    return Shape.cylinder(X_BP, *rng.uniform(0.01, 0.05, 2))


def directions(rng: np.random.Generator) -> np.ndarray:
    u = rng.normal(size=(500, 3))
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


@pytest.mark.parametrize("kind", ["box", "hull", "ball", "cylinder", "upright"])
def test_support_of_a_sum_is_the_sum_of_supports(kind: str) -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        one, u = shape(kind, rng), directions(rng)
        way = 0.2 * one.X_BP[:3, 2] if kind == "upright" else rng.uniform(-0.2, 0.2, 3)
        expected = support(one, u) + np.maximum(u @ way, 0.0)
        found = np.max([support(s, u) for s in swept_shape(one, way)], axis=0)
        larger = (
            one.half[0] * (1.0 / np.cos(np.pi / SWEPT_CYLINDER_SIDES) - 1.0)
            if kind == "cylinder"
            else 0.0
        )
        assert (found >= expected - 1e-9).all() and (found <= expected + larger + 1e-9).all()


def test_a_swept_ball_has_no_gaps() -> None:
    """Points of a capsule lie in one of its three shapes."""
    rng = np.random.default_rng(4)
    ball, way = Shape.ball(random_pose(rng), 0.03), rng.uniform(-0.2, 0.2, 3)
    points = ball.X_BP[:3, 3] + rng.uniform(0, 1, (3000, 1)) * way
    points += directions(rng).repeat(6, axis=0) * 0.03 * rng.uniform(0, 0.999, (3000, 1))
    inside = np.zeros(len(points), dtype=bool)
    for part in swept_shape(ball, way):
        x, y, z = transform_points(inverse(part.X_BP), points).T
        match part.convex:
            case Ball(radius=radius):
                inside |= x * x + y * y + z * z <= radius**2
            case Cylinder(radius=radius, half_length=half_length):
                inside |= (x * x + y * y <= radius**2) & (np.abs(z) <= half_length)
    assert inside.all()


def test_no_way_is_no_change() -> None:
    one = shape("hull", np.random.default_rng(0))
    assert swept_shape(one, np.zeros(3)) == [one]


def test_a_body_is_swept_in_the_world() -> None:
    """A box that is turned over and moved sweeps a taller box."""
    X_WB = make_pose([[0, 1, 0], [1, 0, 0], [0, 0, -1]], (0.3, 0.2, 0.1))
    body = Body(X_WB, [Shape.box(make_pose(p_AB=(0.0, 0.0, 0.05)), np.array((0.01, 0.02, 0.03)))])
    swept = swept_body(body, np.array((0.0, 0.0, -0.4)))
    np.testing.assert_allclose(swept.low, (0.28, 0.19, -0.38), atol=1e-12)
    np.testing.assert_allclose(swept.high, (0.32, 0.21, 0.08), atol=1e-12)
