"""Straight segments of a gantry, whose way is a line in space, against what stands there; Drake in
fine steps is the oracle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gantry import FINGERTIP, HALF_PAD, HOME, LOWER, UPPER, box, gantry_edges
from numpy.typing import ArrayLike

from burg_drake.core import Pose, inverse
from burg_drake.motion import EdgeChecker, EdgeCheckSettings, screen_edges
from burg_drake.scene import Instance
from burg_drake.station import load_station

AHEAD = np.array([1.0, 0.0, 0.0])
WALL = box((0.5, -0.6, 0.0), (0.502, 0.6, 0.5))
"""2 mm thick, across the whole workspace, lower than the hand can go over."""


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> EdgeChecker:
    return gantry_edges(tmp_path_factory.mktemp("gantry"), wall=WALL)


@pytest.fixture(scope="module")
def posts(tmp_path_factory: pytest.TempPathFactory) -> EdgeChecker:
    """Some boxes to miss or to hit."""
    return gantry_edges(
        tmp_path_factory.mktemp("posts"),
        near=box((0.45, -0.3, 0.0), (0.5, -0.25, 0.4)),
        beam=box((0.3, -0.6, 0.55), (0.35, 0.6, 0.6)),
        block=box((0.6, 0.1, 0.0), (0.75, 0.3, 0.25)),
    )


def drake_says(edges: EdgeChecker, q_a: np.ndarray, q_b: np.ndarray, step: float = 0.001) -> bool:
    """Free at every millimetre. Nothing but the hand moves, and it does not turn."""
    rows = max(2, int(np.linalg.norm(q_b - q_a) / step) + 2)
    return all(edges.collision.is_free(q) for q in np.linspace(q_a, q_b, rows))


def random_segments(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q_a, q_b = rng.uniform(LOWER, UPPER, (2, n, 3))
    return q_a, q_b


def test_a_thin_wall_is_not_stepped_over(walled: EdgeChecker) -> None:
    over = np.array([0.2, 0.0, 0.85])
    assert walled.is_free(HOME, over)
    assert walled.is_free(over, over + 0.6 * AHEAD)
    assert not walled.is_free(HOME, HOME + 0.6 * AHEAD)


def test_where_a_line_meets_the_wall(walled: EdgeChecker) -> None:
    """Rows 1 mm apart: Drake's own first collision, up to the stretch in which bounds find one."""
    q = np.linspace(HOME, HOME + 0.4 * AHEAD, 401)
    expected = next(k for k, row in enumerate(q) if not walled.collision.is_free(row))
    found = walled.first_blocked(q)
    assert found is not None and expected <= found <= expected + 10
    assert walled.first_blocked(q[:expected]) is None
    assert walled.first_blocked(q[expected + 20 :]) == 0
    assert walled.first_blocked(q[:1]) is None


@pytest.mark.parametrize(("gap", "free"), [(1e-3, True), (-1e-3, False)])
def test_a_millimetre_beside_a_post(tmp_path: Path, gap: float, free: bool) -> None:
    """The fingers pass over a block: bounds cannot tell, and Drake does."""
    x, y, z = HOME
    top = z - FINGERTIP - gap
    edges = gantry_edges(tmp_path, block=box((x + 0.2, y - 0.1, 0.0), (x + 0.25, y + 0.1, top)))
    assert edges.is_free(HOME, HOME + 0.4 * AHEAD) is free
    before = x + 0.2 - HALF_PAD - gap
    assert edges.is_free(HOME - [0.05, 0.0, 0.015], np.array([before, y, z - 0.015])) is free


def test_random_segments_against_fine_steps(posts: EdgeChecker) -> None:
    """No yes is wrong, and a no is wrong for none but grazing segments, of which there are none."""
    q_a, q_b = random_segments(60, seed=3)
    verdicts = [posts.is_free(a, b) for a, b in zip(q_a, q_b, strict=True)]
    assert verdicts == [drake_says(posts, a, b) for a, b in zip(q_a, q_b, strict=True)]
    assert 10 < sum(verdicts) < 50


def test_proofs_of_the_screen_hold(posts: EdgeChecker) -> None:
    """Nor does any of a batch depend on the others."""
    q_a, q_b = random_segments(60, seed=4)
    together = screen_edges(posts.proximity, q_a, q_b)
    truth = np.array([drake_says(posts, a, b, 0.002) for a, b in zip(q_a, q_b, strict=True)])
    assert not (together.proven & ~truth).any() and together.proven.sum() > 10
    assert not (together.blocked & truth).any() and together.blocked.sum() > 10
    for k in range(len(q_a)):
        alone = screen_edges(posts.proximity, q_a[k : k + 1], q_b[k : k + 1])
        assert alone.blocked[0] == together.blocked[k] and alone.proven[0] == together.proven[k]
        if not together.blocked[k]:
            np.testing.assert_array_equal(alone.open_shares(0), together.open_shares(k))
    stretch = (together.open_to - together.open_from) * together.length[together.open_edge]
    assert (stretch <= EdgeCheckSettings.fine_length * (1.0 + 1e-9)).all()


def test_how_often_drake_is_asked(walled: EdgeChecker) -> None:
    """In free space at rows no further apart than stated, whatever the corners are."""
    q = np.array([[0.2, 0.0, 0.85], [0.2, 0.3, 0.85], [0.2, 0.31, 0.85], [0.2, 0.32, 0.85]])
    for corners in (q, q[:2], q[1:], np.linspace(q[0], q[1], 100)):
        asked: list[np.ndarray] = []
        judge = EdgeChecker(walled.proximity, Recorder(walled, asked))  # type: ignore[arg-type]
        assert judge.first_blocked(corners) is None
        rows = np.array(asked)
        assert judge.checks == len(rows)
        assert np.array_equal(rows[0], corners[0]) and np.array_equal(rows[-1], corners[-1])
        gaps = np.abs(np.diff(rows, axis=0)).sum(axis=1)
        length = np.abs(np.diff(corners, axis=0)).sum()
        assert gaps.max() <= EdgeCheckSettings.row_spacing * (1.0 + 1e-9)
        assert len(rows) <= 2 * length / EdgeCheckSettings.row_spacing + 3
    quick = EdgeChecker(walled.proximity, walled.collision, exact=False)
    assert quick.first_blocked(q) is None and quick.checks == 0
    assert not quick.is_free(HOME, HOME + 0.6 * AHEAD) and quick.checks == 0


class Recorder:
    """Drake's checker that notes what it is asked."""

    def __init__(self, edges: EdgeChecker, asked: list[np.ndarray]) -> None:
        self._collision = edges.collision
        self._asked = asked

    def is_free(
        self,
        q: np.ndarray,
        *,
        carried: str | None = None,
        moved_W: ArrayLike = (0.0, 0.0, 0.0),
        width: float = np.nan,
    ) -> bool:
        self._asked.append(q)
        return self._collision.is_free(q, carried=carried, moved_W=moved_W, width=width)


def test_what_is_carried_counts_against_the_links_alone(tmp_path: Path) -> None:
    """A can reaches into the palm; it rises with the hand, or faster, into the block above it."""
    X_WS = load_station("panda_tabletop").document.X_WS.matrix()
    p_S = inverse(X_WS) @ [*(HOME - [0.0, 0.0, 0.12]), 1.0]
    edges = gantry_edges(
        tmp_path, Instance(name="can", object="can", X_SO=Pose(tuple(p_S[:3].tolist())))
    )
    rise, up = np.linspace(0.0, 0.3, 31), np.array((0.0, 0.0, 1.0))
    q = HOME + rise[:, None] * [0.0, 0.0, 1.0]
    assert edges.first_blocked(q, hand=False) == 0
    assert edges.first_blocked(q, hand=False, carried="can", moved_W=up * rise[:, None]) is None
    found = edges.first_blocked(q, hand=False, carried="can", moved_W=up * 1.5 * rise[:, None])
    free = [
        edges.collision.is_free(a, carried="can", moved_W=up * 1.5 * b)
        for a, b in zip(q, rise, strict=True)
    ]
    assert found is not None
    assert free.index(False) <= found <= free.index(False) + EdgeCheckSettings.row_spacing / 0.01


def test_several_paths_at_once(posts: EdgeChecker) -> None:
    """As one by one, in exact mode and by the fast tier alone."""
    q_a, q_b = random_segments(12, seed=6)
    paths = [np.linspace(a, b, 2 + k) for k, (a, b) in enumerate(zip(q_a, q_b, strict=True))]
    paths.append(HOME[None])
    for edges in (posts, EdgeChecker(posts.proximity, posts.collision, exact=False)):
        alone = [edges.first_blocked(path) for path in paths]
        assert edges.first_blocked_each(paths) == alone
        assert any(a is None for a in alone) and any(a is not None for a in alone)
    assert posts.first_blocked_each([]) == []


def test_bounds_that_are_known_need_not_be_found_again(posts: EdgeChecker) -> None:
    q_a, q_b = random_segments(40, 12)
    paths = [np.linspace(a, b, 12) for a, b in zip(q_a, q_b, strict=True)]
    paths.append(HOME[None])
    bounds = [posts.proximity.bounds(path) for path in paths]
    free = [k for k, found in enumerate(bounds) if (found.upper > 0.0).all()]
    assert 10 < len(free) < 41
    paths, lower = [paths[k] for k in free], [bounds[k].lower for k in free]
    found = posts.first_blocked_each(paths, lower=lower)
    assert found == posts.first_blocked_each(paths)
    assert any(row is not None for row in found)
