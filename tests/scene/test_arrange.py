"""Layouts of the built-in objects, judged by linear programs over their convex pieces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from burg_drake.core.frames import Array, transform_points
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.arrange import arrange, choose
from burg_drake.scene.arrangement import Arrangement
from burg_drake.scene.layout import LAYOUTS, Layout
from burg_drake.scene.object_shapes import ObjectShapes
from burg_drake.scene.scene import Board

BOARD = Board(size=(0.594, 0.42))


@pytest.fixture(scope="module")
def shapes() -> ObjectShapes:
    return ObjectShapes(load_library("household"))


def laid_out(shapes: ObjectShapes, layout: Layout, seed: int, count: int = 6) -> Arrangement:
    rng = np.random.default_rng(seed)
    only = ("banana", "bottle", "box", "can", "mug", "screwdriver", "scissors")
    wanted = choose(shapes.library, count, rng, only=only)
    return arrange(wanted, shapes, BOARD, rng, layout=layout)


def placed_pieces(library: ObjectLibrary, arrangement: Arrangement) -> dict[str, list[Array]]:
    """Corners (N, 3) of the pieces of each instance in S."""
    return {
        one.name or one.object: [
            transform_points(one.X_SO.matrix(), np.asarray(library.mesh(piece).vertices))
            for piece in library.entry(one.object).pieces
        ]
        for one in arrangement.instances
    }


def overlap(one: Array, other: Array) -> bool:
    """Whether a point is a convex combination of both sets of points."""
    if (one.min(axis=0) > other.max(axis=0)).any() or (one.max(axis=0) < other.min(axis=0)).any():
        return False
    sums = np.zeros((5, len(one) + len(other)))
    sums[:3] = np.hstack([one.T, -other.T])
    sums[3, : len(one)] = sums[4, len(one) :] = 1.0
    right = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
    return bool(linprog(np.zeros(sums.shape[1]), A_eq=sums, b_eq=right).status == 0)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_nothing_overlaps_or_is_beyond_the_edge(shapes: ObjectShapes, layout: Layout) -> None:
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
