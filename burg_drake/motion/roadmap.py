"""A graph of arm configurations around the home posture, and shortest paths in it from home."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from burg_drake.core import Array, Arrays, cached, content_hash, rng_from
from burg_drake.motion.arm_links import ArmLinks
from burg_drake.motion.edge_checker import EdgeChecker
from burg_drake.station import StationDiagram


class ObjectViewLimits:
    """Limits within which the hand of a posture points at an object."""

    min_distance = 0.03  # Metres from the grasp frame to the origin of an object.
    max_distance = 0.30  # Metres from the grasp frame to the origin of an object.
    min_cosine = 0.6  # Cosine of the angle between approach and direction to the object.


def random_postures(
    home: Array, lower: Array, upper: Array, count: int, rng: np.random.Generator
) -> Array:
    """(count, n) random postures within joint limits, alternately around home and uniform."""
    spread = 0.25  # Standard deviation around home, as a share of a joint's range.
    q = rng.uniform(lower, upper, (count, len(home)))
    around = home + spread * (upper - lower) * rng.standard_normal(q[::2].shape)
    q[::2] = np.clip(around, lower, upper)
    return q


def postures_over_objects(
    station_diagram: StationDiagram, links: ArmLinks, home: Array, lower: Array, upper: Array
) -> Array:
    """Random postures whose hand is near an object and points at it.

    Args:
        station_diagram: the scene's free objects and the hand.
        links: the arm's kinematics in the world.
        home: (n,) posture around which half of the postures are drawn.
        lower, upper: (n,) joint limits [rad or m].

    Returns:
        (F, n) postures, which may collide; none if the scene has no free object.
    """
    station, plant = station_diagram.station, station_diagram.plant
    hand = plant.GetBodyByName(station.hand.body, plant.GetModelInstanceByName("hand")).index()
    X_FG = links.X_FB[hand] @ station.hand.X_HG.matrix()
    objects = [station_diagram.X_WO(name)[:3, 3] for name in station_diagram.scene.instances]
    frame = links.frame_of[hand]

    def make() -> Arrays:
        q = random_postures(
            home, lower, upper, 40_000, rng_from("burg_drake postures over objects")
        )
        return {"q": q[_points_at_object(links, frame, X_FG, objects, q)]}

    inputs = (links.X_before, list(links.turns), frame, X_FG, objects, home, lower, upper)
    return np.asarray(cached("postures", content_hash(*inputs), make)["q"])


def _points_at_object(
    links: ArmLinks, frame: int, X_FG: Array, objects: list[Array], q: Array
) -> NDArray[np.bool_]:
    """(N,) whether the hand points at one of the objects in postures (N, n)."""
    block_size = 4096  # Postures whose links are placed at once.
    points_at = np.zeros(len(q), dtype=bool)
    for start in range(0, len(q), block_size):
        block = slice(start, start + block_size)
        poses = links.poses(q[block])
        points = np.stack([X_FG[:3, 3], X_FG[:3, 3] + X_FG[:3, 2]]).astype(np.float32)
        p_WG, ahead = poses.transform_points(frame, points).swapaxes(0, 1)
        approach = ahead - p_WG
        for p_WO in objects:
            offset = p_WO.astype(np.float32)[:, None] - p_WG
            distance = np.sqrt((offset * offset).sum(axis=0))
            along = (offset * approach).sum(axis=0)
            near = (distance > ObjectViewLimits.min_distance) & (
                distance < ObjectViewLimits.max_distance
            )
            points_at[block] |= near & (along > ObjectViewLimits.min_cosine * distance)
    return points_at


class Roadmap:
    """Configurations around home, and segments between them that have not been refuted.

    Attributes:
        q: (N, n) configurations, home first.
        scale: (n,) mean displacement per unit of each joint [m/rad or 1].
    """

    def __init__(
        self,
        edges: EdgeChecker,
        home: Array,
        lower: Array,
        upper: Array,
        *,
        focus: Array | None,
        nodes: int,
    ) -> None:
        """Builds the graph, or reads it from the user's cache.

        Args:
            edges: judges segments.
            home: (n,) the posture at which all paths begin.
            lower, upper: (n,) joint limits [rad or m].
            focus: (F, n) postures like the expected goals, for two thirds of the nodes.
            nodes: number of configurations before those not connected to home are dropped.
        """
        self._edges = edges
        near = np.empty((0, len(home))) if focus is None else focus
        inputs = (edges.content, home, lower, upper, near, nodes)
        arrays = cached(
            "roadmap",
            content_hash(*inputs),
            lambda: _build_roadmap(edges, home, lower, upper, near, nodes),
        )
        self.q, self.scale = arrays["q"], arrays["scale"]
        self._ends, self._length = arrays["ends"], arrays["length"]
        self._free: set[tuple[int, int]] = set()
        self._blocked: set[tuple[int, int]] = set()
        self._search()

    def _search(self) -> None:
        self.distance, self._parent = _shortest_paths(self._ends, self._length, len(self.q))

    def near(self, q: Array, count: int) -> NDArray[np.intp]:
        """The nodes with the least displacement to `q` (n,), nearest first."""
        distance = (np.abs(self.q - q) * self.scale).sum(axis=1)
        return np.argsort(distance, kind="stable")[:count]

    def check_ahead(self, nodes: NDArray[np.intp]) -> None:
        """Judges the edges that `path` will check first for these nodes, in one batch of the fast
        tier; the verdicts do not change."""
        reached = nodes[np.isfinite(self.distance[nodes])]
        paths = (pairwise(self._chain(node)) for node in dict.fromkeys(reached.tolist()))
        needed = {(min(edge), max(edge)) for path in paths for edge in path}
        new = np.array(sorted(needed - self._free - self._blocked), dtype=np.intp).reshape(-1, 2)
        q_a, q_b = self.q[new[:, 0]], self.q[new[:, 1]]
        screened = self._edges.screen(q_a, q_b)
        for k, (first, second) in enumerate(new.tolist()):
            free = self._edges.confirm(q_a, q_b, screened, k)
            (self._free if free else self._blocked).add((first, second))

    def path(self, node: int) -> Array | None:
        """The shortest free path to a node: (M, n) corners from home, or None."""
        while np.isfinite(self.distance[node]):
            chain = self._chain(node)
            refuted = next((e for e in pairwise(chain) if not self._is_free(e)), None)
            if refuted is None:
                return np.asarray(self.q[chain])
            keep = (self._ends != sorted(refuted)).any(axis=1)
            self._ends, self._length = self._ends[keep], self._length[keep]
            self._search()
        return None

    def _chain(self, node: int) -> list[int]:
        """The nodes from home to `node` on the shortest path that is not refuted."""
        return chain_to_root(self._parent, node)[::-1]

    def _is_free(self, edge: tuple[int, int]) -> bool:
        first, second = sorted(edge)  # so that the verdict does not depend on the direction
        if (first, second) not in self._free and (first, second) not in self._blocked:
            free = self._edges.is_free(self.q[first], self.q[second])
            (self._free if free else self._blocked).add((first, second))
        return (first, second) in self._free


def chain_to_root(parent: NDArray[np.integer], node: int) -> list[int]:
    """The nodes from `node` to the root of its tree, by each node's parent (negative: root)."""
    chain = [node]
    while parent[chain[-1]] >= 0:
        chain.append(int(parent[chain[-1]]))
    return chain


def _build_roadmap(
    edges: EdgeChecker,
    home: Array,
    lower: Array,
    upper: Array,
    focus: Array,
    nodes: int,
) -> Arrays:
    """Nodes and edges of a roadmap; for the arguments see `Roadmap`."""
    node_clearance = 0.01  # Metres. Lower bound of the clearance of all nodes but home.
    clearance_margin = 1e-3  # Metres below the clearance at home, where that is small.
    rng = rng_from("burg_drake home tree", "", nodes)
    scale = _joint_levers(edges, rng.uniform(lower, upper, (64, len(home))))
    at_home = float(edges.proximity.bounds(home[None]).lower[0])
    clearance = min(node_clearance, at_home - clearance_margin)
    wide = random_postures(home, lower, upper, 2 * nodes, rng)
    near = _keep_clear(edges, focus, 2 * nodes // 3, clearance)
    q = np.concatenate([home[None], near, _keep_clear(edges, wide, nodes - len(near), clearance)])
    ends, length = _connect_neighbours(edges, q, scale)
    reached = np.isfinite(_shortest_paths(ends, length, len(q))[0])
    number = np.cumsum(reached) - 1
    keep = reached[ends[:, 0]]
    kept_ends = {"ends": number[ends[keep]], "length": length[keep]}
    return {"q": q[reached], "scale": scale, **kept_ends}


def _keep_clear(edges: EdgeChecker, q: Array, count: int, clearance: float) -> Array:
    """Up to `count` configurations with at least this clearance, of the first 3 `count`."""
    q = q[: 3 * count]
    return q[edges.proximity.bounds(q).lower > clearance][:count]


def _connect_neighbours(
    edges: EdgeChecker, q: Array, scale: Array
) -> tuple[NDArray[np.intp], Array]:
    """(E, 2) pairs of near nodes with a segment that seems free, and the displacements [m]."""
    scaled = q * scale
    ranks = np.arange(1, min(7, len(q)) + 1)  # itself and the 6 nearest
    _, near = cKDTree(scaled).query(scaled, k=ranks, p=1.0)
    pairs = np.stack([np.repeat(np.arange(len(q)), near.shape[1]), near.ravel()], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    screened = edges.screen(q[pairs[:, 0]], q[pairs[:, 1]], fine=np.inf)
    seems = edges.seem_free(screened)
    return pairs[seems], screened.length[seems]


def _joint_levers(edges: EdgeChecker, q: Array) -> Array:
    """(n,) displacement per unit of each joint, averaged over postures (P, n)."""
    joint_step = 1e-3  # Radians or metres.
    q_a = np.repeat(q, q.shape[1], axis=0)
    q_b = q_a + joint_step * np.tile(np.eye(q.shape[1]), (len(q), 1))
    moved = edges.proximity.displacement(q_a, q_b).reshape(len(q), -1)
    return np.asarray(moved.mean(axis=0) / joint_step)


def _shortest_paths(
    ends: NDArray[np.intp], length: Array, nodes: int
) -> tuple[Array, NDArray[np.int32]]:
    """(N,) distances from node 0, infinite for unreachable nodes, and the nodes before."""
    graph = csr_matrix((length, (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
    distance, parent = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
    return distance, parent
