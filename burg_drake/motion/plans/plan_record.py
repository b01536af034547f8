"""What files of plans have in common: what a plan is for, where its phases are, and what has to be
true of the samples that are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

import burg_drake
from burg_drake.core import Array, BurgError, InvalidInputError, check_pose, quoted
from burg_drake.core.files import READ_ERRORS, without_warnings
from burg_drake.motion.plans.planned_motion import PHASES, PlannedMotion, PlanOrigin
from burg_drake.motion.plans.trajectory import Trajectory

FORMAT, VERSION = "burg_drake plan", 1
NANO = 1_000_000_000
STAMP_TOLERANCE = 1.0
"""What rounding may change of a time [ns]."""
SLACK = 1e-5
"""How far a plan may exceed a limit, in rad or relative to it: more than the timing lets it."""

Spans = dict[str, tuple[int, int]]
"""First and last sample of each phase; two that follow one another share one."""


@dataclass(frozen=True)
class PlanDescription:
    """What a file says of a plan beside its samples; see `Plan`."""

    rate: float
    opening: float
    width: float
    close_time: float
    origin: PlanOrigin | None


def closed(phase: str) -> bool:
    """Whether the hand closes, or is closed, in a phase."""
    return PHASES.index(phase) >= PHASES.index("close")


def joint_names(plan: PlannedMotion) -> tuple[str, ...]:
    """Names of the joints, made up if nobody has said them."""
    if plan.origin is not None:
        return plan.origin.joints
    return tuple(f"joint{i + 1}" for i in range(plan.approach.q.shape[1]))


def spans_of(plan: PlannedMotion) -> Spans:
    """Where the phases are among the samples of the whole plan."""
    spans, first = {}, 0
    for name, phase in plan.phases.items():
        spans[name] = (first, first + len(phase.t) - 1)
        first = spans[name][1]
    return spans


def require_writable(plan: PlannedMotion) -> None:
    """Refuses a plan that could not be read again.

    Raises:
        InvalidInputError: samples are not evenly spaced, or no finite numbers.
    """
    whole, rate = plan.whole, plan.approach.rate
    if not np.isfinite([whole.q, whole.v, whole.a]).all():
        raise InvalidInputError("the plan has samples that are not finite, so it cannot be written")
    for name, phase in plan.phases.items():
        if not np.allclose(phase.t, np.arange(len(phase.t)) / rate, rtol=0.0, atol=1.0 / NANO):
            raise InvalidInputError(f"phase {name!r} is not sampled at {rate:g} Hz")


def plan_data(plan: PlannedMotion) -> dict[str, Any]:
    """JSON values of all of a plan but its samples."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "burg_drake": burg_drake.__version__,
        "origin": _origin_data(plan.origin) if plan.origin else None,
        "hand": {name: _number(getattr(plan, name)) for name in ("opening", "width", "close_time")},
        "rate": plan.approach.rate,
    }


def require_version(data: Any, path: str | Path) -> None:
    """Refuses what is not a plan, or one of another release.

    Raises:
        InvalidInputError: it is not.
    """
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InvalidInputError(f"{path} is not a plan: its format is not {FORMAT!r}")
    if data.get("version") != VERSION:
        raise InvalidInputError(
            f"{path} has version {quoted(data.get('version'))}; this release reads {VERSION}"
        )


@contextmanager
def part(document: Mapping[str, Any], name: str) -> Iterator[Any]:
    """A part of a document, whose errors name it."""
    try:
        yield document[name]
    except BurgError:
        raise
    except READ_ERRORS as error:
        raise InvalidInputError(f"{name!r} is missing or was changed") from error


def read_data(document: Mapping[str, Any], joints: tuple[str, ...]) -> PlanDescription:
    """What `plan_data` has written.

    Raises:
        InvalidInputError: it is damaged, or of other joints.
    """
    with part(document, "hand") as hand:
        opening, width = (
            np.nan if hand[name] is None else float(hand[name]) for name in ("opening", "width")
        )
        if min(opening, width) < 0.0 or np.inf in (opening, width):
            raise ValueError(hand)
        close_time = float(hand["close_time"])
    with part(document, "rate") as rate:
        if not 0.0 < rate < np.inf:
            raise ValueError(rate)
    origin = None
    if document.get("origin") is not None:
        with part(document, "origin") as data:
            origin = _read_origin(data, joints)
    return PlanDescription(rate, opening, width, close_time, origin)


def assembled(
    description: PlanDescription, t: Array, spans: Spans, rows: Sequence[Array]
) -> PlannedMotion:
    """A plan of its samples.

    Args:
        description: what else is known of it.
        t: (T,) times of the samples [s].
        spans: where the phases are.
        rows: positions, velocities and accelerations, (T, n) each.

    Raises:
        InvalidInputError: times, phases or positions do not belong together, or are beyond the
            limits.
    """
    exact = np.arange(len(t)) / description.rate
    apart = ~(np.abs(exact - t) * NANO <= STAMP_TOLERANCE)
    if apart.any():
        k = apart.argmax()
        raise InvalidInputError(
            f"point {k} is at {t[k]:.9g} s; with {description.rate:g} samples per second it must"
            f" be at {exact[k]:.9g} s"
        )
    _require_spans(spans, len(t))
    parts = {
        name: Trajectory(exact[: last - first + 1], *(x[first : last + 1] for x in rows))
        for name, (first, last) in spans.items()
    }
    plan = PlannedMotion(
        **{name: trajectory for name, trajectory in parts.items() if name != "close"},
        close_time=description.close_time,
        opening=description.opening,
        width=description.width,
        origin=description.origin,
    )
    _require_rest(parts, plan)
    if description.origin is not None:
        _require_within(plan.whole, description.origin)
    return plan


def _require_spans(spans: Spans, count: int) -> None:
    """The phases cover all samples without a gap, in their order."""
    missing = [name for name in PHASES if name not in spans and name != "retreat"]
    if missing:
        raise InvalidInputError(f"phase {missing[0]!r} is missing")
    end = 0
    for name in (phase for phase in PHASES if phase in spans):
        first, last = spans[name]
        complete = name != PHASES[-1] or last == count - 1
        if not (first == end < last < count and complete):
            wanted = "to a later one" if name != PHASES[-1] else f"to the last one, {count - 1}"
            raise InvalidInputError(
                f"phase {name!r} has points {first} to {last}; it must go from point {end} {wanted}"
            )
        end = last


def _require_rest(parts: Mapping[str, Trajectory], plan: PlannedMotion) -> None:
    """The arm rests between the phases, and for as long as the hand closes."""
    for name, trajectory in parts.items():
        if np.any([trajectory.v[[0, -1]], trajectory.a[[0, -1]]]):
            raise InvalidInputError(f"the arm is not at rest at the ends of phase {name!r}")
    close = parts["close"]
    if not np.isfinite(plan.close_time) or len(plan.phases["close"].t) != len(close.t):
        raise InvalidInputError(
            f"phase 'close' takes {close.duration:g} s, but the hand closes for"
            f" {plan.close_time:g} s"
        )
    if np.any(close.q != close.q[0]):
        raise InvalidInputError("the arm moves in phase 'close'")


def _require_within(whole: Trajectory, origin: PlanOrigin) -> None:
    """Every joint keeps its limits."""
    limits = origin.limits
    outside = (whole.q < limits.lower - SLACK) | (whole.q > limits.upper + SLACK)
    if outside.any():
        row, joint = np.argwhere(outside)[0]
        raise InvalidInputError(
            f"point {row} has joint {origin.joints[joint]!r} at {whole.q[row, joint]:.4f}, outside"
            f" its limits {limits.lower[joint]:.4f} to {limits.upper[joint]:.4f}"
        )
    with without_warnings():  # numbers of a damaged file may be huge
        peaks = whole.peaks()
    for name, peak in zip(("velocity", "acceleration", "jerk"), peaks, strict=True):
        limit = getattr(limits, name)
        if (peak > limit * (1.0 + SLACK)).any():
            joint = int((peak / limit).argmax())
            raise InvalidInputError(
                f"the {name} of joint {origin.joints[joint]!r} reaches {peak[joint]:.4g}, above"
                f" its limit of {limit[joint]:.4g}"
            )


def _number(value: float) -> float | None:
    """For JSON, which has no infinity and no NaN."""
    return float(value) if np.isfinite(value) else None


def _origin_data(origin: PlanOrigin) -> dict[str, Any]:
    data: dict[str, Any] = {
        f.name: getattr(origin, f.name)
        for f in fields(origin)
        if f.name not in ("joints", "limits", "X_WG")
    }
    limits = {f.name: _numbers(getattr(origin.limits, f.name)) for f in fields(origin.limits)}
    return data | {"X_WG": origin.X_WG.tolist(), "limits": limits}


def _numbers(values: Array) -> list[float | None]:
    return [_number(value) for value in values]


def _read_origin(data: dict[str, Any], joints: tuple[str, ...]) -> PlanOrigin:
    from burg_drake.motion.ik import ArmLimits  # imports Drake

    given = {
        name: np.array([none if value is None else value for value in values], dtype=float)
        for name, values in data["limits"].items()
        for none in (-np.inf if name == "lower" else np.inf,)
    }
    limits = ArmLimits(**given)
    if any(len(values) != len(joints) for values in given.values()):
        raise InvalidInputError(
            f"origin has limits for another number of joints than the {len(joints)} of the plan"
        )
    rest = {name: value for name, value in data.items() if name not in ("limits", "X_WG")}
    return PlanOrigin(joints=joints, limits=limits, X_WG=check_pose(data["X_WG"], "X_WG"), **rest)
