"""How thoroughly arm configurations are looked for."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core import InvalidInputError
from burg_drake.station.document import GraspMotion


@dataclass(frozen=True, kw_only=True)
class ReachSettings:
    """How thoroughly to look for arm configurations.

    Attributes:
        motion: the hand's straight segments to a grasp and away from it; those that the station
            states if None.
        exact: whether Drake's collision checker has the last word on every motion; without it, for
            screening, the best guess of bounds of the arm's clearance decides.
        closed_form: whether to use the closed form for arms that have one, the Panda.
        redundant: values of the redundant joint that the closed form sweeps, round by round; a
            next round is made if the one before found nothing.
        starts: likewise, postures that the numeric inverse kinematics of other arms starts from,
            for each way to put the fingers.
        iterations: most steps from a start.
        tolerance: largest error of a solution [m and rad].
        limit_margin: distance to keep from the joint limits [rad].
        joint_travel: most that a joint may move while the hand moves by 5 cm [rad]; with more, the
            two postures lie on different branches, and the hand could not go straight from one to
            the other.
        deviation: the hand may be beside the straight segment by half of its clearance, but by no
            less and no more than these two [m].
        chains: so many motions of a grasp may be refused by the collision checker before it is
            given up ...
        starts_tried: ... and so many of its pregrasp postures that the arm does not get to.
    """

    motion: GraspMotion | None = None
    exact: bool = True
    closed_form: bool = True
    redundant: tuple[int, ...] = (32, 192)
    starts: tuple[int, ...] = (32, 64, 128)
    iterations: int = 15
    tolerance: float = 1e-6
    limit_margin: float = 0.01
    joint_travel: float = 0.8
    deviation: tuple[float, float] = (2e-5, 5e-4)
    chains: int = 24
    starts_tried: int = 4

    def __post_init__(self) -> None:
        if self.limit_margin < 0.0 or self.joint_travel <= 0:
            raise InvalidInputError("limit_margin must be at least 0, joint_travel above 0")
        if not self.redundant or min(self.redundant) < 1:
            raise InvalidInputError(
                f"redundant is {list(self.redundant)}; give whole numbers above 0"
            )
        if not self.starts or min(self.starts) < 1:
            raise InvalidInputError(f"starts is {list(self.starts)}; give whole numbers above 0")
        if min(self.chains, self.starts_tried) < 1:
            raise InvalidInputError("chains and starts_tried must be at least 1")
        if not 0.0 < self.deviation[0] <= self.deviation[1]:
            raise InvalidInputError(
                f"deviation is {list(self.deviation)}; give two lengths, the smaller one first"
            )
