"""Decides whether the arm can execute a grasp, all the way from home to the top of the lift.

The motion leads from home to the pregrasp, straight to the grasp, and straight back and up.
Where there is no room for the whole lift, lower ones are tried.

A positive verdict carries the whole motion, checked by Drake's collision checker. A negative one
names what failed first and what was in the way. Both finger assignments are tried. A verdict
depends on the grasp alone: not on other grasps, their order, or a random stream.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    Booleans,
    Indices,
    InvalidInputError,
    Outcome,
    check_pose,
    inverse,
    swap_fingers,
)
from burg_drake.geometry import CONTACT_TOLERANCE
from burg_drake.motion.arm_collision import ArmCollision
from burg_drake.motion.clearance_bounds import ArmProximity
from burg_drake.motion.closed_form_lines import ClosedFormLineSearch
from burg_drake.motion.edge_checker import EdgeChecker
from burg_drake.motion.hand_sweep import HandSweep, SweepResult
from burg_drake.motion.home_posture import require_free_home
from burg_drake.motion.home_tree import HomeTree
from burg_drake.motion.ik_solutions import IkRoutine, RoutineSolutions
from burg_drake.motion.line_poses import HandPath
from burg_drake.motion.line_search import LineSearch, SuccessiveLineSearch
from burg_drake.motion.motion_search import GraspBatch, MotionSearch
from burg_drake.motion.motion_settings import ReachSettings
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.numeric_lines import NumericLineSearch
from burg_drake.motion.panda_ik import PandaIk
from burg_drake.motion.posture_grid import PREFERRED_CLEARANCE
from burg_drake.motion.reach_verdict import Reach
from burg_drake.motion.roadmap import postures_over_objects
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import StationLike, as_station, build_station_diagram


@dataclass(frozen=True, eq=False)
class HandVerdicts:
    """Clearance of the hand alone on N motions, for both finger assignments.

    Attributes:
        blocked_by: (N, 2) verdict that names the first obstacle; None where the hand is free.
        clearance: (N, 2) clearance of the hand on its path, negative where it is not free [m].
        room: (N, 2) see `SweepResult` [m].
    """

    blocked_by: NDArray[np.object_]
    clearance: Array
    room: Array

    def __getitem__(self, chosen: Indices) -> HandVerdicts:
        clearance, room = self.clearance[chosen].copy(), self.room[chosen].copy()
        return HandVerdicts(self.blocked_by[chosen].copy(), clearance, room)

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """(N,) whether the hand collides with both finger assignments."""
        return np.asarray((self.clearance < 0.0).all(axis=1))

    def refusal(self, grasp: int) -> Reach:
        """Verdict on a blocked grasp: that of the first finger assignment that has one."""
        verdict = next(reach for reach in self.blocked_by[grasp] if reach is not None)
        assert isinstance(verdict, Reach)
        return verdict

    def record(self, flip: int, rows: Indices, sweep: SweepResult, outcome: Outcome) -> None:
        """Enters the result of the sweep of grasps `rows` (S,) with one finger assignment."""
        blocked = np.minimum(sweep.clearance, -CONTACT_TOLERANCE)
        room = np.where(sweep.free, np.maximum(sweep.clearance, 0.0), blocked)
        self.clearance[rows, flip] = np.minimum(self.clearance[rows, flip], room)
        self.room[rows, flip] = np.minimum(self.room[rows, flip], sweep.room)
        for k in np.flatnonzero(~sweep.free):
            self.blocked_by[rows[k], flip] = Reach(
                outcome, str(sweep.blocker[k]), float(sweep.clearance[k])
            )


@dataclass(frozen=True, eq=False)
class HandPaths:
    """Paths of the hand for N grasps.

    Attributes:
        sweep: the hand in its scene.
        instance: (N,) names of the targets; "" without one.
        X_both: (N, 2, 4, 4) grasps in the world with both finger assignments.
        width: (N,) distances between the pads that hold the target [m].
        retreats: whether the hand goes back before it is lifted.
    """

    sweep: HandSweep
    instance: NDArray[np.object_]
    X_both: Array
    width: Array
    retreats: bool

    def __getitem__(self, chosen: Indices) -> HandPaths:
        own = self.instance[chosen], self.X_both[chosen], self.width[chosen]
        return HandPaths(self.sweep, *own, self.retreats)

    def check_before_lift(self) -> HandVerdicts:
        """Checks approach and retreat."""
        shape = self.X_both.shape[:2]
        nothing = np.full(shape, None, dtype=object)
        found = HandVerdicts(nothing, np.full(shape, np.inf), np.full(shape, np.inf))
        for name, flip, rows in self._list_checks(found):
            sweep = self.sweep.approach(name, self.X_both[rows, flip])
            found.record(flip, rows, sweep, Outcome.HAND_COLLISION_APPROACH)
        for name, flip, rows in self._list_checks(found) if self.retreats else ():
            sweep = self.sweep.retreat(name, self.X_both[rows, flip], self.width[rows])
            found.record(flip, rows, sweep, Outcome.HAND_COLLISION_RETREAT)
        return self._copy_if_symmetric(found)

    def check_lift(self, before: HandVerdicts, height: float) -> HandVerdicts:
        """Checks the lift to a height [m], too."""
        found = before[np.arange(len(before.blocked_by))]
        for name, flip, rows in self._list_checks(found):
            sweep = self.sweep.lift(name, self.X_both[rows, flip], self.width[rows], height)
            found.record(flip, rows, sweep, Outcome.HAND_COLLISION_LIFT)
        return self._copy_if_symmetric(found)

    def _list_checks(self, found: HandVerdicts) -> list[tuple[str, int, Indices]]:
        """Targets, finger assignments, and indices of the grasps that are free so far."""
        flips = (0,) if self.sweep.symmetric else (0, 1)
        free = found.clearance >= 0.0
        return [
            (name, flip, np.flatnonzero((self.instance == name) & free[:, flip]))
            for name in dict.fromkeys(self.instance.tolist())
            for flip in flips
        ]

    def _copy_if_symmetric(self, found: HandVerdicts) -> HandVerdicts:
        if self.sweep.symmetric:
            found.clearance[:, 1] = found.clearance[:, 0]
            found.room[:, 1] = found.room[:, 0]
            found.blocked_by[:, 1] = found.blocked_by[:, 0]
        return found


ReachAtHeight = Callable[[float, Indices], Sequence[Reach]]
"""Verdicts on grasps (S,) with a lift to a height [m]."""
HandIsFree = Callable[[float, Indices], Booleans]
"""Whether the hand alone is free for grasps (S,) with a lift to a height [m]."""
LevelIsFree = Callable[[int, Indices], Booleans]
"""Whether rows (S,) are free up to a level."""


LIFT_STEP = 0.01
"""Metres between the heights of shortened lifts that are tried."""


def lift_heights(shortest: float, whole: float) -> Array:
    """Heights to try, rising from `shortest` to `whole` in steps of `LIFT_STEP` [m]."""
    rising = np.arange(shortest, whole - 1e-9, LIFT_STEP)
    rising[1:] = np.round(rising[1:], 9)  # sums of steps have rounding errors
    return np.append(rising, whole)


def raise_lifts(
    whole: Sequence[Reach], heights: Array, judge: ReachAtHeight, hand_is_free: HandIsFree
) -> list[Reach]:
    """Searches the largest lift of grasps for which the whole lift is not free.

    A lift ends `PREFERRED_CLEARANCE` before the height at which an obstacle stops the hand or,
    where that is lower, the arm; but it is at least the lowest height.

    Args:
        whole: N verdicts with the whole lift.
        heights: (H,) rising heights; the last is the whole lift [m].
        judge: judges grasps at other heights.
        hand_is_free: checks the hand alone at other heights.

    Returns:
        N verdicts. If the lowest height is free: success with the largest height found and the
        obstacle of the whole lift as `blocker`. Otherwise: the failure at the lowest height.
    """
    # Outcomes that a lower lift does not change.
    height_independent = (
        Outcome.HAND_COLLISION_APPROACH,
        Outcome.HAND_COLLISION_RETREAT,
        Outcome.NO_IK,
        Outcome.JOINT_LIMIT,
    )
    reserve = round(PREFERRED_CLEARANCE / LIFT_STEP)  # levels
    found = list(whole)
    grasps = _true_indices(
        reach.outcome is not None and reach.outcome not in height_independent for reach in whole
    )
    low, high = np.full(len(grasps), -1), np.full(len(grasps), len(heights) - 1)

    def is_reachable(level: int, rows: Indices) -> Booleans:
        verdicts = judge(heights[level], grasps[rows])
        for k, reach in zip(grasps[rows], verdicts, strict=True):
            if reach.outcome is None:
                found[k] = replace(reach, blocker=whole[k].blocker)
            elif level == 0:
                found[k] = reach
        return np.array([reach.outcome is None for reach in verdicts], dtype=bool)

    hand_blocked = _true_indices(whole[k].outcome is Outcome.HAND_COLLISION_LIFT for k in grasps)
    free, _ = _bisect_levels(
        low[hand_blocked],
        high[hand_blocked],
        lambda level, rows: hand_is_free(heights[level], grasps[hand_blocked[rows]]),
    )
    # The arm can often lift as high as the hand alone.
    guess = np.full(len(grasps), -1)
    guess[hand_blocked] = np.maximum(free - reserve, 0)
    high[hand_blocked] = guess[hand_blocked] + 1
    low, high = _narrow_levels(low, high, guess, is_reachable)
    # If the lowest height is not free, no height is.
    low, high = _narrow_levels(low, high, np.where(low < 0, 0, -1), is_reachable)
    low, _ = _bisect_levels(low, high, is_reachable)
    is_kept = (low == guess) & (low >= 0)  # The reserve is that of the hand.
    stopped = np.array([whole[k].blocker != "" for k in grasps], dtype=bool)
    short = np.flatnonzero(~is_kept & stopped & (low > 0))
    for level in np.unique(low[short]).tolist():
        is_reachable(max(level - reserve, 0), short[low[short] == level])
    return found


def _bisect_levels(low: Indices, high: Indices, is_free: LevelIsFree) -> tuple[Indices, Indices]:
    """Bisects for R rows between a free level and a blocked one (R,) until they are neighbours."""
    while (high - low > 1).any():
        low, high = _narrow_levels(low, high, (low + high) // 2, is_free)
    return low, high


def _narrow_levels(
    low: Indices, high: Indices, middle: Indices, is_free: LevelIsFree
) -> tuple[Indices, Indices]:
    """Checks one level per row (R,) between `low` and `high`, and narrows them by the result."""
    low, high = low.copy(), high.copy()
    between = (low < middle) & (middle < high)
    for level in np.unique(middle[between]).tolist():
        rows = np.flatnonzero(between & (middle == level))
        free = is_free(level, rows)
        low[rows[free]], high[rows[~free]] = level, level
    return low, high


def _true_indices(values: Iterable[bool]) -> Indices:
    return np.flatnonzero(np.fromiter(values, dtype=bool))


GRASPS_PER_BATCH = 128
"""Grasps searched together. Larger batches are hardly cheaper per grasp."""


class ArmReach:
    """Judges grasps of one scene; objects stand where the document places them.

    Attributes:
        settings: effort of the search.
        motion: the hand's straight segments to a grasp and away from it.
        kinematics: the arm on its own.
        diagram: the station diagram of the checks.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        settings: ReachSettings | None = None,
        ik: IkRoutine | None = None,
    ) -> None:
        """Builds the diagrams that all checks share.

        Args:
            scene, station: as loaded, or references for `load_scene` and `load_station`.
            settings: effort of the search; the defaults if None.
            ik: the user's inverse kinematics, for an arm without a closed form here.

        Raises:
            InvalidInputError: the station has no arm, or in its home posture something collides.
        """
        self.settings = settings or ReachSettings()
        scene, station = as_scene(scene), as_station(station)
        diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        self.motion = self.settings.motion or station.document.motion
        arm = station.document.arm
        assert arm is not None  # build_station_diagram requires it
        self.diagram = diagram
        self._proximity = ArmProximity(diagram)
        collision = ArmCollision(diagram, apart=self._proximity.apart)
        require_free_home(diagram, collision)
        self.kinematics = ArmKinematics.of(diagram)
        edges = EdgeChecker(self._proximity, collision, exact=self.settings.exact)
        home = np.array(arm.home)
        lower, upper = self.kinematics.one_revolution_around(home, self.settings.limit_margin)
        focus = postures_over_objects(diagram, self._proximity.links, home, lower, upper)
        self._tree = HomeTree(edges, home, lower, upper, focus=focus)
        self._sweep = HandSweep(scene, station, self.motion)
        X_WA = arm.X_WA.matrix()
        self._X_AW = inverse(X_WA)
        self._hand_path = HandPath.of(station.hand.X_HG.matrix(), X_WA[:3, :3], self.motion)
        self._search = _line_search(self, self._proximity, self._hand_path, home, ik)
        self._searches: dict[float, LineSearch] = {}

    def check(self, instance: str, X_WG: ArrayLike, width: float = np.nan) -> Reach:
        """Judges one grasp, with the same result as in a batch.

        Args:
            instance: the target's name in the scene.
            X_WG: (4, 4) grasp in the world, at which the open hand is clear.
            width: distance between the pads that hold the target [m]; if NaN, the hand retreats and
                lifts fully open.

        Returns:
            The verdict; the same for a grasp and for the one with its fingers swapped.

        Raises:
            InvalidInputError: `X_WG` is not a pose.
            UnknownNameError: the scene has no such instance.
        """
        X = check_pose(X_WG, "X_WG")
        return self.check_all([instance], X[None], np.array([width]))[0]

    def check_all(
        self, instances: Sequence[str], X_WG: ArrayLike, width: ArrayLike | None = None
    ) -> list[Reach]:
        """Judges N grasps.

        Args:
            instances: N names of the targets.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) as for `check`; unknown if None.

        Returns:
            N verdicts, which do not depend on each other.

        Raises:
            InvalidInputError: `X_WG` are not poses, or the numbers differ.
            UnknownNameError: the scene has no such instance.
        """
        X = check_pose(X_WG, "X_WG")
        widths = np.full(len(X), np.nan) if width is None else np.asarray(width, dtype=float)
        if X.ndim != 3 or not len(X) == len(instances) == len(widths):
            raise InvalidInputError(
                f"X_WG has shape {X.shape} for {len(instances)} instances and {len(widths)}"
                " widths; give N poses (N, 4, 4), N instances and N widths"
            )
        paths = HandPaths(
            self._sweep,
            np.array(instances, dtype=object),
            _with_swapped_fingers(X, self._X_AW),
            widths,
            retreats=self.motion.retreat > 0.0,
        )
        before, motion = paths.check_before_lift(), self.motion

        def judge(height: float, grasps: Indices) -> list[Reach]:
            return self._judge_at_height(paths[grasps], before[grasps], float(height))

        def hand_is_free(height: float, grasps: Indices) -> NDArray[np.bool_]:
            return ~paths[grasps].check_lift(before[grasps], height).blocked

        whole = judge(motion.lift_height, np.arange(len(X)))
        if motion.shortest >= motion.lift_height:
            return whole
        heights = lift_heights(motion.shortest, motion.lift_height)
        return raise_lifts(whole, heights, judge, hand_is_free)

    def path_is_free(
        self,
        q: Array,
        *,
        hand: bool = True,
        carried: str | None = None,
        moved_W: Array | None = None,
        width: float = np.nan,
    ) -> bool:
        """Whether the arm can follow a polyline in joint space without a collision.

        Args:
            q: (M, n) its corners, at least one.
            hand: whether the clearance bounds include the hand against the scene. False if the
                hand's motion has been checked before. Drake always includes it.
            carried: instance that the hand carries, if any.
            moved_W: (M, 3) its displacement at each corner [m]; linear between corners.
            width: distance between the pads that carry it [m]; NaN if the hand is open.
        """
        edges = self._tree.edges
        return (
            edges.first_blocked(q, hand=hand, carried=carried, moved_W=moved_W, width=width) is None
        )

    def shortcut(self, q: Array) -> Array:
        """A collision-free path (M, n) with the same ends as one from home that is no longer."""
        return self._tree.shortcut(q)

    def _judge_at_height(
        self, paths: HandPaths, before: HandVerdicts, height: float
    ) -> list[Reach]:
        """Verdicts on N grasps with a lift to one height [m]."""
        max_poses = 12 * GRASPS_PER_BATCH  # Poses on the paths. Limits memory to about 130 MB.
        hand = paths.check_lift(before, height)
        found = {k: hand.refusal(k) for k in np.flatnonzero(hand.blocked).tolist()}
        left = np.flatnonzero(~hand.blocked)
        if height not in self._searches:
            self._searches[height] = self._search.lifted(height)
        size = min(GRASPS_PER_BATCH, max_poses // len(replace(self._hand_path, lift=height).layers))
        for k in range(0, len(left), size):
            part = left[k : k + size]
            X_WG, clearance = paths.X_both[part], hand.clearance[part]
            room = np.minimum(clearance, hand.room[part])
            search = self._searches[height].begin(self._X_AW @ X_WG, room)
            names, width = paths.instance[part].tolist(), paths.width[part]
            grasps = GraspBatch(names, X_WG, width, clearance, room)
            verdicts = MotionSearch(grasps, search, self._tree, self.settings).run()
            for index, verdict in zip(part.tolist(), verdicts, strict=True):
                reached = verdict.outcome is None
                found[index] = replace(verdict, lift=height) if reached else verdict
        return [found[k] for k in range(len(hand.blocked))]


def _with_swapped_fingers(X_WG: Array, X_AW: Array) -> Array:
    """(N, 2, 4, 4) both finger assignments of grasps in the world, in an order that does not depend
    on which of the two is given."""
    twins = np.stack([X_WG, swap_fingers(X_WG)], axis=1)
    closing_A = (X_AW[:3, :3] @ X_WG[:, :3, :1])[..., 0]
    largest = np.take_along_axis(closing_A, np.abs(closing_A).argmax(axis=1)[:, None], axis=1)
    swapped = largest[:, 0] <= 0.0
    twins[swapped] = twins[swapped][:, ::-1]
    return twins


def _line_search(
    reach: ArmReach,
    proximity: ArmProximity,
    hand_path: HandPath,
    home: Array,
    routine: IkRoutine | None,
) -> LineSearch:
    """The closed form, then the numeric search, if the arm has a closed form; else numeric only."""
    arm, settings = reach.kinematics, reach.settings
    margin = settings.limit_margin
    if routine is not None:
        return NumericLineSearch(
            *(arm, hand_path, proximity, home, settings),
            solutions=RoutineSolutions(arm, routine, margin),
            unlimited_solutions=RoutineSolutions(arm, routine, margin, limited=False),
        )
    ik = PandaIk.of(arm) if settings.closed_form else None
    if ik is None:
        return NumericLineSearch(arm, hand_path, proximity, home, settings)
    rest = hand_path, proximity, home
    few = replace(settings, starts=settings.starts[:1])  # more found nothing more in 3,000 grasps
    return SuccessiveLineSearch(
        ClosedFormLineSearch(arm, ik.within(margin), *rest, settings),
        lambda: NumericLineSearch(arm, *rest, few),
    )
