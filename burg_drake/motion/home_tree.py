"""Collision-free paths from the home posture to goals, which share their work.

Goals are connected to the roadmap. If that fails, a tree grows from a goal until it meets the
roadmap. Paths are then shortened.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from burg_drake.core import Array, rng_from
from burg_drake.motion.edge_checker import EdgeChecker
from burg_drake.motion.roadmap import Roadmap, chain_to_root


def shorten_path(edges: EdgeChecker, path: Array, scale: Array) -> Array:
    """Shortens a free path.

    Args:
        edges: judges segments.
        path: (M, n) its corners.
        scale: (n,) weights of the joints in the length (Euclidean norm) of a segment.

    Returns:
        (L, n) corners of a free path with the same ends, at most as long as `path`.
    """
    known: dict[bytes, bool] = {}
    if len(path) > 2 and _is_segment_free(edges, path[[0, -1]], known):
        return np.asarray(path[[0, -1]])
    for _ in range(2 if len(path) > 2 and _path_length(path, scale) > 0.0 else 0):
        other = _shortest_through(edges, _path_points(path, scale), scale, known)
        gain = _path_length(path, scale) - _path_length(other, scale)
        if gain >= 0.0:
            path = other
        if gain <= 1e-3 * _path_length(path, scale):
            break
    return _straighten_joints(edges, path, scale)


def _straighten_joints(edges: EdgeChecker, path: Array, scale: Array) -> Array:
    """Takes detours of single joints out of a free path (M, n).

    A wrist hardly moves the arm, so that a path is short although its wrist turns back and forth,
    which takes time. Each joint with a detour is moved evenly, or half as far from that, if the
    path is then still free, no longer, and quicker for joints of one speed.
    """
    min_detour = 0.3  # Radians of a joint's motion beyond the distance between its ends.
    detour = np.abs(np.diff(path, axis=0)).sum(axis=0) - np.abs(path[-1] - path[0])
    for joint in np.argsort(-detour, kind="stable")[: int((detour > min_detour).sum())]:
        steps = np.sqrt((np.diff(path * scale, axis=0) ** 2).sum(axis=1))
        share = np.append(0.0, np.cumsum(steps)) / steps.sum()
        even = path[0, joint] + share * (path[-1, joint] - path[0, joint])
        for weight in (1.0, 0.5):
            other = path.copy()
            other[1:-1, joint] += weight * (even - path[:, joint])[1:-1]
            is_better = _path_length(other, scale) <= _path_length(path, scale)
            is_better &= _joint_motion(other) < _joint_motion(path)
            if is_better and edges.first_blocked(other) is None:
                path = other
                break
    return path


def _joint_motion(path: Array) -> float:
    """Sum over the segments of a path of the motion of the joint that moves most [rad]."""
    return float(np.abs(np.diff(path, axis=0)).max(axis=1).sum())


def _path_length(path: Array, scale: Array) -> float:
    return float(np.sqrt((np.diff(path * scale, axis=0) ** 2).sum(axis=1)).sum())


def _path_points(path: Array, scale: Array) -> Array:
    """The corners and 10 points at even distances along the path."""
    steps = np.sqrt((np.diff(path * scale, axis=0) ** 2).sum(axis=1))
    at = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.unique(np.concatenate([at, np.linspace(0.0, at[-1], 10)]))
    return np.column_stack([np.interp(wanted, at, joint) for joint in path.T])


def _is_segment_free(edges: EdgeChecker, ends: Array, known: dict[bytes, bool]) -> bool:
    """Whether a segment (2, n) is free; checked exactly only if the best guess is that it is."""
    screened = edges.screen(ends[:1], ends[1:], fine=np.inf)
    free = bool(edges.seem_free(screened, guess=True)[0]) and edges.is_free(*ends)
    known[ends.tobytes()] = free
    return free


def _shortest_through(
    edges: EdgeChecker, q: Array, scale: Array, known: dict[bytes, bool]
) -> Array:
    """The shortest free path over points of a free path, from the first to the last.

    Only segments that are free by the best guess are considered, as others take hundreds of checks
    to prove. Those on a shortest path are then checked exactly.

    Args:
        edges: judges segments.
        q: (N, n) successive points on the free path.
        scale: see `shorten_path`.
        known: verdicts on segments by the bytes of their ends; new verdicts are added.
    """
    corner_cost = 1e-9  # Metres. Leaves no corner on a straight line.
    first, second = np.triu_indices(len(q), 2)
    length = np.sqrt((((q[:, None] - q) * scale) ** 2).sum(axis=-1)) + corner_cost
    allowed = np.eye(len(q), k=1, dtype=bool)
    screened = edges.screen(q[first], q[second], fine=np.inf)
    allowed[first, second] = edges.seem_free(screened, guess=True)
    free = np.eye(len(q), k=1, dtype=bool)
    for pair in zip(first.tolist(), second.tolist(), strict=True):
        verdict = known.get(q[list(pair)].tobytes())
        if verdict is not None:
            free[pair] = allowed[pair] = verdict
    while True:
        _, before = dijkstra(np.where(allowed, length, 0.0), indices=0, return_predecessors=True)
        chain = chain_to_root(before, len(q) - 1)[::-1]
        unproven = [pair for pair in pairwise(chain) if not free[pair]]
        blocked = edges.first_blocked_each([q[list(pair)] for pair in unproven])
        for pair, at in zip(unproven, blocked, strict=True):
            free[pair] = allowed[pair] = known[q[list(pair)].tobytes()] = at is None
        if all(at is None for at in blocked):
            return np.asarray(q[chain])


def search_from_goal(
    roadmap: Roadmap, edges: EdgeChecker, goal: Array, lower: Array, upper: Array
) -> Array | None:
    """Searches a path (M, n) from home to a goal (n,) with a tree that grows from the goal."""
    bounds = edges.proximity.bounds(goal[None])
    # If the goal is not even likely free, the bounds around it are too loose for a guess.
    guess = bool(bounds.likely_free[0])
    if bounds.blocked[0] or not (edges.exact or guess):
        return None
    rng = rng_from("burg_drake goal search", goal[None])
    tree = _GoalTree(goal, guess)
    for _ in range(24):  # batches of samples before the search gives up
        new = tree.grow(roadmap, edges, _draw_samples(tree.q, lower, upper, rng))
        for node, entry in _connections(roadmap, edges, tree.q, new, guess):
            corners = np.concatenate([roadmap.q[entry][None], tree.q[tree.chain(node)]])
            if edges.first_blocked(corners) is not None:
                continue
            path = roadmap.path(entry)
            if path is not None:
                return np.concatenate([path, corners[1:]])
    return None


def _draw_samples(q: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
    """Samples (32, n): half uniform, half around nodes of the tree."""
    batch_size = 32  # Samples in a batch.
    spread = 0.15  # Standard deviation of half of the samples, as a share of a joint's range.
    drawn = rng.uniform(lower, upper, (batch_size, len(lower)))
    around = q[rng.integers(len(q), size=batch_size // 2)]
    around = around + spread * (upper - lower) * rng.standard_normal(around.shape)
    drawn[::2] = np.clip(around, lower, upper)
    return drawn


def _connections(
    roadmap: Roadmap, edges: EdgeChecker, q: Array, new: NDArray[np.intp], guess: bool
) -> list[tuple[int, int]]:
    """Pairs of a new node and one of its 3 nearest roadmap nodes that the screen finds connected,
    the shortest first."""
    if not len(new):
        return []
    entry = np.concatenate([roadmap.near(q[node], 3) for node in new])
    node = np.repeat(new, len(entry) // len(new))
    screened = edges.screen(roadmap.q[entry], q[node])
    free = np.flatnonzero(edges.seem_free(screened, guess=guess))
    order = free[np.argsort(screened.length[free], kind="stable")]
    return [(int(node[k]), int(entry[k])) for k in order]


class _GoalTree:
    """Tree of configurations that is rooted at a goal.

    Attributes:
        q: (T, n) configurations, the goal first.
    """

    def __init__(self, goal: Array, guess: bool) -> None:
        self.q = goal[None]
        self._guess = guess
        self._parent = np.array([-1])

    def grow(self, roadmap: Roadmap, edges: EdgeChecker, samples: Array) -> NDArray[np.intp]:
        """Steps from the nearest nodes towards samples (S, n); returns indices of the new nodes."""
        offset = samples[:, None] - self.q
        distance = (np.abs(offset) * roadmap.scale).sum(axis=-1)
        nearest = distance.argmin(axis=1)
        rows = np.arange(len(samples))
        # A tree grows by steps of at most 0.4 m of displacement.
        share = np.minimum(1.0, 0.4 / np.maximum(distance[rows, nearest], 1e-12))
        q_a = self.q[nearest]
        q_b = q_a + share[:, None] * offset[rows, nearest]
        free = edges.seem_free(edges.screen(q_a, q_b), guess=self._guess)
        self._parent = np.concatenate([self._parent, nearest[free]])
        self.q = np.concatenate([self.q, q_b[free]])
        return np.arange(len(self.q) - int(free.sum()), len(self.q))

    def chain(self, node: int) -> list[int]:
        """The nodes from `node` to the goal."""
        return chain_to_root(self._parent, node)


class HomeTree:
    """Finds paths from home to goals.

    Attributes:
        edges: judges segments.
        roadmap: configurations around home.
    """

    def __init__(
        self,
        edges: EdgeChecker,
        home: Array,
        lower: Array,
        upper: Array,
        *,
        focus: Array | None = None,
        nodes: int = 600,
    ) -> None:
        """Builds the roadmap; for the arguments see `Roadmap`."""
        self.edges = edges
        self.roadmap = Roadmap(edges, home, lower, upper, focus=focus, nodes=nodes)
        self._lower, self._upper = lower, upper

    def connect(self, goals: Array) -> list[Array | None]:
        """Free paths to goals, with few batches of the fast tier. The results do not depend on
        each other.

        Args:
            goals: (K, n) postures.

        Returns:
            (M, n) corners of each path, home first. It ends with a segment from home or from a near
            node of the roadmap, or else was found by a search from the goal; None if both fail.
        """
        goals = np.asarray(goals, dtype=float)
        paths = self._connect_by_segments(goals)
        for index in (k for k, path in enumerate(paths) if path is None):
            paths[index] = search_from_goal(
                self.roadmap, self.edges, goals[index], self._lower, self._upper
            )
        return paths

    def _connect_by_segments(self, goals: Array) -> list[Array | None]:
        """Paths that end with a segment from home or from a near node, for each goal (K, n)."""
        first_count = 2  # Nearest nodes that a goal is tried with at first.
        further_count = 8  # Further nodes that are tried, beside home.
        near = [self.roadmap.near(goal, first_count + further_count) for goal in goals]
        paths = self._connect_over(goals, [nodes[:first_count] for nodes in near])
        left = [k for k, path in enumerate(paths) if path is None]
        rest = [np.append(nodes[first_count:][nodes[first_count:] != 0], 0) for nodes in near]
        for k, path in zip(
            left, self._connect_over(goals[left], [rest[k] for k in left]), strict=True
        ):
            paths[k] = path
        return paths

    def _connect_over(self, goals: Array, nodes: list[NDArray[np.intp]]) -> list[Array | None]:
        """Paths over given nodes, for each goal: proven segments first, then the shortest."""
        if not len(goals):
            return []
        counts = [len(own) for own in nodes]
        q_a = self.roadmap.q[np.concatenate(nodes)]
        q_b = np.repeat(goals, counts, axis=0)
        screened = self.edges.screen(q_a, q_b)
        order = np.lexsort((screened.length, ~screened.proven))
        owner = np.repeat(np.arange(len(goals)), counts)[order]
        node = np.concatenate(nodes)
        goals_first = np.unique(owner, return_index=True)[1]
        self.roadmap.check_ahead(node[order[goals_first]])
        paths: list[Array | None] = []
        for k, goal in enumerate(goals):
            confirmed = (
                self.roadmap.path(int(node[edge]))
                for edge in order[owner == k]
                if self.edges.confirm(q_a, q_b, screened, edge)
            )
            path = next((path for path in confirmed if path is not None), None)
            paths.append(None if path is None else np.concatenate([path, goal[None]]))
        return paths

    def shortcut(self, path: Array) -> Array:
        """A free path with the same ends that is no longer; see `shorten_path`."""
        return shorten_path(self.edges, path, self.roadmap.scale)
