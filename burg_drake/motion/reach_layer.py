"""Map of the points of a board that an arm can grasp at from above; the setup page draws it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    Arrays,
    Indices,
    InvalidInputError,
    cached,
    content_hash,
    rot_z,
    rotation_from_rpy,
)
from burg_drake.motion.arm_reach import ArmReach
from burg_drake.motion.reachability import board_cells, grasps_over_board, require_arm
from burg_drake.motion.station_check import empty_scene
from burg_drake.scene import Board
from burg_drake.station import Station, StationLike, as_station, world_content


@dataclass(frozen=True, eq=False)
class ReachLayer:
    """Points over a board at which an arm can grasp from above.

    Attributes:
        x, y: (X,), (Y,) coordinates of the points in the scene frame [m]: middles of equal cells
            that cover the board.
        height: height of the middle between the pads above the board [m].
        yaw: (K,) rotations of the hand about the vertical [rad], over half a turn: the other half
            are the same grasps with the fingers swapped.
        reached: (Y, X, K) whether the arm can execute the grasp.
        cell: extents of a cell along x and y [m].
    """

    x: Array
    y: Array
    height: float
    yaw: Array
    reached: NDArray[np.bool_] = field(repr=False)
    cell: tuple[float, float]

    @property
    def share(self) -> Array:
        """(Y, X) shares of the yaw angles that are reached."""
        return np.asarray(self.reached.mean(axis=-1))

    @property
    def covered(self) -> float:
        """Share of the board's area over which any yaw angle is reached."""
        return float(self.reached.any(axis=-1).mean())

    def share_at(self, p_SQ: ArrayLike) -> Array:
        """(N,) shares at the grid points nearest to points Q (N, 2 or more) in the scene frame [m];
        0 outside the board."""
        p = np.asarray(p_SQ, dtype=float)[:, :2]
        size = np.array(self.cell) * (len(self.x), len(self.y))
        cell = np.floor(p / self.cell).astype(int)
        i, j = np.clip(cell, 0, (len(self.x) - 1, len(self.y) - 1)).T
        on_board = ((p >= 0.0) & (p <= size)).all(axis=1)
        return np.where(on_board, self.share[j, i], 0.0)


def reach_from_above(
    station: StationLike,
    board: Board | None = None,
    *,
    height: float = 0.05,
    spacing: float = 0.02,
    yaws: int = 4,
) -> ReachLayer:
    """Maps the points over an empty board at which the arm can grasp straight from above.

    The result is kept in the user's cache.

    Args:
        station: arm, hand, obstacles, and the hand's approach, retreat and lift.
        board: the board; A2 if None.
        height: height of the grasps above the board [m].
        spacing: largest distance between neighbouring points [m].
        yaws: number of yaw angles, evenly over half a turn.

    Raises:
        InvalidInputError: the station has no arm, the arm collides at home, or a number is out of
            range.
    """
    station = as_station(station)
    if not (0.0 < spacing < np.inf and 0.0 <= height < np.inf and yaws >= 1):
        raise InvalidInputError(
            f"spacing is {spacing:g} m, height {height:g} m and yaws {yaws}; spacing must be above"
            " 0, height at least 0, and yaws at least 1"
        )
    require_arm(station)
    board = board or Board()
    (x, y), cell = board_cells(board.size, spacing)
    yaw = np.arange(yaws) * np.pi / yaws
    R_WG = rotation_from_rpy((np.pi, 0.0, 0.0)) @ np.array([rot_z(angle) for angle in yaw])
    X_WS = station.document.X_WS.matrix()
    X_WG = grasps_over_board(X_WS, x, y, np.array([height]), R_WG)
    X_WG = X_WG.reshape(len(y), len(x), yaws, 4, 4)

    def make() -> Arrays:
        reach = reach_without_objects(station)

        def check(j: NDArray[np.intp], i: NDArray[np.intp]) -> NDArray[np.bool_]:
            found = reach.check_all([""] * (len(j) * yaws), X_WG[j, i].reshape(-1, 4, 4))
            return np.array([verdict.outcome is None for verdict in found]).reshape(-1, yaws)

        return {"reached": answers_by_refinement(len(y), len(x), yaws, check)}

    key = content_hash(world_content(empty_scene(), station), vars(station.document.motion), X_WG)
    return ReachLayer(x, y, height, yaw, cached("reach-layer", key, make)["reached"], cell)


@lru_cache(maxsize=2)
def reach_without_objects(station: Station) -> ArmReach:
    """An `ArmReach` over an empty board, for grasps without an instance (`""`). It is made once per
    process and `Station`.

    Raises:
        InvalidInputError: see `ArmReach`.
    """
    require_arm(station)
    return ArmReach(empty_scene(), station)


def answers_by_refinement(
    rows: int, columns: int, yaws: int, check: Callable[[Indices, Indices], NDArray[np.bool_]]
) -> NDArray[np.bool_]:
    """(Y, X, K) results of `check` on a grid. Points whose coarse neighbours agree are not checked.

    Args:
        rows, columns: number of points along y and x.
        yaws: number of results per point.
        check: returns the results (N, K) for points by their rows (N,) and columns (N,).
    """
    coarsest_stride = 4  # Grid points between the points checked first.
    unknown = -1  # Not checked yet.
    found = np.full((rows, columns, yaws), unknown, dtype=np.int8)
    stride = coarsest_stride
    while stride:
        on_y, on_x = _coarse_nodes(rows, stride), _coarse_nodes(columns, stride)
        j, i = (index.ravel() for index in np.meshgrid(on_y, on_x, indexing="ij"))
        new = found[j, i, 0] == unknown
        j, i = j[new], i[new]
        if stride < coarsest_stride:
            below = _surrounding_nodes(j, rows, 2 * stride)
            above = _surrounding_nodes(i, columns, 2 * stride)
            corners = np.stack([found[b, a] for b in below for a in above])
            agreed = (corners == corners[0]).all(axis=(0, 2))
            found[j[agreed], i[agreed]] = corners[0][agreed]
            j, i = j[~agreed], i[~agreed]
        if len(j):
            found[j, i] = check(j, i)
        stride //= 2
    return found.astype(bool)


def _coarse_nodes(count: int, stride: int) -> Indices:
    """Every `stride`-th of `count` points, and the last."""
    return np.unique([*range(0, count, stride), count - 1])


def _surrounding_nodes(index: Indices, count: int, stride: int) -> tuple[Indices, Indices]:
    """The coarse nodes on both sides of points; twice the point itself if it is a node."""
    nodes = _coarse_nodes(count, stride)
    below = np.searchsorted(nodes, index, side="right") - 1
    return nodes[below], nodes[np.searchsorted(nodes, index)]
