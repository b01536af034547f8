"""What carries the hand through a trial, as far as the phases of a trial have to know it."""

from __future__ import annotations

from typing import Protocol

from burg_drake.simulation.contacts import Contact


class Carrier(Protocol):
    """Brings the hand to the grasp and raises it, and watches what is met on the way.

    Attributes:
        approach_looks: looks at the contacts on the way to the grasp; 0 if the hand starts there.
        approach_steps: of the simulation from one of these looks to the next.
        lift_looks: looks during the lift.
        lift_time: how long that takes [s].
        lift_height: how far the hand rises [m].
        tracking_error, tracking_distance: see `Margins`; NaN if not measured.
    """

    approach_looks: int
    approach_steps: int
    lift_looks: int
    lift_time: float
    lift_height: float
    tracking_error: float
    tracking_distance: float

    @property
    def touched(self) -> str:
        """See `TrialResult`."""
        ...

    def approach(self) -> None:
        """Commands the way to the grasp."""
        ...

    def close(self) -> None:
        """Commands the fingers to close, with the hand standing at the grasp."""
        ...

    def lift(self, look: int) -> None:
        """Commands the way up from one look, counted from 0 where the lift begins, to the next."""
        ...

    def stop(self) -> None:
        """Commands the hand to stand at the top."""
        ...

    def advance_to(self, time: float) -> None:
        """Steps the simulation; going back and forth again gives the same."""
        ...

    def watch(self, contacts: list[Contact]) -> str:
        """Takes down what contacts and state say at a look.

        Returns:
            Name of what is in the way, for `TrialResult.blocker`; "" if nothing is.
        """
        ...

    def risen(self) -> float:
        """How far the hand has risen in the lift [m]."""
        ...

    def bears_the_most(self, look: int) -> bool:
        """Whether the load on the grip was as large as it will ever be during the last looks, up to
        the end of interval `look` of the lift."""
        ...

    def is_free_above(self) -> bool:
        """Whether nothing would be met on the rest of the way up, with the target as it is in the
        hand: geometry, no time steps."""
        ...
