"""Whether the arm reaches a grasp: collision-free configurations at grasp and pregrasp.

Both ways to put the fingers are tried, as they are the same grasp. A verdict depends on the grasp
alone: not on its neighbours, their order, or a random stream.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose, inverse, pregrasp, swap_fingers
from burg_drake.core.outcome import Outcome
from burg_drake.motion.collision import ArmCollision, Overlap
from burg_drake.motion.ik import ArmKinematics
from burg_drake.motion.postures import Posture, posture_search
from burg_drake.motion.reach_settings import ReachSettings
from burg_drake.scene.scene import Scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.station import Station

EXPLAINED = 16
"""Configurations, of either way to put the fingers, of which it is asked what is in the way: to
measure that costs several times as much as to see that something is."""


@dataclass(frozen=True, eq=False)
class Reach:
    """What the arm can do with a grasp.

    Attributes:
        outcome: `NO_IK`, `ARM_COLLISION`, or None if the arm reaches grasp and pregrasp.
        q_grasp, q_pregrasp: (n,) arm positions [rad]; None if not reached.
        blocker: what was in the way of which link, such as `panda_link5 vs mug`, of the
            configuration that came closest, among the `EXPLAINED` nearest to home; empty if
            nothing was.
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
        home = np.array(arm.home)
        self._search = posture_search(self.kinematics, home, self.settings)
        at_home = self.collision.overlaps(home)
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
        attempt = _Attempt(self.collision)
        for postures in self._search.rounds(X_AH, X_AH_before):
            for posture in postures:
                if attempt.is_free(posture):
                    return Reach(None, posture.q, posture.q_before)
            if attempt.is_hopeless:
                break
        return attempt.verdict()


def _same_for_both(X_AG: Array) -> Array:
    """(2, 4, 4) the grasp and its twin with swapped fingers, in the same order for either."""
    closing = X_AG[:3, 0]
    twins = [X_AG, swap_fingers(X_AG)]
    return np.array(twins if closing[np.abs(closing).argmax()] > 0.0 else twins[::-1])


class _Attempt:
    """Collision checks of one grasp, and what they say when all have failed."""

    def __init__(self, collision: ArmCollision) -> None:
        self._collision = collision
        self._blocked: set[int] = set()
        self._explained = [0, 0]
        self._least: Overlap | None = None

    def is_free(self, posture: Posture) -> bool:
        """Whether the arm collides neither at the grasp nor at the pregrasp.

        A way to put the fingers is given up once the hand itself is found in collision, as no
        other configuration can help.
        """
        if posture.way in self._blocked:
            return False
        both = (posture.q, posture.q_before)
        if all(self._collision.is_free(q) for q in both):
            return True
        if self._explained[posture.way] == EXPLAINED:
            return False
        self._explained[posture.way] += 1
        overlaps = [overlap for q in both for overlap in self._collision.overlaps(q)]
        if any(overlap.carried for overlap in overlaps):
            self._blocked.add(posture.way)
            overlaps = [overlap for overlap in overlaps if overlap.carried]
        worst = max(overlaps, key=lambda overlap: overlap.depth, default=None)
        if worst is not None and (self._least is None or worst.depth < self._least.depth):
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
