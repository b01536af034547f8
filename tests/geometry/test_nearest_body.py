"""The nearest body to the open hand, against all pairs of part and piece."""

from __future__ import annotations

import numpy as np
import pytest
from random_shapes import KINDS, random_pose, random_shape

from burg_drake.core import make_pose
from burg_drake.geometry import (
    DISTANCE_TOLERANCE,
    Body,
    HandScreen,
    Poses,
    Shape,
    ShapeBatch,
    hand_screen,
    shape_distances,
)


class World:
    """A random hand and random bodies, of shapes of all kinds, and grasps that are clear."""

    def __init__(self, seed: int, X_VW: np.ndarray | None = None) -> None:
        X_VW = np.eye(4) if X_VW is None else X_VW
        rng = np.random.default_rng(seed)
        self.hand = [random_shape(kind, rng)[0] for kind in KINDS]
        self.pieces = {
            f"body{k}": [random_shape(kind, rng)[0] for kind in KINDS[: k + 1]] for k in range(4)
        }
        self.X_WB = {name: random_pose(rng, 0.25) for name in self.pieces}
        self.screen = HandScreen(
            self.hand,
            {name: Body(X_VW @ X, self.pieces[name]) for name, X in self.X_WB.items()},
        )
        X_VG = X_VW @ np.array([random_pose(rng, 0.3) for _ in range(300)])
        clear = self.screen.deepest(X_VG, list(self.pieces))[0] == ""
        assert 60 < clear.sum() < 300
        self.X_WG = X_VG[clear]

    def of_all_pairs(self) -> tuple[list[str], np.ndarray]:
        """Name and distance of the nearest body at each grasp."""
        gaps = np.full((len(self.pieces), len(self.X_WG)), np.inf)
        parts = ShapeBatch.of(self.hand)
        for k, (name, pieces) in enumerate(self.pieces.items()):
            X_BG = Poses.of(np.array([np.linalg.inv(self.X_WB[name]) @ X for X in self.X_WG]))
            for part in range(len(self.hand)):
                for piece in range(len(pieces)):
                    every = np.zeros(len(self.X_WG), dtype=np.intp)
                    found = shape_distances(
                        parts, every + part, ShapeBatch.of(pieces), every + piece, X_BG
                    )
                    gaps[k] = np.minimum(gaps[k], found)
        return [list(self.pieces)[k] for k in gaps.argmin(axis=0)], gaps.min(axis=0)


@pytest.mark.parametrize("seed", range(3))
def test_is_the_least_of_all_pairs(seed: int) -> None:
    world = World(seed)
    names, gaps = world.screen.nearest(world.X_WG)
    expected, least = world.of_all_pairs()
    np.testing.assert_allclose(gaps, least, atol=2 * DISTANCE_TOLERANCE)
    assert names.tolist() == expected
    assert len(set(expected)) == 4 and gaps.min() < 0.01 < 0.1 < gaps.max()


def test_results_do_not_depend_on_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit: alone, in another order, and however the batch is cut."""
    world = World(1)
    names, gaps = world.screen.nearest(world.X_WG)
    for k in range(40):
        name, gap = world.screen.nearest(world.X_WG[k : k + 1])
        assert (name[0], gap[0]) == (names[k], gaps[k])
    mixed = np.random.default_rng(3).permutation(len(gaps))
    turned = world.screen.nearest(world.X_WG[mixed])
    assert turned[0].tolist() == names[mixed].tolist()
    assert turned[1].tobytes() == gaps[mixed].tobytes()
    monkeypatch.setattr(hand_screen, "GRASP_CHUNK", 7)
    cut = World(1).screen.nearest(world.X_WG)
    assert (cut[0].tolist(), cut[1].tobytes()) == (names.tolist(), gaps.tobytes())


def test_the_scene_may_be_moved_with_the_hand() -> None:
    here, there = World(2), World(2, random_pose(np.random.default_rng(9), 2.0))
    (names, gaps), (names_moved, gaps_moved) = (w.screen.nearest(w.X_WG) for w in (here, there))
    assert names.tolist() == names_moved.tolist()
    np.testing.assert_allclose(gaps_moved, gaps, atol=2 * DISTANCE_TOLERANCE)


def test_far_bodies_count_and_a_scene_may_be_empty() -> None:
    hand = [Shape.box(np.eye(4), np.full(3, 0.01))]
    far = Body(make_pose(p_AB=(5.0, 0.0, 0.0)), [Shape.ball(np.eye(4), 0.02)])
    farther = Body(make_pose(p_AB=(0.0, 7.0, 0.0)), [Shape.ball(np.eye(4), 0.02)])
    names, gaps = HandScreen(hand, {"farther": farther, "far": far}).nearest(np.eye(4)[None])
    assert names.tolist() == ["far"]
    assert gaps[0] == pytest.approx(5.0 - 0.03)
    names, gaps = HandScreen(hand, {}).nearest(np.eye(4)[None])
    assert (names.tolist(), gaps.tolist()) == ([""], [np.inf])
    assert HandScreen(hand, {"far": far}).nearest(np.empty((0, 4, 4)))[1].shape == (0,)
