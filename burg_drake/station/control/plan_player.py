"""Plays a plan: what arm and hand are commanded at a time.

A plan comes from rooms further down, so that this one knows it by its shape alone: `PlayablePlan`.
`burg_drake.Plan` has that shape.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from burg_drake.core import Array, InvalidInputError
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station

CLOSE, OPEN = "close", "open"
"""Phases with which the hand closes and opens; in between it stays as it is, and it begins open."""
APART = 1e-6
"""Ends of phases that are meant to meet [rad]."""


class SampledMotion(Protocol):
    """Joint positions over time: `t` (T,) rising from 0 [s], `q` and `v` (T, n)."""

    @property
    def t(self) -> Array: ...

    @property
    def q(self) -> Array: ...

    @property
    def v(self) -> Array: ...


@runtime_checkable
class PlayablePlan(Protocol):
    """Phases by name, one after the other; the distance between the pads of the open hand [m]; what
    the plan is for, with the names of its `joints`, or None; and whether that is this scene and
    station, which is not asked without an origin."""

    @property
    def phases(self) -> Mapping[str, SampledMotion]: ...

    @property
    def opening(self) -> float: ...

    @property
    def origin(self) -> Any: ...

    def require_for(self, scene: Scene, station: Station) -> None: ...


@dataclass(frozen=True, eq=False)
class PlannedCommand:
    """What a plan wants at some time.

    Attributes:
        q, v: (n,) positions and velocities of the arm [rad, rad/s].
        closed: whether the hand closes or holds.
        opening: distance between the pads if not [m].
    """

    q: Array
    v: Array
    closed: bool
    opening: float


@dataclass(frozen=True, eq=False)
class _PlannedSamples:
    q: PiecewisePolynomial
    duration: float
    switches: tuple[tuple[float, bool], ...]
    opening: float


class PlanPlayer:
    """Plays plans that were made for one arm in one scene.

    Args:
        joints: names of the arm's n joints, in order.
        scene, station: what plans have to be for.
    """

    def __init__(self, joints: tuple[str, ...], scene: Scene, station: Station) -> None:
        self._joints, self._scene, self._station = joints, scene, station
        self._plan: object = None
        self._samples: _PlannedSamples | None = None

    def command(self, plan: object, time: float) -> PlannedCommand | None:
        """What arm and hand are to do.

        Args:
            plan: a `PlayablePlan`, or None.
            time: since its start [s].

        Returns:
            The command; None without a plan and before its start. After its end a plan stays where
            it ends.

        Raises:
            InvalidInputError: it is not a plan, or one for another arm, scene or station; or the
                time is not a number.
        """
        if plan is None:
            return None
        if self._samples is None or plan is not self._plan:
            self._samples, self._plan = self._checked(plan), plan
        if np.isnan(time):
            raise InvalidInputError(
                "plan.start_time is nan; give the time in seconds at which the plan begins"
            )
        if time < 0.0:
            return None
        samples = self._samples
        when = min(time, samples.duration)
        q = samples.q.value(when)[:, 0]
        v = samples.q.EvalDerivative(when, 1)[:, 0] if time < samples.duration else np.zeros(len(q))
        closed = [closing for start, closing in samples.switches if start <= time]
        return PlannedCommand(q, v, bool(closed and closed[-1]), samples.opening)

    def _checked(self, plan: object) -> _PlannedSamples:
        if not isinstance(plan, PlayablePlan):
            got = type(plan).__name__
            if hasattr(plan, "outcome"):  # a planner's answer where it found no plan
                got += f" ({plan.outcome})"
            raise InvalidInputError(f"port 'plan' got a {got}; give a burg_drake Plan")
        if plan.origin is not None:
            self._check_joints(plan.origin.joints)
            plan.require_for(self._scene, self._station)
        opening = plan.opening
        if np.isnan(opening):
            opening = self._station.hand.opening[1]
        return _sample_plan(plan.phases, len(self._joints), opening)

    def _check_joints(self, joints: Sequence[str]) -> None:
        if tuple(joints) != self._joints:
            raise InvalidInputError(
                f"the plan moves the joints {', '.join(joints)}; the arm of station"
                f" {self._station.name!r} has {', '.join(self._joints)}"
            )


def _sample_plan(
    phases: Mapping[str, SampledMotion], joints: int, opening: float
) -> _PlannedSamples:
    """Joins phases to one trajectory, and notes when the hand closes and opens."""
    times, positions, velocities = [np.zeros(1)], list[Array](), list[Array]()
    switches, end, before = [], 0.0, ""
    for name, phase in phases.items():
        if phase.q.shape[1] != joints:
            raise InvalidInputError(
                f"the plan's {name} moves {phase.q.shape[1]} joints; the arm has {joints}"
            )
        if not positions:
            positions.append(phase.q[:1])
            velocities.append(phase.v[:1])
        gap = float(np.abs(phase.q[0] - positions[-1][-1]).max())
        if gap > APART:
            raise InvalidInputError(
                f"the plan's {name} begins {gap:.2g} rad from where its {before} ends"
            )
        if name in (CLOSE, OPEN):
            switches.append((end, name == CLOSE))
        times.append(end + phase.t[1:])
        positions.append(phase.q[1:])
        velocities.append(phase.v[1:])
        end, before = float(times[-1][-1]), name
    if not positions:
        raise InvalidInputError("the plan has no phases")
    t, q, v = (np.concatenate(rows) for rows in (times, positions, velocities))
    return _PlannedSamples(
        PiecewisePolynomial.CubicHermite(t, q.T, v.T), end, tuple(switches), opening
    )
