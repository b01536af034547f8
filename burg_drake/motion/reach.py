"""Whether the arm reaches a grasp: collision-free configurations at grasp and pregrasp.

Both ways to put the fingers are tried, as they are the same grasp. The starts of the inverse
kinematics come from a fixed table of postures, so that a verdict depends on the grasp alone: not
on its neighbours, their order, or a random stream.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core.content import rng_from
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose, inverse, pregrasp, swap_fingers
from burg_drake.core.outcome import Outcome
from burg_drake.motion.collision import ArmCollision, Overlap
from burg_drake.motion.ik import ArmKinematics, solve_ik
from burg_drake.scene.scene import Scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.station import Station

LENGTH_SCALE = 0.3
"""Distance [m] that counts as much as one radian when postures near a pose are looked up."""


@dataclass(frozen=True, kw_only=True)
class ReachSettings:
    """How thoroughly to look for arm configurations.

    Attributes:
        standoff: distance from pregrasp to grasp along the approach direction [m].
        starts: starts of the inverse kinematics, round by round; a next round is made if the one
            before found nothing.
        postures: size of the table that starts are taken from.
        iterations: most steps from a start.
        tolerance: largest error of a solution [m and rad].
        limit_margin: distance to keep from the joint limits [rad].
        joint_travel: most that a joint may move between pregrasp and grasp [rad]; with more, the
            two lie on different branches, and the hand could not go straight from one to the
            other.
    """

    standoff: float = 0.10
    starts: tuple[int, ...] = (32, 64, 128)
    postures: int = 4096
    iterations: int = 15
    tolerance: float = 1e-6
    limit_margin: float = 0.01
    joint_travel: float = 1.0

    def __post_init__(self) -> None:
        if self.standoff < 0.0 or self.limit_margin < 0.0 or self.joint_travel <= 0.0:
            raise InvalidInputError(
                "standoff and limit_margin must be at least 0, joint_travel above 0"
            )
        if not self.starts or not 0 < sum(self.starts) <= 2 * self.postures:
            raise InvalidInputError(
                f"starts {list(self.starts)} must be whole numbers above 0, in all at most twice"
                f" the number of postures, {self.postures}"
            )


@dataclass(frozen=True, eq=False)
class Reach:
    """What the arm can do with a grasp.

    Attributes:
        outcome: `NO_IK`, `ARM_COLLISION`, or None if the arm reaches grasp and pregrasp.
        q_grasp, q_pregrasp: (n,) arm positions [rad]; None if not reached.
        blocker: of the configuration that came closest, what was in the way of which link, such as
            `panda_link5 vs mug`; empty if nothing was.
    """

    outcome: Outcome | None
    q_grasp: Array | None = None
    q_pregrasp: Array | None = None
    blocker: str = ""


class ArmReach:
    """Judges grasps of one scene; objects stand where the document places them, the hand is open.

    Attributes:
        kinematics: the arm on its own.
        collision: the arm in the scene.
    """

    def __init__(
        self, scene: Scene, station: Station, *, settings: ReachSettings | None = None
    ) -> None:
        """Builds the diagram that all checks share.

        Raises:
            InvalidInputError: the station has no arm, or in its home posture something collides.
        """
        self.settings = settings or ReachSettings()
        diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        arm = station.document.arm
        assert arm is not None  # build_station_diagram has seen to it
        self.collision = ArmCollision(diagram)
        self.kinematics = ArmKinematics.from_plant(
            diagram.plant,
            diagram.arm_joints,
            base=diagram.plant.GetFrameByName(
                arm.base, diagram.plant.GetModelInstanceByName("arm")
            ),
            hand=diagram.plant.GetFrameByName(
                station.hand.body, diagram.plant.GetModelInstanceByName("hand")
            ),
        )
        self._hand = station.hand
        self._X_AW = inverse(arm.X_WA.matrix())
        self._home = np.array(arm.home)
        self._postures = _PostureTable(self.kinematics, self._home, self.settings)
        at_home = self.collision.overlaps(self._home)
        if at_home:
            pairs = ", ".join(dict.fromkeys(f"{o.link} with {o.other}" for o in at_home))
            raise InvalidInputError(
                f"{station.path}: arm.home collides in scene {scene.name!r}: {pairs}; change the"
                " posture or move what is in the way"
            )

    def check(self, X_WG: ArrayLike) -> Reach:
        """Looks for arm configurations at grasp and pregrasp.

        Args:
            X_WG: (4, 4) grasp in the world.

        Returns:
            The verdict; the same for a grasp and for the one with its fingers swapped.
        """
        X_AG = _same_for_both(self._X_AW @ check_pose(X_WG, "X_WG"))
        X_AH = self._hand.X_AH(X_AG)
        X_AH_before = self._hand.X_AH(pregrasp(X_AG, self.settings.standoff))
        search = _Search(self.collision)
        used = 0
        for starts in self.settings.starts:
            way, start = self._postures.nearest(X_AH, used, starts)
            used += starts
            for k, q, q_before in self._configurations(X_AH, X_AH_before, way, start):
                if search.is_free(k, q, q_before):
                    return Reach(None, q, q_before)
            if search.is_hopeless:
                break
        return search.verdict()

    def _configurations(
        self, X_AH: Array, X_AH_before: Array, way: NDArray[np.int_], start: Array
    ) -> list[tuple[int, Array, Array]]:
        """Inverse kinematics at the grasp, and from there at the pregrasp.

        Args:
            X_AH, X_AH_before: (2, 4, 4) hand poses of the two ways to put the fingers.
            way: (N,) which of the two a start is meant for.
            start: (N, n) arm positions.

        Returns:
            Way, grasp and pregrasp configuration where both exist; closest to home first.
        """
        settings = self.settings

        def solve(goal: Array, start: Array) -> tuple[Array, NDArray[np.bool_]]:
            return solve_ik(
                self.kinematics,
                goal,
                start,
                iterations=settings.iterations,
                tolerance=settings.tolerance,
                margin=settings.limit_margin,
            )

        q, met = solve(X_AH[way], start)
        way, q = way[met], q[met]
        if not len(q):
            return []
        q_before, met = solve(X_AH_before[way], q)
        met &= np.abs(q_before - q).max(axis=1) <= settings.joint_travel
        distance = np.abs(q_before - self._home).max(axis=1)
        order = [i for i in np.argsort(distance, kind="stable") if met[i]]
        return [(int(way[i]), q[i], q_before[i]) for i in order]


def _same_for_both(X_AG: Array) -> Array:
    """(2, 4, 4) the grasp and its twin with swapped fingers, in the same order for either."""
    closing = X_AG[:3, 0]
    twins = [X_AG, swap_fingers(X_AG)]
    return np.array(twins if closing[np.abs(closing).argmax()] > 0.0 else twins[::-1])


class _PostureTable:
    """Arm configurations spread over the joint ranges, to be looked up by hand pose."""

    def __init__(self, arm: ArmKinematics, home: Array, settings: ReachSettings) -> None:
        lower, upper = arm.lower + settings.limit_margin, arm.upper - settings.limit_margin
        rng = rng_from("burg_drake postures", settings.postures)
        q = rng.uniform(lower, upper, (settings.postures, len(lower)))
        q[0] = home
        X_AH, _ = arm.forward(q)
        self._q = q
        self._p = X_AH[:, :3, 3].copy()
        self._R = X_AH[:, :3, :3].reshape(-1, 9)

    def nearest(self, X_AH: Array, skip: int, count: int) -> tuple[NDArray[np.int_], Array]:
        """The postures with hand poses closest to two wanted ones.

        Args:
            X_AH: (2, 4, 4) wanted hand poses.
            skip: how many of the closest to leave out, over both.
            count: how many to return, over both.

        Returns:
            (count,) index of the pose and (count, n) arm positions.
        """
        cosine = 0.5 * (X_AH[:, :3, :3].reshape(2, 9) @ self._R.T - 1.0)
        offset = self._p - X_AH[0, :3, 3]  # swapping the fingers leaves the hand's origin in place
        squared = (
            np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2 + (offset**2).sum(axis=1) / LENGTH_SCALE**2
        )
        order = np.argsort(squared, axis=None, kind="stable")[skip : skip + count]
        return order // len(self._q), self._q[order % len(self._q)]


class _Search:
    """Collision checks of one grasp, and what they say when all have failed."""

    def __init__(self, collision: ArmCollision) -> None:
        self._collision = collision
        self._blocked: set[int] = set()
        self._least: Overlap | None = None

    def is_free(self, way: int, q: Array, q_before: Array) -> bool:
        """Whether the arm collides neither at the grasp nor at the pregrasp.

        A way to put the fingers is given up once the hand itself is found in collision, as no
        other configuration can help.
        """
        if way in self._blocked:
            return False
        overlaps = [*self._collision.overlaps(q), *self._collision.overlaps(q_before)]
        if not overlaps:
            return self._collision.is_free(q) and self._collision.is_free(q_before)
        if any(overlap.carried for overlap in overlaps):
            self._blocked.add(way)
            overlaps = [overlap for overlap in overlaps if overlap.carried]
        worst = max(overlaps, key=lambda overlap: overlap.depth)
        if self._least is None or worst.depth < self._least.depth:
            self._least = worst
        return False

    @property
    def is_hopeless(self) -> bool:
        """Whether the hand is in collision either way."""
        return len(self._blocked) == 2

    def verdict(self) -> Reach:
        """The outcome after the last configuration."""
        if self._least is None:
            return Reach(Outcome.NO_IK)
        return Reach(Outcome.ARM_COLLISION, blocker=str(self._least))
