"""The motions of one grasp, and what they are for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.motion.plans.trajectory import Trajectory

if TYPE_CHECKING:
    from pydrake.trajectories import PiecewisePolynomial

    from burg_drake.motion.ik import ArmLimits
    from burg_drake.scene.document import Scene, SceneLike
    from burg_drake.station.document import Station, StationLike

PHASES = ("transfer", "approach", "close", "retreat", "lift")
"""What happens one after the other; while the hand closes the arm rests, and without a retreat the
lift follows at once."""

DIGITS = 12
"""Of a content hash, in messages."""


@dataclass(frozen=True, eq=False)
class PlanOrigin:
    """What a plan is for.

    Attributes:
        joints: names of the n joints, in the order of the trajectories' columns.
        limits: of these joints.
        station, scene: names.
        station_content, scene_content: hashes of what the names stood for.
        instance: the target in the scene; empty if there is none.
        X_WG: (4, 4) the grasp in the world with the fingers as the arm puts them.
    """

    joints: tuple[str, ...]
    limits: ArmLimits
    station: str
    station_content: str
    scene: str
    scene_content: str
    instance: str
    X_WG: Array


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """The motions of one grasp; what people get and store is a `Plan`.

    Attributes:
        transfer: from the home posture to the pregrasp.
        approach: straight from there to the grasp.
        lift: straight along the lift, which begins where the retreat ends.
        close_time: time that the hand takes to close, after the approach [s].
        opening: distance between the pads before the hand closes [m] ...
        width: ... and once it holds the target [m]; NaN if nobody knows.
        origin: what it is for; None if nobody has said.
        retreat: straight back from the grasp with what the hand holds; None if the lift begins at
            the grasp.
    """

    transfer: Trajectory
    approach: Trajectory
    lift: Trajectory
    close_time: float = 1.0
    opening: float = np.nan
    width: float = np.nan
    origin: PlanOrigin | None = None
    retreat: Trajectory | None = None

    @property
    def phases(self) -> dict[str, Trajectory]:
        """Those of `PHASES` that there are, in their order; each begins with the row that the last
        one ends with."""
        close = Trajectory.rest(self.approach.q[-1], self.close_time, self.approach.rate)
        parts = (self.transfer, self.approach, close, self.retreat, self.lift)
        return {name: part for name, part in zip(PHASES, parts, strict=True) if part is not None}

    def __repr__(self) -> str:
        phases = ", ".join(f"{name} {part.duration:.2f} s" for name, part in self.phases.items())
        of = f"{self.origin.instance!r} of {self.origin.scene!r}: " if self.origin else ""
        return f"{type(self).__name__}({of}{phases}; {self.approach.q.shape[1]} joints)"

    @property
    def whole(self) -> Trajectory:
        """From home to the top of the lift, with the pause in which the hand closes."""
        return Trajectory.joined(list(self.phases.values()))

    @property
    def duration(self) -> float:
        """Time of all phases [s]."""
        return sum(phase.duration for phase in self.phases.values())

    def to_drake(self) -> PiecewisePolynomial:
        """`whole` for Drake's `TrajectorySource`."""
        return self.whole.to_drake()

    def require_for(
        self,
        scene: SceneLike | None = None,
        station: StationLike | None = None,
        *,
        name: str = "the plan",
    ) -> None:
        """Refuses a plan for another scene or station, by their contents.

        Args:
            scene, station: what it has to be for; None does not matter.
            name: what to call the plan.

        Raises:
            InvalidInputError: it is for another one, or does not tell what it is for.
        """
        from burg_drake.scene.document import as_scene  # here: a plan alone needs none of it
        from burg_drake.station.document import as_station

        wanted: list[tuple[str, Scene | Station]] = []
        if station is not None:
            wanted.append(("station", as_station(station)))
        if scene is not None:
            wanted.append(("scene", as_scene(scene)))
        if wanted and self.origin is None:
            raise InvalidInputError(
                f"{name} does not say which scene and arm it is for; a CSV plan has this in"
                " NAME.csv-metadata.json next to it"
            )
        for kind, here in wanted:
            there = getattr(self.origin, kind), getattr(self.origin, f"{kind}_content")
            if there[1] != here.content:
                changed = "as it was before a change" if there[0] == here.name else f"{there[0]!r}"
                raise InvalidInputError(
                    f"{name} is for {kind} {changed} (content {str(there[1])[:DIGITS]}), not"
                    f" for {here.name!r} (content {here.content[:DIGITS]}); plan its grasp here"
                )
