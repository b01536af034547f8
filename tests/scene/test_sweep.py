"""Ways to contact by closed form, and by another solver of another formulation."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize
from scipy.spatial import ConvexHull

from burg_drake.core import Array, make_pose, rotation_from_rpy, transform_points
from burg_drake.objects import load_library
from burg_drake.scene import ConvexShapes, contact_distances

UP = np.array([0.0, 0.0, 1.0])
FLAT = np.zeros((3, 3))
CORNERS = np.stack(np.meshgrid(*([-1.0, 1.0],) * 3), axis=-1).reshape(-1, 3)
ENDS = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(17)


def box(half: tuple[float, float, float]) -> ConvexShapes:
    return ConvexShapes.of([CORNERS * half], [FLAT])


def ball(radius: float) -> ConvexShapes:
    return ConvexShapes.of([np.zeros((1, 3))], [radius * np.eye(3)])


def cylinder(radius: float, half_length: float) -> ConvexShapes:
    return ConvexShapes.of([ENDS * half_length], [radius * np.diag([1.0, 1.0, 0.0])])


def way(a: ConvexShapes, b: ConvexShapes, direction: Array, limit: float = 10.0) -> float:
    """Of one shape to another."""
    one = np.array([0])
    return float(contact_distances(a, b, (one, one), direction, limit)[0])


def at(
    shapes: ConvexShapes, p: tuple[float, float, float], rpy: Array | None = None
) -> ConvexShapes:
    R = np.eye(3) if rpy is None else rotation_from_rpy(rpy)
    return shapes.moved(make_pose(R, p))


def test_boxes_face_to_face_beside_each_other_and_past_each_other() -> None:
    a, b = box((0.1, 0.2, 0.05)), box((0.3, 0.1, 0.05))
    assert way(a, at(b, (0.0, 0.0, 1.0)), UP) == pytest.approx(0.9, abs=1e-6)
    assert way(a, at(b, (0.399, 0.299, 1.0)), UP) == pytest.approx(0.9, abs=1e-6)
    assert way(a, at(b, (0.401, 0.0, 1.0)), UP) == np.inf
    assert way(a, at(b, (0.0, 0.0, -1.0)), UP) == np.inf  # behind
    assert way(a, at(b, (0.0, 0.0, 1.0)), UP, limit=0.8) == np.inf


def test_boxes_side_by_side_slide_along_each_other() -> None:
    a, b = box((0.1, 0.1, 0.1)), box((0.1, 0.1, 0.1))
    assert way(a, at(b, (0.2, 0.0, 0.5)), UP) == np.inf
    assert way(a, at(b, (0.2, 0.2, 0.5)), UP) == np.inf


def test_an_edge_meets_a_crossing_edge() -> None:
    # Two square bars, each turned by 45 degrees about its axis, cross at a right angle.
    bar = box((0.5, 0.1, 0.1))
    a = at(bar, (0.0, 0.0, 0.0), np.array([np.pi / 4, 0.0, 0.0]))
    b = at(bar, (0.07, -0.04, 1.0), np.array([np.pi / 4, 0.0, np.pi / 2]))
    assert way(a, b, UP) == pytest.approx(1.0 - 2.0 * 0.1 * np.sqrt(2.0), abs=1e-6)


def test_balls(rng: np.random.Generator) -> None:
    for _ in range(20):
        r, R = rng.uniform(0.01, 0.05, 2)
        aside, angle = 0.95 * rng.uniform(0.0, r + R), rng.uniform(0.0, 2.0 * np.pi)
        p = (aside * np.cos(angle), aside * np.sin(angle), 0.5)
        expected = 0.5 - np.sqrt((r + R) ** 2 - aside**2)
        assert way(ball(r), at(ball(R), p), UP) == pytest.approx(expected, abs=2e-6)
        missed = (r + R + 1e-5) / aside
        assert way(ball(r), at(ball(R), (p[0] * missed, p[1] * missed, 0.5)), UP) == np.inf


def test_standing_cylinders_meet_as_circles(rng: np.random.Generator) -> None:
    for _ in range(20):
        r, R = rng.uniform(0.01, 0.05, 2)
        aside = rng.uniform(-0.95, 0.95) * (r + R)
        expected = 0.4 - np.sqrt((r + R) ** 2 - aside**2)
        b = at(cylinder(R, 0.1), (0.4, aside, 0.03))
        assert way(cylinder(r, 0.05), b, np.array([1.0, 0.0, 0.0])) == pytest.approx(
            expected, abs=2e-6
        )
    lying = at(cylinder(0.03, 0.1), (0.0, 0.0, 0.5), np.array([np.pi / 2, 0.0, 0.4]))
    assert way(lying, at(box((1.0, 1.0, 0.05)), (0.0, 0.0, -0.05)), -UP) == pytest.approx(
        0.47, abs=1e-6
    )


def test_a_turned_cylinder_comes_down_on_its_rim() -> None:
    tilt, r, h = 0.5, 0.03, 0.05
    a = at(cylinder(r, h), (0.2, -0.1, 0.3), np.array([tilt, 0.0, 0.0]))
    table = at(box((1.0, 1.0, 0.05)), (0.0, 0.0, -0.05))
    lowest = 0.3 - h * np.cos(tilt) - r * np.sin(tilt)
    assert way(a, table, -UP) == pytest.approx(lowest, abs=1e-6)


def test_pieces_of_mug_and_bowl_as_a_linear_program_says(rng: np.random.Generator) -> None:
    """The least t such that a point lies within all planes of both pieces, one moved by t."""
    library = load_library("household")
    a, b = (
        [np.asarray(library.mesh(p).vertices) for p in library.entry(name).pieces]
        for name in ("mug", "bowl")
    )
    compared = 0
    for k in range(60):
        R = rotation_from_rpy(rng.uniform(-np.pi, np.pi, 3))
        p, q = a[rng.integers(len(a))], b[rng.integers(len(b))]
        p = transform_points(make_pose(R), p - p.mean(axis=0))
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        q = q - q.mean(axis=0) + 0.3 * direction + 0.005 * rng.normal(size=3)
        found = way(
            ConvexShapes.of([p], [FLAT]), ConvexShapes.of([q], [FLAT]), direction, limit=1.0
        )
        expected = _by_linear_program(p, q, direction)
        assert found == pytest.approx(expected, abs=2e-6), k
        compared += np.isfinite(expected)
    assert compared > 30


def test_the_first_contact_of_many_is_the_least(rng: np.random.Generator) -> None:
    shapes = [box(tuple(rng.uniform(0.01, 0.03, 3))) for _ in range(300)]
    places = np.column_stack([rng.uniform(-0.3, 0.3, (300, 2)), rng.uniform(0.5, 2.0, 300)])
    still = ConvexShapes.joined([at(s, tuple(p)) for s, p in zip(shapes, places, strict=True)])
    moving = ConvexShapes.joined([box((0.05, 0.05, 0.05)), at(box((0.05,) * 3), (0.2, 0.0, 0.2))])
    i, j = (index.ravel() for index in np.indices((2, 300)))
    low_m, high_m = moving.boxes()
    low, high = still.boxes()
    over = (low[j, :2] < high_m[i, :2]) & (low_m[i, :2] < high[j, :2])
    expected = np.where(over.all(axis=1), low[j, 2] - high_m[i, 2], np.inf).min()
    found = contact_distances(moving, still, (i, j), UP, np.inf)
    assert found.min() == pytest.approx(expected, abs=1e-6)


def test_what_is_enough_ends_the_search_and_changes_nothing_else(
    rng: np.random.Generator,
) -> None:
    """Among balls, some of them behind, the least way is known in closed form."""
    radius, count, sooner = 0.03, 40, 0
    one, balls = ball(radius), (np.zeros(count, dtype=int), np.arange(count))
    for _ in range(30):
        p = rng.uniform((-0.1, -0.1, -1.0), (0.1, 0.1, 1.0), (count, 3))
        p = p[np.abs(p[:, 2]) > 2.0 * radius]
        still = ConvexShapes.joined([at(one, tuple(q)) for q in p])
        pairs = balls[0][: len(p)], balls[1][: len(p)]
        aside = (p[:, :2] ** 2).sum(axis=1)
        ahead = (aside < (2.0 * radius) ** 2) & (p[:, 2] > 0.0)
        ways = p[ahead, 2] - np.sqrt((2.0 * radius) ** 2 - aside[ahead])
        expected, enough = ways.min(initial=np.inf), rng.uniform(0.0, 0.3)
        found = contact_distances(one, still, pairs, UP, np.inf, stop_below=enough).min()
        if expected < enough:
            assert expected - 2e-6 < found < enough
            sooner += found > expected + 1e-3
        else:
            assert found == pytest.approx(expected, abs=2e-6)
    assert sooner > 3  # it does end before the way is known


def _by_linear_program(p: Array, q: Array, direction: Array) -> float:
    """Way of the hull of p to that of q; infinite if it misses."""
    (A, a), (B, b) = (
        (hull.equations[:, :3], -hull.equations[:, 3]) for hull in (ConvexHull(p), ConvexHull(q))
    )
    # Unknowns x, t: B x <= b and A (x - t d) <= a.
    planes = np.block([[B, np.zeros((len(B), 1))], [A, -(A @ direction)[:, None]]])
    result = scipy.optimize.linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=planes,
        b_ub=np.concatenate([b, a]),
        bounds=[(None, None)] * 3 + [(0.0, None)],
    )
    return float(result.x[3]) if result.status == 0 else np.inf
