"""Whether the arm can execute a grasp, all the way: from home to the pregrasp, straight to the
grasp, and with the target in the hand straight back and up.

A yes carries the whole motion, and Drake's own collision checker has seen it; a no says what failed
first and what was in the way. Both ways to put the fingers are tried, as they are the same grasp. A
verdict depends on the grasp alone: not on its neighbours, their order, or a random stream.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, Indices, InvalidInputError, check_pose, inverse, swap_fingers
from burg_drake.motion.collision import ArmCollision, EdgeChecker, require_free_home
from burg_drake.motion.ik import ArmKinematics, IkRoutine, PandaIk, RoutineSolutions
from burg_drake.motion.lines import (
    ClosedFormLineSearch,
    LinePoses,
    LineSearch,
    NumericLineSearch,
    ReachSettings,
    SuccessiveLineSearch,
)
from burg_drake.motion.proximity import ArmProximity
from burg_drake.motion.reach.attempt import GraspBatch, MotionSearch
from burg_drake.motion.reach.hand_paths import HandPaths, HandVerdicts
from burg_drake.motion.reach.lift_height import lift_heights, raise_lifts
from burg_drake.motion.reach.verdict import Reach
from burg_drake.motion.sweep import HandSweep
from burg_drake.motion.transit import HomeTree, postures_over_objects
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.document import StationLike, as_station

BATCH = 128
"""Grasps whose motions are looked for together: enough that more would hardly be cheaper each ...
"""
POSES = 12 * BATCH
"""... and poses of their ways at which postures are looked for: bounds the memory of long ways to
some 130 MB."""


class ArmReach:
    """Judges grasps of one scene; objects stand where the document places them.

    Attributes:
        settings: how thoroughly it looks.
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
            scene, station: what stands where: as loaded, or references for `load_scene` and
                `load_station`.
            settings: how thoroughly to look, if not as usual.
            ik: inverse kinematics of one's own for an arm without a closed form here.

        Raises:
            InvalidInputError: the station has no arm, or in its home posture something collides.
        """
        self.settings = settings or ReachSettings()
        scene, station = as_scene(scene), as_station(station)
        diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        self.motion = self.settings.motion or station.document.motion
        arm = station.document.arm
        assert arm is not None  # build_station_diagram has seen to it
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
        self._lines = LinePoses.of(station.hand.X_HG.matrix(), X_WA[:3, :3], self.motion)
        self._search = _line_search(self, self._proximity, self._lines, home, ik)
        self._searches: dict[float, LineSearch] = {}

    def check(self, instance: str, X_WG: ArrayLike, width: float = np.nan) -> Reach:
        """Judges one grasp: as in a batch.

        Args:
            instance: the target's name in the scene.
            X_WG: (4, 4) grasp in the world, at which the open hand is clear.
            width: distance between the pads that hold the target [m]; NaN if it is not known, and
                the hand goes back and up as wide as it is open then.

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
            _both(X, self._X_AW),
            widths,
            retreats=self.motion.retreat > 0.0,
        )
        before, motion = paths.before_lift(), self.motion

        def judge(height: float, some: Indices) -> list[Reach]:
            return self._lifted(paths[some], before[some], float(height))

        def hand_is_free(height: float, some: Indices) -> NDArray[np.bool_]:
            return ~paths[some].lifted(before[some], height).blocked

        whole = judge(motion.lift_height, np.arange(len(X)))
        if motion.shortest >= motion.lift_height:
            return whole
        tried = lift_heights(motion.shortest, motion.lift_height)
        return raise_lifts(whole, tried, judge, hand_is_free)

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
            hand: whether the bounds that are asked first count the hand against the scene; without,
                the motion of the hand has been judged otherwise. Drake counts it all the same.
            carried: instance that the hand carries, if any.
            moved_W: (M, 3) how far it is from its place at each corner [m]; straight between
                corners.
            width: distance between the pads that carry it [m]; NaN if the hand is open.
        """
        blocked = self._tree.edges.first_blocked(
            q, hand=hand, carried=carried, moved_W=moved_W, width=width
        )
        return blocked is None

    def shortcut(self, q: Array) -> Array:
        """A collision-free path (M, n) with the same ends as one from home that is no longer."""
        return self._tree.shortcut(q)

    def _lifted(self, paths: HandPaths, before: HandVerdicts, height: float) -> list[Reach]:
        """Verdicts on N grasps with a lift to one height [m]."""
        hand = paths.lifted(before, height)
        found: dict[int, Reach] = {
            int(k): hand.refusal(int(k)) for k in np.flatnonzero(hand.blocked)
        }
        left = np.flatnonzero(~hand.blocked)
        if height not in self._searches:
            self._searches[height] = self._search.lifted(height)
        size = min(BATCH, POSES // len(replace(self._lines, lift=height).layers))
        for k in range(0, len(left), size):
            part = left[k : k + size]
            X_WG, clearance = paths.X_both[part], hand.clearance[part]
            lines = self._searches[height].begin(self._X_AW @ X_WG, clearance)
            task = GraspBatch(paths.instance[part].tolist(), X_WG, paths.width[part], clearance)
            verdicts = MotionSearch(task, lines, self._tree, self.settings).run()
            for index, verdict in zip(part.tolist(), verdicts, strict=True):
                reached = verdict.outcome is None
                found[index] = replace(verdict, lift=height) if reached else verdict
        return [found[k] for k in range(len(hand.blocked))]


def _both(X_WG: Array, X_AW: Array) -> Array:
    """(N, 2, 4, 4) grasps in the world and their twins with swapped fingers, in the same order
    whichever of the two was given."""
    twins = np.stack([X_WG, swap_fingers(X_WG)], axis=1)
    closing_A = (X_AW[:3, :3] @ X_WG[:, :3, :1])[..., 0]
    largest = np.take_along_axis(closing_A, np.abs(closing_A).argmax(axis=1)[:, None], axis=1)
    swapped = largest[:, 0] <= 0.0
    twins[swapped] = twins[swapped][:, ::-1]
    return twins


def _line_search(
    reach: ArmReach,
    proximity: ArmProximity,
    lines: LinePoses,
    home: Array,
    routine: IkRoutine | None,
) -> LineSearch:
    """By the closed form first where the arm has one and it is wanted, else numerically."""
    arm, settings = reach.kinematics, reach.settings
    margin = settings.limit_margin
    if routine is not None:
        return NumericLineSearch(
            *(arm, lines, proximity, home, settings),
            solutions=RoutineSolutions(arm, routine, margin),
            beyond=RoutineSolutions(arm, routine, margin, limited=False),
        )
    ik = PandaIk.of(arm) if settings.closed_form else None
    if ik is None:
        return NumericLineSearch(arm, lines, proximity, home, settings)
    rest = lines, proximity, home
    few = replace(settings, starts=settings.starts[:1])  # more found nothing more in 3,000 grasps
    return SuccessiveLineSearch(
        ClosedFormLineSearch(arm, ik.within(margin), *rest, settings),
        lambda: NumericLineSearch(arm, *rest, few),
    )
