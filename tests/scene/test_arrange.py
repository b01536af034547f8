"""Layouts of the built-in objects, judged by linear programs over their convex pieces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.stats import chisquare, kstest

from burg_drake.core import Array, InvalidInputError, UnknownNameError, transform_points
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import (
    LAYOUT_NAMES,
    Arrangement,
    Board,
    LayoutName,
    ObjectRequest,
    ObjectShapes,
    PoseChoice,
    arrange,
    choose_objects,
    draw_pose,
)

BOARD = Board(size=(0.594, 0.42))


@pytest.fixture(scope="module")
def shapes() -> ObjectShapes:
    return ObjectShapes(load_library("household"))


OF_PIECES = ("banana", "bottle", "mug", "screwdriver", "scissors")
"""Objects that touch others with convex pieces."""


def laid_out(
    shapes: ObjectShapes,
    layout: LayoutName,
    seed: int,
    count: int = 6,
    only: tuple[str, ...] = (*OF_PIECES, "box", "can"),
) -> Arrangement:
    rng = np.random.default_rng(seed)
    wanted = choose_objects(shapes.library, count, rng, only=only)
    return arrange(wanted, shapes, BOARD, rng, layout=layout)


def placed_pieces(library: ObjectLibrary, arrangement: Arrangement) -> dict[str, list[Array]]:
    """Corners (N, 3) in S of what each instance touches others with: of its pieces, or of a prism
    within its cylinder."""
    placed = {}
    for one in arrangement.instances:
        entry = library.entry(one.object)
        primitive = entry.contact.primitive
        corners = [np.asarray(library.mesh(piece).vertices) for piece in entry.pieces]
        if primitive is not None and primitive.shape == "cylinder":
            angle = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
            radius, length = primitive.size
            x, y = radius * np.cos(angle), radius * np.sin(angle)
            ends = np.concatenate(
                [np.column_stack([x, y, np.full(256, z)]) for z in (-length / 2, length / 2)]
            )
            corners = [transform_points(primitive.X_OP.matrix(), ends)]
        placed[one.name or one.object] = [
            transform_points(one.X_SO.matrix(), points) for points in corners
        ]
    return placed


def overlap(one: Array, other: Array) -> bool:
    """Whether a point is a convex combination of both sets of points."""
    if (one.min(axis=0) > other.max(axis=0)).any() or (one.max(axis=0) < other.min(axis=0)).any():
        return False
    sums = np.zeros((5, len(one) + len(other)))
    sums[:3] = np.hstack([one.T, -other.T])
    sums[3, : len(one)] = sums[4, len(one) :] = 1.0
    right = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
    return bool(linprog(np.zeros(sums.shape[1]), A_eq=sums, b_eq=right).status == 0)


@pytest.mark.parametrize("layout", LAYOUT_NAMES)
def test_nothing_overlaps_or_is_beyond_the_edge(shapes: ObjectShapes, layout: LayoutName) -> None:
    arrangement = laid_out(shapes, layout, seed=1)
    assert len(arrangement.instances) + len(arrangement.missing) == 6
    assert len(arrangement.instances) >= 4
    pieces = placed_pieces(shapes.library, arrangement)
    for corners in pieces.values():
        points = np.concatenate(corners)
        assert points[:, :2].min() > -1e-4
        assert (points[:, :2].max(axis=0) < np.array(BOARD.size) + 1e-4).all()
        assert points[:, 2].min() > -1e-3
    for one, other in itertools.combinations(pieces.values(), 2):
        # a hundredth of a millimetre smaller, as what touches overlaps by rounding
        assert not any(
            overlap(p.mean(axis=0) + (p - p.mean(axis=0)) * 0.999, q) for p in one for q in other
        )


def test_what_touches_touches(shapes: ObjectShapes) -> None:
    """Each object is brought into contact: pieces that are larger by 0.05 mm overlap those of
    another object, and, see above, pieces that are smaller by less than that do not."""
    arrangement = laid_out(shapes, "touching", seed=3, count=4, only=OF_PIECES)
    assert not arrangement.missing
    pieces = list(placed_pieces(shapes.library, arrangement).values())
    shift = np.array(list(itertools.product((-5e-5, 5e-5), repeat=3)))
    for i, one in enumerate(pieces):
        larger = [(p[:, None] + shift).reshape(-1, 3) for p in one]
        others = [q for other in pieces[:i] + pieces[i + 1 :] for q in other]
        assert any(overlap(p, q) for p in larger for q in others)


def test_wide_is_wider_than_close(shapes: ObjectShapes) -> None:
    wide, close = (
        placed_pieces(shapes.library, laid_out(shapes, layout, seed=2, count=4)).values()
        for layout in ("wide", "close")
    )
    for one, other in itertools.combinations([np.concatenate(p) for p in wide], 2):
        assert np.linalg.norm(one[:, None, :2] - other[None, :, :2], axis=-1).min() > 0.0399
    for one, other in itertools.combinations([np.concatenate(p) for p in close], 2):
        assert np.linalg.norm(one[:, None, :2] - other[None, :, :2], axis=-1).min() > 0.0019


def hull_area(library: ObjectLibrary, arrangement: Arrangement) -> float:
    corners = placed_pieces(library, arrangement).values()
    return float(ConvexHull(np.concatenate([p[:, :2] for ps in corners for p in ps])).volume)


def test_packed_is_denser_than_all_random_ones(shapes: ObjectShapes) -> None:
    wanted = [ObjectRequest(name=f"box_{i}", object="box", pose=0) for i in range(4)]
    areas: dict[LayoutName, list[float]] = {"packed": [], "close": []}
    for layout, found in areas.items():
        for seed in range(5):
            rng = np.random.default_rng(seed)
            laid = arrange(wanted, shapes, Board(size=(0.841, 0.594)), rng, layout=layout)
            assert not laid.missing
            found.append(hull_area(shapes.library, laid))
    assert max(areas["packed"]) < min(areas["close"])
    # four boxes of 158 x 210 mm that lie side by side, 0.3 mm apart: almost no room is left
    assert max(areas["packed"]) < 1.03 * 4 * 0.158 * 0.210


def test_places_and_yaws_are_evenly_distributed(shapes: ObjectShapes) -> None:
    """Of a marble alone: Kolmogorov and Smirnov's test of x, y and yaw at a level of 1e-3."""
    rng = np.random.default_rng(0)
    wanted = [ObjectRequest(name="marble", object="marble")]
    poses = np.array(
        [
            arrange(wanted, shapes, BOARD, rng, layout="random").instances[0].X_SO.matrix()
            for _ in range(1000)
        ]
    )
    low, high = 0.015, np.array(BOARD.size) - 0.015
    share = (poses[:, :2, 3] - low) / (high - low)
    upright = shapes.library.entry("marble").X_SO(0)[:3, :3]
    turn = poses[:, :3, :3] @ upright.T
    yaw = np.arctan2(turn[:, 1, 0], turn[:, 0, 0]) / (2.0 * np.pi) % 1.0
    for values in (share[:, 0], share[:, 1], yaw):
        assert kstest(values, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef([*share.T, yaw]) - np.eye(3)).max() < 0.1


@pytest.mark.parametrize("how", ["probability", "uniform"])
def test_poses_are_drawn_as_asked(shapes: ObjectShapes, how: PoseChoice) -> None:
    """Chi-squared test at a level of 1e-3 of which side of a box is below."""
    rng = np.random.default_rng(1)
    poses = shapes.library.entry("box").stable_poses
    wanted = ObjectRequest(name="box", object="box")
    drawn = [draw_pose(wanted, shapes, rng, how) for _ in range(2000)]
    share = np.array([pose.probability for pose in poses])
    expected = share / share.sum() if how == "probability" else np.full(len(poses), 1 / len(poses))
    counts = np.bincount(drawn, minlength=len(poses))
    assert chisquare(counts, expected * counts.sum()).pvalue > 1e-3


def test_obstacles_and_roofs(shapes: ObjectShapes) -> None:
    """A wall across the board leaves one side; a roof above it leaves all that is low enough."""
    rng = np.random.default_rng(2)
    can = [ObjectRequest(name="can", object="can", pose=1)]
    corners = np.array(list(itertools.product((0.0, 0.45), (0.0, 0.42), (0.0, 0.3))))
    for _ in range(20):
        (one,) = arrange(can, shapes, BOARD, rng, obstacles=[corners]).instances
        assert one.X_SO.translation[0] >= 0.45 + 0.034
    roof = corners + np.array([0.0, 0.0, 0.12])
    places = [
        arrange(can, shapes, BOARD, rng, obstacles=[roof]).instances[0].X_SO for _ in range(20)
    ]
    assert min(place.translation[0] for place in places) < 0.45


def test_what_cannot_be_laid_out(shapes: ObjectShapes) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InvalidInputError, match="layout 'wild' does not exist; did you mean"):
        arrange([], shapes, BOARD, rng, layout="wild")  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match=r"stable pose 9 does not exist; give 0 to 2"):
        arrange([ObjectRequest(name="box", object="box", pose=9)], shapes, BOARD, rng)
    with pytest.raises(UnknownNameError, match=r"object 'cup' is not in library"):
        arrange([ObjectRequest(name="cup", object="cup")], shapes, BOARD, rng)
    names = [one.name for one in choose_objects(shapes.library, 3, rng, only=["can"], repeat=True)]
    assert names == ["can", "can_2", "can_3"]
    taken = choose_objects(shapes.library, 1, rng, only=["can"], taken=["can", "can_2"])
    assert taken[0].name == "can_3"
