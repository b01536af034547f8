"""Penetration depth against closed forms, and against a linear programme that knows no axes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from burg_drake.core.frames import inverse, make_pose, rotation_from_rpy
from burg_drake.grasping.penetration import Polytope, penetration_depth

CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def test_cube_has_three_normals_and_three_edge_directions() -> None:
    cube = Polytope.from_points(CUBE)
    assert len(cube.vertices) == 8
    np.testing.assert_allclose(np.abs(cube.normals).sum(axis=0), 1.0)
    np.testing.assert_allclose(np.abs(cube.edges).sum(axis=0), 1.0)
    assert len(cube.normals) == len(cube.edges) == 3


def test_pad_in_a_large_table_is_as_deep_as_its_tip() -> None:
    """The way out is up, however near the table's side is not."""
    table = Polytope.from_points(CUBE * (1.2, 1.4, 0.1))
    pad = Polytope.from_points(CUBE * (0.0175, 0.0152, 0.0185))
    X_AB = make_pose(p_AB=(0.3, -0.2, 0.05 + 0.00925 - 0.012))
    assert penetration_depth(table, pad, X_AB) == pytest.approx(0.012)
    assert penetration_depth(pad, table, inverse(X_AB)) == pytest.approx(0.012)


def test_two_cubes_edge_to_edge() -> None:
    """Turned by 45 degrees about x and about y, crossed edges meet at a distance of sqrt(2)."""
    cube = Polytope.from_points(CUBE)
    R = rotation_from_rpy((np.pi / 4, 0, 0)).T @ rotation_from_rpy((0, np.pi / 4, 0))
    p = rotation_from_rpy((np.pi / 4, 0, 0)).T @ (0, 0, np.sqrt(2) - 0.03)
    assert penetration_depth(cube, cube, make_pose(R, p)) == pytest.approx(0.03)
    far = rotation_from_rpy((np.pi / 4, 0, 0)).T @ (0, 0, np.sqrt(2) + 0.03)
    assert penetration_depth(cube, cube, make_pose(R, far)) == 0.0


def overlap_exists(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two hulls share a point: convex combinations that are equal."""
    n, m = len(one), len(other)
    equal = np.hstack([one.T, -other.T])
    sums = np.zeros((2, n + m))
    sums[0, :n], sums[1, n:] = 1.0, 1.0
    found = linprog(
        np.zeros(n + m), A_eq=np.vstack([equal, sums]), b_eq=[0, 0, 0, 1, 1], bounds=(0, None)
    )
    return found.status == 0


def test_depth_is_the_shortest_way_out_of_random_hulls() -> None:
    """Moved by a little less than the depth in any direction two hulls still overlap, and some
    direction takes them apart with a little more."""
    rng = np.random.default_rng(0)
    tried = 0
    for _ in range(20):
        one, other = rng.normal(size=(12, 3)), rng.normal(size=(9, 3))
        X_AB = make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), rng.normal(size=3))
        moved = other @ X_AB[:3, :3].T + X_AB[:3, 3]
        depth = penetration_depth(Polytope.from_points(one), Polytope.from_points(other), X_AB)
        assert (depth > 0.0) == overlap_exists(one, moved)
        if depth == 0.0:
            continue
        tried += 1
        directions = rng.normal(size=(40, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        assert all(overlap_exists(one, moved + 0.99 * depth * d) for d in directions)
        normals = Polytope.from_points((one[:, None] - moved[None]).reshape(-1, 3)).normals
        ways = [s * d for d in normals for s in (1, -1)]
        assert not all(overlap_exists(one, moved + 1.01 * depth * d) for d in ways)
    assert tried >= 5


@pytest.mark.parametrize(
    ("p_AB", "expected"),
    [
        ((0.0, 0.0, 0.6), 0.1),  # above a face
        ((0.62, 0.64, 0.0), 0.2 - np.hypot(0.12, 0.14)),  # beside an edge
        ((0.58, 0.59, 0.56), 0.2 - np.sqrt(0.08**2 + 0.09**2 + 0.06**2)),  # off a corner
        ((0.65, 0.65, 0.0), 0.0),  # within the sum of extents, but past the edge
        ((0.1, 0.2, -0.3), 0.2 + 0.2),  # centre inside: out through the nearest face
    ],
)
def test_ball_and_cube(p_AB: tuple[float, ...], expected: float) -> None:
    cube, ball = Polytope.from_points(CUBE), Polytope.ball(0.2)
    for R in (np.eye(3), rotation_from_rpy((0.4, 1.0, -2.0))):
        X_AB = make_pose(R, p_AB)
        assert penetration_depth(cube, ball, X_AB) == pytest.approx(expected, abs=1e-12)
        assert penetration_depth(ball, cube, inverse(X_AB)) == pytest.approx(expected, abs=1e-12)


def test_two_balls() -> None:
    one, other = Polytope.ball(0.2), Polytope.ball(0.3)
    assert penetration_depth(one, other, make_pose(p_AB=(0.3, 0.0, -0.3))) == pytest.approx(
        0.5 - np.hypot(0.3, 0.3)
    )
    assert penetration_depth(one, other, np.eye(4)) == 0.5
    assert penetration_depth(one, other, make_pose(p_AB=(0.4, 0.4, 0.0))) == 0.0


def test_prism_is_the_hull_of_its_corners_and_a_cylinder_to_a_hundredth() -> None:
    prism = Polytope.prism(0.034, 0.1)
    hull = Polytope.from_points(prism.vertices)
    pad = Polytope.from_points(CUBE * (0.0175, 0.0152, 0.0185))
    rng = np.random.default_rng(3)
    touching = 0
    for _ in range(30):
        X_AB = make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), rng.uniform(-0.05, 0.05, 3))
        depth = penetration_depth(prism, pad, X_AB)
        assert depth == pytest.approx(penetration_depth(hull, pad, X_AB), abs=1e-7)
        touching += depth > 0.0
    assert touching >= 10
    for angle in np.linspace(0.0, 1.0, 7):  # a pad square to the side, anywhere around
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        X_AB = make_pose(rotation_from_rpy((0, 0, angle)), out * (0.034 + 0.00875 - 0.003))
        assert penetration_depth(prism, pad, X_AB) == pytest.approx(0.003, abs=1.1e-5)
