"""How grasps are chosen for trials on the robot, in one object: the settings of `plan_trials`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import get_args

from burg_drake.core import LARGEST_SEED, InvalidInputError, nearest, quoted, setting
from burg_drake.core.grasps import Among
from burg_drake.experiment.trials import Balance, Selection, Success

MARGIN = "margin:"
"""Begins the name of a margin to balance by."""


@dataclass(frozen=True, kw_only=True)
class SelectionSettings:
    """Which grasps of each object are chosen, and in which order they are tried.

    Attributes:
        per_object: how many grasps of each object of a run, if there are as many.
        balance: what each object's grasps are balanced by, as far as there are enough: `outcome`,
            success and failure in simulation; `stage`, each outcome by itself; `margin:NAME`, bins
            of equal numbers of a margin; `probability`, such bins of the predicted probability of
            success, see `assess_robustness`; `none`.
        bins: their number.
        among: what is chosen from: `executed`, grasps that were tried in simulation, which in mode
            `hand` all are at which the hand is clear; `reachable`, those that the arm can be at;
            `clear`, all those at which the hand is clear, though no arm may come there; `all`, also
            those at which simulation has the hand collide.
        success: what counts: `lifted`, or `held`, also where it turned in the hand or another
            object was moved.
        scenes: how many scenes to draw at random; 0 for all.
        blocks: in how many blocks the trials of a scene come; each scene has one block before any
            has its second one.
        seed: of choice and order.

    Raises:
        InvalidInputError: a balance that does not exist, or a number that is too small.
    """

    per_object: int = setting(10, ("grasps of each object of a run"), low=1)
    balance: str = setting(
        "outcome",
        "balance grasps by: outcome, stage, margin:NAME, probability (of `robustness`) or none",
        metavar="BY",
    )
    bins: int = setting(4, ("bins for a margin or probability"), low=1)
    among: Among = setting(
        "executed",
        "choose among these: all, clear hand, reachable, or simulated grasps (default: executed)",
        choices=get_args(Among),
    )
    success: Success = setting(
        "lifted",
        "what counts as success; held includes turned objects and moved neighbours",
        choices=get_args(Success),
    )
    scenes: int = setting(0, "choose N scenes at random (default: all)", low=1)
    blocks: int = setting(1, "set up each scene this many times", low=1)
    seed: int = setting(0, "random seed of choice and order", high=LARGEST_SEED)

    def __post_init__(self) -> None:
        kinds = [name for name in get_args(Balance) if name != "margin"]
        if not self._margin and self.balance not in kinds:
            known = nearest(self.balance, [*kinds, f"{MARGIN}NAME"])
            raise InvalidInputError(f"there is no balance {quoted(self.balance)}; {known}")
        for name, kind in (("among", Among), ("success", Success)):
            value = getattr(self, name)
            if value not in get_args(kind):
                known = nearest(str(value), get_args(kind))
                raise InvalidInputError(f"there is no {name} {quoted(value)}; {known}")
        if self._has_bins and self.bins == 0:
            raise InvalidInputError("bins is 0; it has to be 1 at least")
        self.selection()

    def selection(self) -> Selection:
        """The same as trials files have it."""
        more = {
            "balance": "margin" if self._margin else self.balance,
            "margin": self._margin,
            "bins": self.bins if self._has_bins else 0,
        }
        return Selection(**(asdict(self) | more))

    @property
    def _margin(self) -> str:
        """Name of the margin to balance by; empty if it is something else."""
        return self.balance.removeprefix(MARGIN) if self.balance.startswith(MARGIN) else ""

    @property
    def _has_bins(self) -> bool:
        return bool(self._margin) or self.balance == "probability"
