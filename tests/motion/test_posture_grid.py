"""The cheapest chain of postures, against a search through all of them in plain Python."""

import heapq

import numpy as np
import pytest

from burg_drake.core import grasp_from_axes
from burg_drake.motion import DEEP_PENETRATION, GridChain, PandaIk, PostureGrid

LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
IK = PandaIk(np.eye(4), LOWER, UPPER)
TRAVEL, DOUBT = 0.6, 0.5
OFFSETS, CROSSING = (-3, -1, 0, 1, 3), (-1, 0, 1)


def line(x: float, tilt: float) -> np.ndarray:
    """(5, 2, 4, 4) poses of the flange going up, with either turn about the approach."""
    poses = []
    for height in np.linspace(0.3, 0.5, 5):
        X = grasp_from_axes((0.0, 1.0, 0.0), (tilt, 0.1, -1.0), (x, 0.1, height))
        poses.append([X, X @ np.diag([-1.0, -1.0, 1.0, 1.0])])
    return np.array(poses)


@pytest.fixture
def grid() -> PostureGrid:
    X_AH = np.stack([line(0.45, 0.2), line(0.6, -0.4), line(1.2, 0.0)], axis=1)
    values = np.linspace(-2.8, 2.8, 14)
    grid = PostureGrid(IK, X_AH, values, travel=TRAVEL, offsets=OFFSETS, crossing=CROSSING)
    grid.solve(np.arange(5), np.arange(3))
    grid.join()
    return grid


def cheapest(grid: PostureGrid, i: int, last: int) -> float:
    """Dijkstra's algorithm over all postures of a grasp."""
    usable, doubt = grid.usable(slice(None), i), doubts(grid)[:, i]
    start = grid.start[i]
    count = len(grid.parameter)
    queue = [(float(start[s] + doubt[0][s]), 0, s) for s in map(tuple, np.argwhere(usable[0]))]
    heapq.heapify(queue)
    done = set()
    while queue:
        cost, pose, (way, branch, k) = heapq.heappop(queue)
        if pose == last:
            return cost
        if (pose, way, branch, k) in done:
            continue
        done.add((pose, way, branch, k))
        for offset in OFFSETS:
            j, crossed = k + offset, (branch ^ 2, branch ^ 1) if offset in CROSSING else ()
            for other in (branch, *crossed) if 0 <= j < count else ():
                if not usable[pose + 1, way, other, j]:
                    continue
                q, after = grid.q[:, pose, i, way, branch, k], grid.q[:, pose + 1, i, way, other, j]
                travel = float(np.abs(after - q).max())
                if travel <= TRAVEL:
                    more = travel + float(doubt[pose + 1, way, other, j])
                    heapq.heappush(queue, (cost + more, pose + 1, (way, other, j)))
    return np.inf


def doubts(grid: PostureGrid) -> np.ndarray:
    """Cost of little clearance: all of it at 0, half at half a centimetre, none from 1 cm on."""
    return DOUBT * np.interp(grid.lower, (0.0, 0.01), (1.0, 0.0))


def cost_of(grid: PostureGrid, i: int, place: GridChain) -> float:
    places = [
        (p, i, place.flip, place.branch[p], place.parameter[p]) for p in range(len(place.branch))
    ]
    q = np.array([grid.q[(slice(None), *at)] for at in places])
    doubt = sum(float(doubts(grid)[at]) for at in places)
    begin = float(grid.start[places[0][1:]])
    return begin + float(np.abs(np.diff(q, axis=0)).max(axis=1).sum()) + doubt


def start_at_random(grid: PostureGrid, rng: np.random.Generator) -> None:
    grid.start[:] = rng.uniform(0.0, 1.0, grid.start.shape)


def measured(grid: PostureGrid, rng: np.random.Generator, blocked: float) -> None:
    grid.lower[:] = rng.uniform(-0.01, 0.05, grid.lower.shape)
    grid.upper[:] = grid.lower + 0.02
    grid.upper[rng.uniform(size=grid.upper.shape) < blocked] = -0.01


@pytest.mark.parametrize("seed", range(4))
def test_the_chain_is_the_cheapest(grid: PostureGrid, seed: int) -> None:
    rng = np.random.default_rng(seed)
    measured(grid, rng, 0.15)
    start_at_random(grid, rng)
    found = grid.best(np.arange(3), DOUBT)
    assert found[0] is not None and found[1] is not None
    for i, place in enumerate(found):
        expected = cheapest(grid, i, 4)
        if place is None:
            assert expected == np.inf
        else:
            assert cost_of(grid, i, place) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("blocked", [0.3, 0.6, 0.9, 1.0])
def test_how_far_chains_lead(grid: PostureGrid, blocked: float) -> None:
    measured(grid, np.random.default_rng(5), blocked)
    for i in range(3):
        led = [last for last in range(5) if np.isfinite(cheapest(grid, i, last))]
        assert grid.reached(i) == max(led, default=-1)


def test_joined_are_all_postures_of_chains(grid: PostureGrid) -> None:
    """From a joined posture the way from the first pose and that to the last are found if all other
    postures of its pose are refused; from others there is none."""
    rng = np.random.default_rng(6)
    for at in rng.permutation(np.argwhere(grid.exists))[:60]:
        pose, i, way, branch, k = at.tolist()
        grid.refused[pose, i] = True
        grid.refused[pose, i, way, branch, k] = False
        assert np.isfinite(cheapest(grid, i, 4)) == grid.joined[pose, i, way, branch, k]
        grid.refused[pose, i] = False


def test_postures_between_deep_ones_are_taken_for_blocked(grid: PostureGrid) -> None:
    fine = PostureGrid(
        IK,
        grid._X_AH,
        np.linspace(-2.8, 2.8, 40),
        travel=TRAVEL,
        offsets=OFFSETS,
        crossing=CROSSING,
    )
    fine.solve(np.arange(5), np.arange(3))
    grid.upper[:] = np.random.default_rng(7).uniform(
        -3.0 * DEEP_PENETRATION, DEEP_PENETRATION, grid.upper.shape
    )
    fine.copy_deep_collisions(1, grid, 1, [0, 3])
    taken = np.isfinite(fine.upper)
    np.testing.assert_array_equal(taken, np.isfinite(fine.lower))
    assert taken[[0, 3], 1].any() and not taken[[1, 2, 4]].any() and not taken[:, [0, 2]].any()
    for pose in (0, 3):
        for way, branch, k in np.argwhere(fine.exists[pose, 1]).tolist():
            value, known = fine.parameter[k], grid.upper[pose, 1, way, branch]
            below, above = known[grid.parameter <= value][-1], known[grid.parameter >= value][0]
            assert taken[pose, 1, way, branch, k] == (max(below, above) < -DEEP_PENETRATION)


def test_out_of_reach_there_is_none(grid: PostureGrid) -> None:
    assert grid.best(np.array([2]), DOUBT) == [None]


def test_refused_postures_and_cut_steps_are_avoided(grid: PostureGrid) -> None:
    start_at_random(grid, np.random.default_rng(1))
    seen = []
    while True:
        (place,) = grid.best(np.array([0]), DOUBT)
        if place is None or len(seen) == 8:
            break
        step = (place.flip, *place.branch[1:3].tolist(), *place.parameter[1:3].tolist())
        assert step not in seen
        seen.append(step)
        grid.cut(0, 1, place)
    assert len(seen) == 8
    (place,) = grid.best(np.array([0]), DOUBT)
    assert place is not None
    grid.refused[3, 0, place.flip, place.branch[3], place.parameter[3]] = True
    (other,) = grid.best(np.array([0]), DOUBT)
    assert other is None or (other.flip, other.branch[3], other.parameter[3]) != (
        place.flip,
        place.branch[3],
        place.parameter[3],
    )
    expected = np.inf if other is None else cost_of(grid, 0, other)
    assert expected >= cost_of(grid, 0, place) - 1e-6


def test_a_chain_does_not_depend_on_the_batch(grid: PostureGrid) -> None:
    start_at_random(grid, np.random.default_rng(2))
    together = grid.best(np.array([0, 1, 2]), DOUBT)
    for i in range(3):
        (alone,) = grid.best(np.array([i]), DOUBT)
        if alone is None:
            assert together[i] is None
            continue
        place = together[i]
        assert place is not None and place.flip == alone.flip
        np.testing.assert_array_equal(place.branch, alone.branch)
        np.testing.assert_array_equal(place.parameter, alone.parameter)
