"""Penetration depth against closed forms, and against a linear programme that knows no axes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from burg_drake.core import inverse, make_pose, rotation_from_rpy
from burg_drake.geometry import (
    Ball,
    Boxes,
    Convex,
    Cylinder,
    Hull,
    Polytope,
    Poses,
    penetration_depths,
)

CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
PAD = np.array([0.0175, 0.0152, 0.0185])


def depth(one: Polytope, other: Convex, X_AB: np.ndarray) -> float:
    """Of two shapes given in A and B; 0 if they are apart."""
    (found,) = penetration_depths(one, other, Poses.of(inverse(X_AB)[None]))
    return max(0.0, float(found))


def both_ways(one: np.ndarray, other: np.ndarray, X_AB: np.ndarray) -> float:
    """Of two hulls of points; the same whichever of them comes first."""
    first, second = (Polytope.from_points(points) for points in (one, other))
    forth, back = depth(first, Hull(second), X_AB), depth(second, Hull(first), inverse(X_AB))
    assert forth == pytest.approx(back, abs=1e-12)
    return forth


def box(size: np.ndarray) -> Boxes:
    return Boxes(np.asarray(size)[None] / 2)


def random_pose(rng: np.random.Generator, spread: float) -> np.ndarray:
    return make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), rng.uniform(-spread, spread, 3))


def test_cube_has_six_faces_and_twelve_edges() -> None:
    cube = Polytope.from_points(CUBE)
    assert cube.vertices.shape == (8, 3)
    np.testing.assert_allclose(np.abs(cube.normals).sum(axis=1), 1.0)
    assert len(cube.normals) == 6 and len(cube.edge_faces) == 12
    np.testing.assert_allclose(cube.offsets, 0.5)
    for faces, ends in zip(cube.edge_faces, cube.edge_vertices, strict=True):
        heights = cube.normals[faces] @ cube.vertices[ends].T
        np.testing.assert_allclose(heights, 0.5)


def test_boxes_are_recognised() -> None:
    X = make_pose(rotation_from_rpy((0.3, -1.0, 2.0)), (0.1, 0.2, -0.3))
    found = Polytope.from_points(CUBE * PAD).moved(X).as_box()
    assert found is not None
    np.testing.assert_allclose(sorted(found[1]), sorted(PAD / 2))
    np.testing.assert_allclose(found[0][:3, 3], X[:3, 3], atol=1e-12)
    assert np.linalg.det(found[0][:3, :3]) == pytest.approx(1.0)
    sheared = CUBE + np.outer(CUBE[:, 2], (0.1, 0.0, 0.0))
    assert Polytope.from_points(sheared).as_box() is None
    assert Polytope.prism(0.1, 0.1, sides=6).as_box() is None


def test_pad_in_a_large_table_is_as_deep_as_its_tip() -> None:
    """The way out is up, however near the table's side is not."""
    table = CUBE * (1.2, 1.4, 0.1)
    X_AB = make_pose(p_AB=(0.3, -0.2, 0.05 + 0.00925 - 0.012))
    assert both_ways(table, CUBE * PAD, X_AB) == pytest.approx(0.012)
    assert depth(Polytope.from_points(table), box(PAD), X_AB) == pytest.approx(0.012)


def test_two_cubes_edge_to_edge() -> None:
    """Turned by 45 degrees about x and about y, crossed edges meet at a distance of sqrt(2)."""
    R = rotation_from_rpy((np.pi / 4, 0, 0)).T @ rotation_from_rpy((0, np.pi / 4, 0))
    p = rotation_from_rpy((np.pi / 4, 0, 0)).T @ (0, 0, np.sqrt(2) - 0.03)
    assert both_ways(CUBE, CUBE, make_pose(R, p)) == pytest.approx(0.03)
    assert depth(Polytope.from_points(CUBE), box(np.ones(3)), make_pose(R, p)) == pytest.approx(
        0.03
    )
    far = rotation_from_rpy((np.pi / 4, 0, 0)).T @ (0, 0, np.sqrt(2) + 0.03)
    assert both_ways(CUBE, CUBE, make_pose(R, far)) == 0.0


def test_faces_alone_see_no_gap_between_crossed_edges() -> None:
    """Edges 30 mm apart; with faces over each other they tell the same as all axes."""
    R = rotation_from_rpy((np.pi / 4, 0, 0)).T @ rotation_from_rpy((0, np.pi / 4, 0))
    for gap in (0.03, -0.03):
        p = rotation_from_rpy((np.pi / 4, 0, 0)).T @ (0, 0, np.sqrt(2) + gap)
        X_BA = Poses.of(inverse(make_pose(R, p))[None])
        one, other = Polytope.from_points(CUBE), box(np.ones(3))
        (bound,) = penetration_depths(one, other, X_BA, faces_only=True)
        assert bound > max(0.05, depth(one, other, make_pose(R, p)))
    for height in (0.98, 1.02):
        X_AB = make_pose(rotation_from_rpy((0, 0, 0.3)), (0.1, 0.2, height))
        (bound,) = penetration_depths(one, other, Poses.of(inverse(X_AB)[None]), faces_only=True)
        assert bound == pytest.approx(1.0 - height, abs=1e-12)


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


@pytest.mark.parametrize("kind", ["hull", "box"])
def test_depth_is_the_shortest_way_out(kind: str) -> None:
    """Moved by a little less than the depth in any direction two hulls still overlap, and some
    direction takes them apart with a little more."""
    rng = np.random.default_rng(0)
    tried = 0
    for _ in range(10):
        one = rng.normal(size=(12, 3))
        size = rng.uniform(0.5, 2.5, 3)
        other = rng.normal(size=(9, 3)) if kind == "hull" else CUBE * size
        X_AB = make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), 1.2 * rng.normal(size=3))
        moved = other @ X_AB[:3, :3].T + X_AB[:3, 3]
        if kind == "hull":
            found = both_ways(one, other, X_AB)
        else:
            found = depth(Polytope.from_points(one), box(size), X_AB)
        assert (found > 0.0) == overlap_exists(one, moved)
        if found == 0.0:
            continue
        tried += 1
        directions = rng.normal(size=(15, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        assert all(overlap_exists(one, moved + 0.99 * found * d) for d in directions)
        ways = Polytope.from_points((one[:, None] - moved[None]).reshape(-1, 3)).normals
        assert not all(overlap_exists(one, moved + 1.01 * found * d) for d in ways)
    assert tried >= 3


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
    for R in (np.eye(3), rotation_from_rpy((0.4, 1.0, -2.0))):
        found = depth(Polytope.from_points(CUBE), Ball(0.2), make_pose(R, p_AB))
        assert found == pytest.approx(expected, abs=1e-12)


CYLINDER = Cylinder(radius=0.3, half_length=0.5)


@pytest.mark.parametrize(
    ("R_AB", "p_AB", "expected"),
    [
        (np.eye(3), (0.0, 0.2, 0.97), 0.03),  # end on face
        (np.eye(3), (0.76, 0.3, 0.1), 0.04),  # side on face
        (np.eye(3), (0.6, 0.62, 0.0), 0.3 - np.hypot(0.1, 0.12)),  # side on a parallel edge
        (np.eye(3), (0.72, 0.72, 0.0), 0.0),  # the boxes overlap, but not the shapes
        # lying across an edge of the cube, which is at 45 degrees
        (rotation_from_rpy((0, -np.pi / 4, 0)) @ rotation_from_rpy((np.pi / 2, 0, 0)),
         (0.5 + 0.28 / np.sqrt(2), 0.0, 0.5 + 0.28 / np.sqrt(2)), 0.02),
        # tilted by 45 degrees over the top face: the rim is lowest, (r + l) / sqrt(2) below
        (rotation_from_rpy((np.pi / 4, 0, 0)), (0.0, 0.0, 0.5 + 0.8 / np.sqrt(2) - 0.05), 0.05),
    ],
)  # fmt: skip
def test_cylinder_and_cube(R_AB: np.ndarray, p_AB: tuple[float, ...], expected: float) -> None:
    found = depth(Polytope.from_points(CUBE), CYLINDER, make_pose(R_AB, p_AB))
    assert found == pytest.approx(expected, abs=1e-12)


def least_overlap(one: Polytope, cylinder: Cylinder, X_AB: np.ndarray) -> float:
    """The least overlap over all directions, by a search that knows nothing of faces or edges."""

    def overlap(d: np.ndarray) -> float:
        d = d / np.linalg.norm(d)
        x, y, z = X_AB[:3, :3].T @ d
        reach = cylinder.radius * np.hypot(x, y) + cylinder.half_length * abs(z)
        return float((one.vertices @ d).max() - X_AB[:3, 3] @ d + reach)

    i = np.arange(500) + 0.5  # a spiral of directions all around
    polar, turn = np.arccos(1 - 2 * i / 500), np.pi * (1 + 5**0.5) * i
    around = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)])
    starts = sorted(around.T, key=overlap)[:4]
    options = {"xatol": 1e-9, "fatol": 1e-11, "maxiter": 1000}
    return min(
        minimize(overlap, start, method="Nelder-Mead", options=options).fun for start in starts
    )


def test_cylinder_depth_is_the_least_over_all_directions() -> None:
    rng = np.random.default_rng(4)
    hull = Polytope.from_points(0.4 * rng.normal(size=(10, 3)))
    deep = 0
    for one in (Polytope.from_points(CUBE), hull):
        for _ in range(5):
            X_AB = random_pose(rng, 0.8)
            found = depth(one, CYLINDER, X_AB)
            assert found == pytest.approx(max(0.0, least_overlap(one, CYLINDER, X_AB)), abs=1e-8)
            deep += found > 0.0
    assert 2 < deep < 10


def test_prism_is_within_a_cylinder_by_a_hundredth() -> None:
    prism, pad = Polytope.prism(0.034, 0.05), Polytope.box(PAD / 2)
    rng = np.random.default_rng(3)
    touching = 0
    for _ in range(30):
        X_AB = random_pose(rng, 0.04)
        inner = depth(prism, Boxes(PAD[None] / 2), X_AB)
        outer = depth(pad, Cylinder(0.034, 0.05), inverse(X_AB))
        assert 0.0 <= outer - inner < 1.1e-5
        touching += outer > 0.0
    assert touching >= 10
