"""How thoroughly arm configurations are looked for."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class ReachSettings:
    """How thoroughly to look for arm configurations.

    Attributes:
        standoff: distance from pregrasp to grasp along the approach direction [m].
        closed_form: whether to use the closed form for arms that have one, the Panda.
        redundant: values of the redundant joint that the closed form sweeps, round by
            round; a next round is made if the one before found nothing. A round that is an odd
            multiple of another one has its values, too, and leaves them out.
        starts: likewise, starts of the numeric inverse kinematics of other arms.
        postures: size of the table that starts are taken from.
        iterations: most steps from a start.
        tolerance: largest error of a solution [m and rad].
        limit_margin: distance to keep from the joint limits [rad].
        joint_travel: most that a joint may move between pregrasp and grasp [rad]; with more, the
            two lie on different branches, and the hand could not go straight from one to the
            other.
    """

    standoff: float = 0.10
    closed_form: bool = True
    redundant: tuple[int, ...] = (32, 96)
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
        if not self.redundant or min(self.redundant) < 1:
            raise InvalidInputError(
                f"redundant {list(self.redundant)} must be whole numbers above 0"
            )
        if not self.starts or not 0 < sum(self.starts) <= 2 * self.postures:
            raise InvalidInputError(
                f"starts {list(self.starts)} must be whole numbers above 0, in all at most twice"
                f" the number of postures, {self.postures}"
            )
