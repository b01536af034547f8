"""Foretells whether objects that seem to be at rest stay where they are.

What creeps in Drake does so at nearly the same pace whatever the time step: after 5 s in steps of
10 ms objects are where they are in steps of 1 ms, within 2 %. 0.2 s tell most that will stay from
the others. Of what leans on others 0.4 s foretell 0.6 to 1.4 times the way, as some get faster, and
what rocks seems to creep. What is in doubt is therefore looked at for longer, while all else is
frozen; 2 s foretell 0.9 to 1.05 times the way.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from pydrake.systems.analysis import Simulator

from burg_drake.core import Array
from burg_drake.simulation.rest.contact_islands import freeze, islands
from burg_drake.simulation.rest.criterion import BodySpeed, body_place, mean_speed
from burg_drake.simulation.rest.displacement import Displacement, displacement_from_document
from burg_drake.simulation.rest.falling import is_below
from burg_drake.simulation.rest.rolling_resistance import resist_rolling
from burg_drake.simulation.rest.still_check import (
    STILL_ANGLE,
    STILL_DISTANCE,
    STILL_DURATION,
    has_stayed,
    poses,
)
from burg_drake.station.diagram import StationDiagram

CHECK_TIMES = ((0.1, 0.2, 0.1), (0.2, 0.4, 0.4), (0.5, 1.0, 0.4), (1.0, 2.0, 0.8))
"""From when to when paces are measured [s]; before, all yields to its load that was let go from
rounded poses. And the share of the way that a settled scene may go in `STILL_DURATION`: what would
go less far stays, and what would go further by the last look does not."""


@dataclass(frozen=True)
class DriftPrediction:
    """What becomes of a scene that is let go.

    Attributes:
        moving: free objects that would move further in `STILL_DURATION` than those of a settled
            scene may, and their mean speed in that time, by name; none if all is at rest.
        X_WO: (4, 4) poses in the world of the free objects that are still on the table, by name: at
            the end for those that were in doubt until then, else as in the document.
        doubtful: those that were in doubt until the end, and what touches them.
    """

    moving: Mapping[str, BodySpeed]
    X_WO: Mapping[str, Array]
    doubtful: frozenset[str]

    @property
    def pace(self) -> float:
        """Of the fastest one, in shares of what a settled scene may go."""
        shares = [
            max(moved.speed / STILL_DISTANCE, moved.turning / STILL_ANGLE)
            for moved in self.moving.values()
        ]
        return STILL_DURATION * max(shares, default=0.0)


def predict_drift(
    built: StationDiagram, *, among: Collection[str] | None = None, once: bool = False
) -> DriftPrediction:
    """Lets a scene go, from where the documents place everything.

    Args:
        built: the scene without a robot.
        among: free objects to look at, with all that touches them; others are known to stay. All if
            None.
        once: leave it at the first look by which something does not stay.

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    watch = _Watch(built)
    watch.freeze_all_but(built.free if among is None else among)
    for start, end, share in CHECK_TIMES:
        shifts = watch.check_between(start, end)
        watch.freeze_all_but([n for n, shift in shifts.items() if not _is_within(shift, share)])
        if not watch.awake or (once and not all(map(has_stayed, shifts.values()))):
            break
    doubtful = frozenset(watch.awake)
    kept = {name: built.X_WO(name) for name in built.free if name not in doubtful}
    last = CHECK_TIMES[-1][-1]
    moving = {n: _mean_speed(shifts[n]) for n in watch.awake if not _is_within(shifts[n], last)}
    return DriftPrediction(moving, kept | watch.on_table(), doubtful)


class _Watch:
    """A scene that is simulated, and looked at now and then."""

    def __init__(self, built: StationDiagram) -> None:
        self._built, self._plant = built, built.plant
        self._simulator = Simulator(built.diagram)
        self._root = self._simulator.get_mutable_context()
        self._context = self._plant.GetMyContextFromRoot(self._root)
        resist_rolling(built, self._simulator)

        self._islands = islands(built)
        self._names = {index: name for name, index in built.free.items()}

    @property
    def awake(self) -> list[str]:
        """Objects that are not frozen."""
        return [self._names[index] for island in self._islands for index in island]

    def freeze_all_but(self, names: Iterable[str]) -> None:
        """Freezes all objects but these and what touches them."""
        chosen = {self._built.free[name] for name in names}
        for island in self._islands:
            if chosen.isdisjoint(island):
                freeze(self._built, self._root, island)
        self._islands = [i for i in self._islands if not chosen.isdisjoint(i)]

    def check_between(self, start: float, end: float) -> dict[str, Displacement]:
        """How far what is awake would move altogether, by its pace from `start` to `end` [s]."""
        built, context = self._built, self._context
        bodies = {name: self._plant.get_body(built.free[name]) for name in self.awake}
        self._simulator.AdvanceTo(start)
        before = {name: body_place(body, context) for name, body in bodies.items()}
        self._simulator.AdvanceTo(end)
        X_WO, left, shifts = poses(built, context), STILL_DURATION - end, {}
        for name, body in bodies.items():
            speed = mean_speed(before[name], body_place(body, context), end - start)
            now = displacement_from_document(built, name, X_WO[name])
            shifts[name] = Displacement(
                now.distance + left * speed.speed, now.angle + left * speed.turning
            )
        return shifts

    def on_table(self) -> dict[str, Array]:
        """Poses in the world of what is awake and still on the table."""
        built, X_WO = self._built, poses(self._built, self._context)
        above = (n for n in self.awake if not is_below(built, self._context, built.free[n]))
        return {name: X_WO[name] for name in above}


def _is_within(shift: Displacement, share: float) -> bool:
    """Whether a way is shorter than a share of what a settled scene may go; NaN is not."""
    return shift.distance < share * STILL_DISTANCE and shift.angle < share * STILL_ANGLE


def _mean_speed(shift: Displacement) -> BodySpeed:
    return BodySpeed(shift.distance / STILL_DURATION, shift.angle / STILL_DURATION)
