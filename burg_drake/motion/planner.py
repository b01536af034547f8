"""Plans grasps: finds the motion of a grasp and times it, so that an arm can run it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array, check_pose
from burg_drake.motion.arm_reach import ArmReach
from burg_drake.motion.grasp_timing import PathChecks, time_motion
from burg_drake.motion.joint_limits import ArmLimits
from burg_drake.motion.motion_settings import ReachSettings, TimingSettings
from burg_drake.motion.plan_files import Plan
from burg_drake.motion.polyline_timing import IsFree
from burg_drake.motion.reach_verdict import ArmPath, Reach
from burg_drake.motion.trajectory import PlanOrigin
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import StationLike, as_station


class Planner:
    """Plans grasps of one scene.

    Example::

        planner = burg.Planner(burg.ArmReach("tabletop_six", "panda_tabletop"))
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 20, only=["box"])
        found = [planner.plan("box", X_OG) for X_OG in grasps.X_OG]
        plans = [plan for plan in found if isinstance(plan, burg.Plan)]

    Attributes:
        reach: finds the paths.
        limits: limits of the arm's joints.
        settings: speeds and tolerances.
    """

    def __init__(self, reach: ArmReach, *, settings: TimingSettings | None = None) -> None:
        """Reads the limits of the arm of `reach`.

        Raises:
            InvalidInputError: the arm has no velocity limits.
        """
        self.reach = reach
        self.settings = settings or TimingSettings()
        self.limits = ArmLimits.of(reach.diagram, reach.kinematics)

    def plan(self, instance: str, X_OG: ArrayLike, width: float = np.nan) -> Plan | Reach:
        """Plans a grasp.

        Args:
            instance: the target's name in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            width: distance between the pads that hold the target [m]; NaN if it is not known.

        Returns:
            The plan, or why there is none.

        Raises:
            InvalidInputError: `X_OG` is not a pose.
            UnknownNameError: the scene has no such instance.
        """
        X_WG = self.reach.diagram.X_WO(instance) @ check_pose(X_OG, "X_OG")
        reach = self.reach.check(instance, X_WG, width)
        if reach.path is None:
            return reach
        return self.time(instance, reach.path, width)

    def time(self, instance: str, path: ArmPath, width: float = np.nan) -> Plan:
        """Times a path of `reach`, after shortening the transfer.

        Deviations from the path (rounded corners, smoothed segments) are checked for collisions in
        the same way as the path.

        Args:
            instance: the target.
            path: path of the arm.
            width: distance between the pads that hold the target [m]; NaN if it is not known.
        """
        is_free, hand = self.reach.path_is_free, self.reach.diagram.station.hand
        if len(path.transfer) > 2:
            path = replace(path, transfer=self.reach.shortcut(path.transfer))
        motion, back_W = self.reach.motion, -path.X_WG[:3, 2]

        def carrying(u_W: Array, start_W: Array) -> IsFree:
            return lambda q: is_free(
                q,
                hand=False,
                carried=instance or None,
                moved_W=start_W + self._along(u_W, q) if instance else None,
                width=width,
            )

        checks = PathChecks(
            transfer=is_free,
            approach=lambda q: is_free(q, hand=False),
            retreat=carrying(back_W, np.zeros(3)),
            lift=carrying(motion.direction_W, motion.retreat * back_W),
        )
        plan = time_motion(
            path,
            self.limits,
            self.reach.kinematics,
            settings=self.settings,
            checks=checks,
            limit_margin=self.reach.settings.limit_margin,
        )
        low, high = hand.opening
        finger_travel = high - (low if np.isnan(width) else min(width, high))
        return replace(
            plan,
            close_time=finger_travel / 2.0 / hand.closing_speed + 0.2,  # builds up the force
            opening=high,
            width=width,
            origin=replace(self._origin, instance=instance, X_WG=path.X_WG),
        )

    def _along(self, u_W: Array, q: Array) -> Array:
        """(M, 3) displacement of the hand from its first pose along a unit vector (3,) in the world
        [m]."""
        arm = self.reach.diagram.station.document.arm
        assert arm is not None
        p_AH = self.reach.kinematics.forward(q)[0][:, :3, 3]
        u_A = u_W @ arm.X_WA.matrix()[:3, :3]
        return np.asarray(np.maximum(0.0, (p_AH - p_AH[0]) @ u_A)[:, None] * u_W)

    @cached_property
    def _origin(self) -> PlanOrigin:
        """Origin of all plans, without target and grasp. Cached: hashing the documents takes as
        long as planning."""
        diagram = self.reach.diagram
        return PlanOrigin(
            joints=tuple(joint.name() for joint in diagram.arm_joints),
            limits=self.limits,
            station=diagram.station.name,
            station_content=diagram.station.content,
            scene=diagram.scene.name,
            scene_content=diagram.scene.content,
            instance="",
            X_WG=np.eye(4),
        )


def plan(
    scene: SceneLike,
    station: StationLike,
    instance: str,
    X_OG: ArrayLike,
    *,
    width: float = np.nan,
    reach: ReachSettings | None = None,
    timing: TimingSettings | None = None,
) -> Plan | Reach:
    """Plans a single grasp; `Planner` is for many of one scene.

    Example::

        found = burg.plan("tabletop_six", "panda_tabletop", "box", X_OG)  # in the box's frame
        if isinstance(found, burg.Plan):
            found.to_json("plan.json")
        else:
            print(found.outcome, found.blocker)

    Args:
        scene: the scene with the target.
        station: the arm and its surroundings.
        instance: the target's name in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        width: distance between the pads that hold the target [m]; NaN if it is not known.
        reach: effort of the search.
        timing: speeds and tolerances.

    Returns:
        The plan, or why there is none.

    Raises:
        InvalidInputError: `X_OG` is not a pose, the station has no arm, the arm collides in its
            home posture, or a joint has no velocity limit.
        UnknownNameError: the scene has no such instance.
    """
    scene, station = as_scene(scene), as_station(station)
    planner = Planner(ArmReach(scene, station, settings=reach), settings=timing)
    return planner.plan(instance, X_OG, width)
