"""Distance of convex shapes: closed forms, a convex programme, Drake, and the batch."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from pydrake.geometry import (
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Shape as DrakeShape,
)
from pydrake.math import RigidTransform
from random_shapes import KINDS, random_pose, random_shape
from scipy.optimize import minimize, nnls

from burg_drake.core import inverse, make_pose, rotation_from_rpy, transform_points
from burg_drake.geometry import (
    DISTANCE_TOLERANCE,
    Poses,
    Shape,
    ShapeBatch,
    convex_distance,
    shape_distances,
)

HERE = np.eye(4)
CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
TURNED = make_pose(rotation_from_rpy((0.4, -1.1, 2.0)), (3.0, -2.0, 0.7))


def apart(one: Shape, other: Shape, X_BA: np.ndarray = HERE) -> float:
    """Distance of two shapes given in A and B; the same whichever comes first."""
    zero = np.zeros(1, dtype=np.intp)
    A, B = ShapeBatch.of([one]), ShapeBatch.of([other])
    (forth,) = shape_distances(A, zero, B, zero, Poses.of(X_BA[None]))
    (back,) = shape_distances(B, zero, A, zero, Poses.of(inverse(X_BA)[None]))
    assert forth == pytest.approx(back, abs=2 * DISTANCE_TOLERANCE)
    return float(forth)


def cube(X_BP: np.ndarray = HERE, size: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Shape:
    return Shape.box(X_BP, np.array(size) / 2)


def lifted(x: float, y: float, z: float, rpy: tuple[float, ...] = (0.0, 0.0, 0.0)) -> np.ndarray:
    return make_pose(rotation_from_rpy(rpy), (x, y, z))


QUARTER = np.pi / 4
CLOSED_FORMS = {
    "parallel faces": (cube(), cube(lifted(0.3, -0.2, 1.25)), 0.25),
    "faces that overlap by a sliver": (cube(), cube(lifted(0.9999, 0.9999, 1.01)), 0.01),
    "a pad over a large table": (
        cube(size=(1.2, 1.4, 0.1)),
        cube(lifted(0.3, 0.5, 0.05 + 0.00925 + 1e-4), (0.0175, 0.0152, 0.0185)),
        1e-4,
    ),
    "parallel edges": (cube(), cube(lifted(1.3, 1.4, 0.2)), 0.5),
    "vertices": (cube(), cube(lifted(1.2, 1.3, 1.6)), 0.7),
    "an edge over a face": (
        cube(),
        cube(lifted(0.1, 0.0, 0.5 + np.sqrt(0.5) + 0.02, (QUARTER, 0, 0))),
        0.02,
    ),
    "crossed edges": (
        cube(lifted(0, 0, 0, (QUARTER, 0, 0))),
        cube(lifted(0, 0, np.sqrt(2) + 0.03, (0, QUARTER, 0))),
        0.03,
    ),
    "a vertex over a face": (
        cube(),
        Shape.hull(lifted(0.2, 0.1, 0.57), np.vstack([np.zeros(3), CUBE + np.array([0, 0, 0.6])])),
        0.07,
    ),
    "a ball over a face": (cube(), Shape.ball(lifted(0.1, 0.2, 0.9), 0.3), 0.1),
    "a ball by an edge": (cube(), Shape.ball(lifted(0.8, 0.9, 0.1), 0.3), 0.2),
    "a ball off a corner": (cube(), Shape.ball(lifted(0.7, 0.8, 1.1), 0.3), 0.4),
    "two balls": (Shape.ball(HERE, 0.1), Shape.ball(lifted(0.3, 0.4, 0.0), 0.2), 0.2),
    "a cylinder's end over a face": (
        cube(),
        Shape.cylinder(lifted(0.2, 0.1, 1.2), 0.3, 0.5),
        0.2,
    ),
    "a cylinder's side at a face": (cube(), Shape.cylinder(lifted(0.9, 0.3, 0.1), 0.3, 0.5), 0.1),
    "a cylinder's side at an edge": (
        cube(),
        Shape.cylinder(lifted(0.8, 0.9, 0.2), 0.3, 0.5),
        0.2,
    ),
    "a tilted cylinder's rim over a face": (
        cube(),
        Shape.cylinder(lifted(0, 0, 0.5 + 0.8 / np.sqrt(2) + 0.05, (QUARTER, 0, 0)), 0.3, 0.5),
        0.05,
    ),
    "rims of cylinders on a common axis, side by side": (
        Shape.cylinder(HERE, 0.3, 0.5),
        Shape.cylinder(lifted(0.8, 0.0, 1.4), 0.2, 0.5),
        0.5,
    ),
    "crossed cylinders": (
        Shape.cylinder(HERE, 0.3, 0.5),
        Shape.cylinder(lifted(0.55, 0.0, 0.0, (np.pi / 2, 0, 0)), 0.2, 0.5),
        0.05,
    ),
    "a ball over a rim": (
        Shape.cylinder(HERE, 0.3, 0.5),
        Shape.ball(lifted(0.6, 0.0, 0.9), 0.1),
        0.4,
    ),
}


@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_closed_forms(case: str) -> None:
    one, other, expected = CLOSED_FORMS[case]
    curved = (one.curved and other.curved) or "cylinder" in case
    for X in (HERE, TURNED):
        moved = Shape(X @ other.X_BP, other.half, other.convex, other.polytope, other.curved)
        found = apart(one, moved, X)
        assert found == pytest.approx(expected, abs=DISTANCE_TOLERANCE if curved else 1e-14)


@pytest.mark.parametrize("case", ["parallel faces", "crossed edges", "two balls"])
def test_what_overlaps_or_touches_is_not_apart(case: str) -> None:
    one, other, gap = CLOSED_FORMS[case]
    way = other.X_BP[:3, 3] / np.linalg.norm(other.X_BP[:3, 3])
    if case == "parallel faces":
        way = np.array([0.0, 0.0, 1.0])
    for step in (gap, gap + 1e-7, gap + 1e-3, gap + 0.1, gap + 0.5):
        X = make_pose(p_AB=-step * way) @ other.X_BP
        moved = Shape(X, other.half, other.convex, other.polytope, other.curved)
        assert apart(one, moved) <= DISTANCE_TOLERANCE


def drake_distance(
    one: tuple[DrakeShape, RigidTransform],
    other: tuple[DrakeShape, RigidTransform],
    X_BA: np.ndarray,
) -> np.ndarray:
    """Signed distances by Drake of two shapes given in A and B [m]."""
    graph = SceneGraph()
    source = graph.RegisterSource("test")
    frame = graph.RegisterFrame(source, GeometryFrame("A"))
    (shape_A, X_A), (shape_B, X_B) = one, other
    ids = (
        graph.RegisterGeometry(source, frame, GeometryInstance(X_A, shape_A, "one")),
        graph.RegisterAnchoredGeometry(source, GeometryInstance(X_B, shape_B, "other")),
    )
    for geometry in ids:
        graph.AssignRole(source, geometry, ProximityProperties())
    context = graph.CreateDefaultContext()
    found = []
    for X in X_BA:
        poses = FramePoseVector()
        poses.set_value(frame, RigidTransform(X))
        graph.get_source_pose_port(source).FixValue(context, poses)
        query = graph.get_query_output_port().Eval(context)
        found.append(query.ComputeSignedDistancePairClosestPoints(*ids).distance)
    return np.array(found)


@pytest.mark.parametrize("kinds", list(itertools.product(KINDS, KINDS)))
def test_agrees_with_drake(kinds: tuple[str, str]) -> None:
    """Where curved shapes meet hulls or cylinders, Drake's search ends up to some millimetres above
    the distance: it is an upper bound there; see the tests below for these."""
    rng = np.random.default_rng(11)
    searched = [{"ball", "hull"}, {"cylinder", "hull"}, {"cylinder", "box"}, {"cylinder"}]
    for _ in range(4):
        (one, drake_one, X_A), (other, drake_other, X_B) = (
            random_shape(kind, rng) for kind in kinds
        )
        X_BA = np.array([random_pose(rng, 0.1) for _ in range(60)])
        truth = drake_distance((drake_one, X_A), (drake_other, X_B), X_BA)
        zero = np.zeros(len(X_BA), dtype=np.intp)
        found = shape_distances(
            ShapeBatch.of([one]), zero, ShapeBatch.of([other]), zero, Poses.of(X_BA)
        )
        clear = truth > 1e-5
        assert clear.sum() > 10
        assert (found[truth < -1e-5] <= DISTANCE_TOLERANCE).all()
        assert (found[clear] <= truth[clear] + DISTANCE_TOLERANCE).all()
        if set(kinds) not in searched:
            np.testing.assert_allclose(found[clear], truth[clear], atol=DISTANCE_TOLERANCE)


def test_ball_and_hull_by_least_squares() -> None:
    """The nearest point of a hull as a combination of its vertices, by non-negative least squares
    in which the sum of the weights has to be 1."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        points = rng.uniform(-1, 1, (12, 3)) * rng.uniform(0.01, 0.04, 3)
        X_BA = random_pose(rng, 0.1)
        found = apart(Shape.hull(HERE, points), Shape.ball(HERE, 0.004), X_BA)
        vertices = transform_points(X_BA, points)
        weight, _ = nnls(np.vstack([vertices.T, np.full(12, 1e3)]), np.array([0, 0, 0, 1e3]))
        assert weight.sum() == pytest.approx(1.0, abs=1e-6)
        truth = np.linalg.norm(vertices.T @ weight) - 0.004
        assert found == pytest.approx(max(truth, 0.0), abs=1e-7)


def nearest_by_programme(points: np.ndarray, radius: float, half: float, X_CP: np.ndarray) -> float:
    """Distance of a hull of points from a cylinder, as a convex programme over a point of each."""
    moved = transform_points(X_CP, points)
    n = len(points)

    def gap(v: np.ndarray) -> np.ndarray:
        return v[:n] @ moved - v[n:]

    found = minimize(
        lambda v: gap(v) @ gap(v),
        np.concatenate([np.full(n, 1 / n), np.zeros(3)]),
        jac=lambda v: 2 * np.concatenate([moved @ gap(v), -gap(v)]),
        bounds=[(0, 1)] * n + [(None, None)] * 2 + [(-half, half)],
        constraints=[
            {"type": "eq", "fun": lambda v: v[:n].sum() - 1},
            {"type": "ineq", "fun": lambda v: radius**2 - v[n] ** 2 - v[n + 1] ** 2},
        ],
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 300},
    )
    return float(np.sqrt(found.fun))


def test_cylinders_by_a_convex_programme() -> None:
    rng = np.random.default_rng(2)
    clear = 0
    for _ in range(25):
        points, radius, half = rng.uniform(-0.5, 0.5, (8, 3)), *rng.uniform(0.2, 0.6, 2)
        X_CP = random_pose(rng, 1.2)
        found = apart(Shape.hull(HERE, points), Shape.cylinder(HERE, radius, half), X_CP)
        if found > 1e-3:
            clear += 1
            truth = nearest_by_programme(points, radius, half, X_CP)
            assert found == pytest.approx(truth, abs=1e-6)
    assert clear >= 10


def random_pairs(n: int) -> tuple[ShapeBatch, np.ndarray, ShapeBatch, np.ndarray, Poses]:
    rng = np.random.default_rng(6)
    sides = [ShapeBatch.of([random_shape(kind, rng)[0] for kind in KINDS * 3]) for _ in range(2)]
    X_BA = np.array([random_pose(rng, 0.15) for _ in range(n)])
    return sides[0], rng.integers(0, 12, n), sides[1], rng.integers(0, 12, n), Poses.of(X_BA)


def test_results_do_not_depend_on_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    one, shape, other, piece, X_BA = random_pairs(400)
    found = shape_distances(one, shape, other, piece, X_BA)
    assert 100 < (found > DISTANCE_TOLERANCE).sum() < 400
    for k in range(60):
        (alone,) = shape_distances(one, shape[k : k + 1], other, piece[k : k + 1], X_BA[k : k + 1])
        assert alone == found[k]
    mixed = np.random.default_rng(0).permutation(400)
    turned = shape_distances(one, shape[mixed], other, piece[mixed], X_BA[mixed])
    assert turned.tobytes() == found[mixed].tobytes()
    monkeypatch.setattr(convex_distance, "VERTEX_BLOCK", 200)
    assert shape_distances(one, shape, other, piece, X_BA).tobytes() == found.tobytes()
    assert shape_distances(one, shape[:0], other, piece[:0], X_BA[:0]).shape == (0,)


def test_a_ceiling_changes_nothing_below_it() -> None:
    one, shape, other, piece, X_BA = random_pairs(400)
    found = shape_distances(one, shape, other, piece, X_BA)
    limited = shape_distances(one, shape, other, piece, X_BA, 0.05)
    below = found <= 0.05
    assert 50 < below.sum() < 350
    assert limited[below].tobytes() == found[below].tobytes()
    assert ((limited[~below] == np.inf) | (limited[~below] == found[~below])).all()
    assert np.isinf(limited[~below]).mean() > 0.9
