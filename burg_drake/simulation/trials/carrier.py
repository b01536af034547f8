"""What carries the hand through a trial, as far as the phases of a trial have to know it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from burg_drake.core import Array
from burg_drake.simulation.trials.contacts import BodyContact


@dataclass(frozen=True, eq=False)
class HandSegment:
    """A straight segment of the hand with the target, from rest to rest.

    Attributes:
        direction_W: (3,) unit vector in the world.
        length: [m].
        checks: at the contacts, up to its end.
    """

    direction_W: Array
    length: float
    checks: int

    @property
    def is_straight_up(self) -> bool:
        """Whether nothing but its acceleration upwards loads a grip beside the weight."""
        return bool(self.direction_W[2] > 1.0 - 1e-9)


class Carrier(Protocol):
    """Brings the hand to the grasp and away from it, and watches what is met on the way.

    Attributes:
        approach_checks: looks at the contacts on the way to the grasp; 0 if the hand starts there.
        approach_steps: of the simulation from one of these looks to the next.
        segments: of the way with the target, at least one: the retreat, if there is one, and the
            lift.
        lift_time: how long they take [s].
        tracking_error, tracking_distance: see `Margins`; NaN if not measured.
    """

    approach_checks: int
    approach_steps: int
    segments: tuple[HandSegment, ...]
    lift_time: float
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

    def lift(self, number: int, check: int) -> None:
        """Commands the way in one of the segments, counted from 0, from one look, counted from 0
        where the segment begins, to the next."""
        ...

    def stop(self) -> None:
        """Commands the hand to stand where the last segment ends."""
        ...

    def advance_to(self, time: float) -> None:
        """Steps the simulation; going back and forth again gives the same."""
        ...

    def watch(self, contacts: list[BodyContact]) -> str:
        """Takes down what contacts and state say at a look.

        Returns:
            Name of what is in the way, for `TrialResult.blocker`; "" if nothing is.
        """
        ...

    def travelled(self) -> float:
        """How far the hand has gone in the present segment [m]."""
        ...

    def carries_full_load(self, check: int) -> bool:
        """Whether the load on the grip was as large as it will ever be during the last looks, up to
        the end of interval `check` of the last segment."""
        ...

    def is_free_ahead(self) -> bool:
        """Whether nothing would be met on the rest of the last segment, with the target as it is in
        the hand: geometry, no time steps."""
        ...
