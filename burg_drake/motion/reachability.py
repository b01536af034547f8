"""Map of the hand orientations that an arm reaches over a grid of points on a board."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    Arrays,
    Indices,
    InvalidInputError,
    cached,
    content_hash,
    inverse,
    rot_z,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.grasping import HandClearance
from burg_drake.motion.arm_collision import ArmCollision
from burg_drake.motion.clearance_bounds import ArmProximity
from burg_drake.motion.ik_solutions import arm_solutions
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import (
    Station,
    StationLike,
    as_station,
    build_station_diagram,
    world_content,
)


@dataclass(frozen=True, kw_only=True)
class ReachabilitySettings:
    """Grid of points and hand orientations of a reachability map.

    Attributes:
        spacing: largest distance between neighbouring points over the board [m].
        heights: of the middle between the pads above the board [m].
        tilts_deg: angles of the approach direction from straight down [degrees].
        headings: for each tilt the number of directions around the vertical; numbers that grow with
            the sine of the tilt spread the directions evenly.
        yaws: number of hand rotations about each approach direction, over half a turn. The other
            half are the same grasps with the fingers swapped; either finger assignment counts.
        redundant: number of values of the redundant joint in each round. A round skips grasps that
            an earlier one reached. Values of an earlier round, which an odd multiple of its number
            has, too, are skipped.
        limit_margin: distance to keep from the joint limits [rad].
    """

    spacing: float = 0.03
    heights: tuple[float, ...] = (0.05, 0.15)
    tilts_deg: tuple[float, ...] = (0.0, 30.0, 60.0)
    headings: tuple[int, ...] = (1, 6, 10)
    yaws: int = 4
    redundant: tuple[int, ...] = (2, 6, 18)
    limit_margin: float = 0.01

    def __post_init__(self) -> None:
        if not self.spacing > 0.0 or not self.heights or min(self.heights) < 0.0:
            raise InvalidInputError("spacing must be above 0 m, and each height at least 0 m")
        if len(self.tilts_deg) != len(self.headings) or not self.tilts_deg:
            raise InvalidInputError(
                f"there are {len(self.tilts_deg)} tilts_deg and {len(self.headings)} headings;"
                " give one number of headings for each tilt"
            )
        if not all(0.0 <= tilt <= 180.0 for tilt in self.tilts_deg):
            raise InvalidInputError(
                f"tilts_deg is {list(self.tilts_deg)}; each must be from 0 to 180"
            )
        if min(self.yaws, *self.headings, *self.redundant) < 1 or not self.redundant:
            raise InvalidInputError("yaws, headings and redundant must be whole numbers above 0")

    @property
    def orientations(self) -> tuple[Array, Array]:
        """Tilts (K,) [rad], and orientations (K, 3, 3) of the grasp frame in the world."""
        directions = [
            (tilt, heading)
            for tilt, count in zip(np.deg2rad(self.tilts_deg), self.headings, strict=True)
            for heading in np.arange(count) * 2.0 * np.pi / count
        ]
        approach = rotation_from_rpy([(np.pi, *direction) for direction in directions])
        turn = np.array([rot_z(k * np.pi / self.yaws) for k in range(self.yaws)])
        R_WG = (approach[:, None] @ turn).reshape(-1, 3, 3)
        return np.repeat([tilt for tilt, _ in directions], self.yaws), R_WG


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """Hand orientations that an arm reaches over a board.

    Attributes:
        x, y: (X,), (Y,) coordinates of the points in the scene frame [m]: middles of equal cells
            that cover the board.
        heights: (Z,) heights of the points above the board [m].
        tilt: (K,) angle of each orientation's approach direction from straight down [rad].
        R_WG: (K, 3, 3) orientations of the grasp frame in the world.
        reached: (Z, Y, X, K) whether the arm reaches an orientation.
        cell: extents of a cell along x and y [m].
    """

    x: Array
    y: Array
    heights: Array
    tilt: Array
    R_WG: Array
    reached: NDArray[np.bool_] = field(repr=False)
    cell: tuple[float, float]

    @property
    def share(self) -> Array:
        """(Z, Y, X) shares of the orientations that are reached."""
        share: Array = self.reached.mean(axis=-1)
        return share

    @property
    def share_from_above(self) -> Array:
        """(Z, Y, X) shares of the orientations that point straight down; NaN if there are none."""
        down = self.reached[..., self.tilt == 0.0]
        if not down.shape[-1]:
            return np.full(down.shape[:-1], np.nan)
        return np.asarray(down.mean(axis=-1))

    @property
    def covered(self) -> Array:
        """(Z,) shares of the board's area over which any orientation is reached."""
        return np.asarray(self.reached.any(axis=-1).mean(axis=(1, 2)))

    @property
    def covered_from_above(self) -> Array:
        """(Z,) shares of the board's area over which any orientation that points straight down is
        reached; NaN if there are none."""
        share = self.share_from_above
        return np.where(np.isnan(share[:, 0, 0]), np.nan, (share > 0.0).mean(axis=(1, 2)))

    def share_at(self, p_SQ: ArrayLike) -> Array:
        """(N,) shares at the grid points nearest to points Q (N, 3) in the scene frame [m]. Points
        outside the board count as on its edge."""
        p = np.asarray(p_SQ, dtype=float)
        i, j, k = (
            np.abs(values - p[:, axis, None]).argmin(axis=1)
            for axis, values in enumerate((self.x, self.y, self.heights))
        )
        return np.asarray(self.share[k, j, i])


def map_reachability(
    scene: SceneLike, station: StationLike, *, settings: ReachabilitySettings | None = None
) -> ReachabilityMap:
    """Maps the hand orientations that an arm reaches over the board, among the scene's objects.

    The result is kept in the user's cache.

    Args:
        scene: the board, and the objects as the document places them; see `without_free_objects`.
        station: arm, hand and surroundings.
        settings: points and orientations.

    Raises:
        InvalidInputError: the station has no arm.
    """
    scene, station = as_scene(scene), as_station(station)
    settings = settings or ReachabilitySettings()
    require_arm(station)
    (x, y), cell = board_cells(scene.board.size, settings.spacing)
    heights = np.array(settings.heights)
    tilt, R_WG = settings.orientations
    X_WG = grasps_over_board(station.document.X_WS.matrix(), x, y, heights, R_WG)

    def make() -> Arrays:
        hand = HandClearance(build_station_diagram(scene, station, robot="hand"))
        clear = np.flatnonzero(hand.is_clear(X_WG))
        reached = np.zeros(len(X_WG), dtype=bool)
        reached[clear] = _reached_grasps(scene, station, X_WG[clear], settings)
        return {"reached": reached}

    key = content_hash(world_content(scene, station), vars(settings))
    reached = cached("reachability", key, make)["reached"]
    shape = len(heights), len(y), len(x), len(tilt)
    return ReachabilityMap(x, y, heights, tilt, R_WG, reached.reshape(shape), cell)


def require_arm(station: Station) -> None:
    """Refuses a station without an arm.

    Raises:
        InvalidInputError: it has no arm.
    """
    if station.document.arm is None:
        raise InvalidInputError(
            f"station {station.name!r} ({station.path}) has no arm; add an 'arm:' section"
        )


def without_free_objects(scene: Scene) -> Scene:
    """A scene without its free objects."""
    return replace(scene, document=replace(scene.document, instances=()))


def board_cells(
    size: tuple[float, float], spacing: float
) -> tuple[tuple[Array, Array], tuple[float, float]]:
    """Middles of equal cells along x and y of a board, and the cells' extents [m]."""
    counts = [max(1, int(np.ceil(extent / spacing - 1e-9))) for extent in size]
    x, y = (
        (np.arange(count) + 0.5) * extent / count
        for extent, count in zip(size, counts, strict=True)
    )
    return (x, y), (size[0] / counts[0], size[1] / counts[1])


def grasps_over_board(X_WS: Array, x: Array, y: Array, heights: Array, R_WG: Array) -> Array:
    """(Z Y X K, 4, 4) grasps in the world, orientations last."""
    z_S, y_S, x_S = np.meshgrid(heights, y, x, indexing="ij")
    p_SG = np.stack([x_S, y_S, z_S], axis=-1).reshape(-1, 3)
    X_WG = np.broadcast_to(np.eye(4), (len(p_SG), len(R_WG), 4, 4)).copy()
    X_WG[..., :3, :3] = R_WG
    X_WG[..., :3, 3] = (p_SG @ X_WS[:3, :3].T + X_WS[:3, 3])[:, None]
    return X_WG.reshape(-1, 4, 4)


def _reached_grasps(
    scene: Scene, station: Station, X_WG: Array, settings: ReachabilitySettings
) -> NDArray[np.bool_]:
    """(N,) whether the arm has a free configuration with either finger assignment."""
    diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
    solutions = arm_solutions(
        ArmKinematics.of(diagram),
        redundant=settings.redundant,
        limit_margin=settings.limit_margin,
    )
    proximity, collision = ArmProximity(diagram), ArmCollision(diagram)
    arm = station.document.arm
    assert arm is not None
    X_AG = inverse(arm.X_WA.matrix()) @ X_WG
    X_AH = station.hand.X_AH(np.stack([X_AG, swap_fingers(X_AG)], axis=1))
    reached = np.zeros(len(X_WG), dtype=bool)
    for round_index in range(solutions.rounds):
        left = np.flatnonzero(~reached)
        pose, q = solutions.solve(X_AH[left].reshape(-1, 4, 4), round_index)
        for grasp, batch in _split_by_preference(left[pose // 2], q, np.array(arm.home)):
            new = ~reached[grasp]
            reached[grasp[new][_are_free(proximity, collision, batch[new])]] = True
    return reached


def _split_by_preference(grasp: Indices, q: Array, home: Array) -> Iterator[tuple[Indices, Array]]:
    """Yields configurations (S, n) of grasps (S,) in batches: of each grasp the one nearest to
    home, then the next two, four and so on, as the first is enough for most grasps."""
    order = np.lexsort((np.abs(q - home).max(axis=1), grasp))
    grasp, q = grasp[order], q[order]
    rank = np.arange(len(grasp)) - np.searchsorted(grasp, grasp)
    part = np.log2(rank + 1).astype(int)
    for k in range(int(part.max(initial=-1)) + 1):
        yield grasp[part == k], q[part == k]


def _are_free(proximity: ArmProximity, collision: ArmCollision, q: Array) -> NDArray[np.bool_]:
    """(S,) whether configurations (S, n) are free, for a hand that is known to be clear of the
    scene. Drake checks those that the fast bounds do not decide."""
    chunk_size = 20_000  # Configurations measured together. Bounds the memory to tens of MB.
    free = np.empty(len(q), dtype=bool)
    for k in range(0, len(q), chunk_size):
        bounds = proximity.bounds(q[k : k + chunk_size], hand=False)
        free[k : k + chunk_size] = bounds.free
        for row in k + np.flatnonzero(~bounds.free & ~bounds.blocked):
            free[row] = collision.is_free(q[row])
    return free
