"""Files of plans.

CSV, for a table: a row a sample with `t` [s], `phase`, `q1` to `qn`, `v1`..., `a1`... [rad, rad/s,
rad/s^2], and `width`, the wanted distance between the pads [m]: while the hand closes and holds,
that of the target, on which it presses with its force, or 0 if nobody knows it.

JSON: `joint_trajectory` is laid out as ROS's message `trajectory_msgs/JointTrajectory`; beside it
there is what the plan is for, the limits that it keeps, the samples a second, and where its phases
are among the points.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

import burg_drake
from burg_drake.core.damaged import DAMAGED
from burg_drake.core.decimal_text import row_texts
from burg_drake.core.document_text import GRASP_FILE
from burg_drake.core.errors import BurgError, DocumentError, InvalidInputError, quoted
from burg_drake.core.files import atomic_write
from burg_drake.core.frames import Array, check_pose
from burg_drake.core.json_text import load_json
from burg_drake.motion.limits import ArmLimits
from burg_drake.motion.trajectory import PHASES, Origin, Plan, Trajectory

FORMAT, VERSION = "burg_drake plan", 1
NANO = 1_000_000_000
STAMP_TOLERANCE = 1.0
"""What rounding may change of a time [ns]."""
SLACK = 1e-5
"""How far a plan may exceed a limit, in rad or relative to it: more than the timing lets it."""


def write_csv(plan: Plan, path: str | Path) -> None:
    """Writes the samples of all phases as a table.

    Raises:
        InvalidInputError: the place cannot be written to.
    """
    whole, spans = plan.whole, _spans(plan)
    numbers = range(1, whole.q.shape[1] + 1)
    lines = [",".join(["t", "phase", *(f"{x}{i}" for x in "qva" for i in numbers), "width"])]
    times = row_texts(whole.t[:, None])
    rows = row_texts(np.hstack([whole.q, whole.v, whole.a]))
    for phase, (first, last) in spans.items():
        end = f",{_width(plan, phase)!r}"
        start = first if first == 0 else first + 1
        lines += [f"{times[k]},{phase},{rows[k]}{end}" for k in range(start, last + 1)]
    atomic_write(path, "\n".join(lines) + "\n")


def write_json(plan: Plan, path: str | Path) -> None:
    """Writes a plan whole, for `load_plan` and others.

    Raises:
        InvalidInputError: the place cannot be written to, or the samples are not evenly spaced, or
            no finite numbers.
    """
    whole, origin, rate = plan.whole, plan.origin, plan.approach.rate
    if not np.isfinite([whole.q, whole.v, whole.a]).all():
        raise InvalidInputError("a plan with samples that are not finite cannot be written")
    for name, phase in plan.phases.items():
        if not np.allclose(phase.t, np.arange(len(phase.t)) / rate, rtol=0.0, atol=1.0 / NANO):
            raise InvalidInputError(f"phase {name!r} does not have {rate:g} samples a second")
    names = origin.joints if origin else [f"joint{i + 1}" for i in range(whole.q.shape[1])]
    stamps = np.rint(whole.t * NANO).astype(int).tolist()
    rows = zip(stamps, *(row_texts(x, ", ") for x in (whole.q, whole.v, whole.a)), strict=True)
    points = ", ".join(
        f'{{"positions": [{q}], "velocities": [{v}], "accelerations": [{a}],'
        f' "time_from_start": {{"sec": {time // NANO}, "nanosec": {time % NANO}}}}}'
        for time, q, v, a in rows
    )
    document = {
        "format": FORMAT,
        "version": VERSION,
        "burg_drake": burg_drake.__version__,
        "origin": _origin_data(origin) if origin else None,
        "hand": {name: _number(getattr(plan, name)) for name in ("opening", "width", "close_time")},
        "rate": rate,
        "phases": {name: list(span) for name, span in _spans(plan).items()},
        "joint_trajectory": {"joint_names": list(names), "points": []},
    }
    text = json.dumps(document, allow_nan=False)
    atomic_write(path, text.removesuffix("]}}") + points + "]}}\n")


def load_plan(path: str | Path) -> Plan:
    """Reads what `Plan.to_json` has written.

    Raises:
        InvalidInputError: there is no such file, it is no plan, or one that is damaged: with times,
            phases or positions that do not belong together, or beyond its own limits.
    """
    try:
        document = load_json(path, GRASP_FILE)
    except DocumentError as error:
        raise DocumentError(
            f"{error}; give a file of Plan.to_json (a CSV cannot be read back)"
        ) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InvalidInputError(f"{path} is no plan: it lacks format {FORMAT!r}")
    if document.get("version") != VERSION:
        raise InvalidInputError(
            f"{path} has version {quoted(document.get('version'))}; this release reads {VERSION}"
        )
    try:
        return _plan(document)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: the plan is damaged: {error}; write it again") from error


@contextmanager
def _part(document: dict[str, Any], name: str) -> Iterator[Any]:
    """A part of the document, whose errors name it."""
    try:
        yield document[name]
    except BurgError:
        raise
    except DAMAGED as error:
        raise InvalidInputError(f"{name!r} is not as Plan.to_json writes it") from error


def _plan(document: dict[str, Any]) -> Plan:
    with _part(document, "hand") as hand:
        opening, width = (
            np.nan if hand[name] is None else float(hand[name]) for name in ("opening", "width")
        )
        close_time = float(hand["close_time"])
    with _part(document, "joint_trajectory") as motion:
        joints = tuple(str(name) for name in motion["joint_names"])
        rows = _rows(motion["points"], len(joints))
        stamps = [point["time_from_start"] for point in motion["points"]]
        nanoseconds = np.array([stamp["sec"] * NANO + stamp["nanosec"] for stamp in stamps])
    with _part(document, "rate") as rate:
        if not 0.0 < rate < np.inf:
            raise ValueError(rate)
        t = np.arange(len(nanoseconds)) / rate
        apart = np.abs(t * NANO - nanoseconds) > STAMP_TOLERANCE
    if apart.any():
        raise InvalidInputError(
            f"the time of point {apart.argmax()} is not that of {rate:g} samples a second"
        )
    parts = {}
    with _part(document, "phases") as phases:
        for name, (first, last) in _read_spans(phases, len(t)).items():
            parts[name] = Trajectory(t[: last - first + 1], *(x[first : last + 1] for x in rows))
    origin = None
    if document.get("origin") is not None:
        with _part(document, "origin") as data:
            origin = _read_origin(data, joints)
    plan = Plan(
        parts["transfer"],
        parts["approach"],
        parts["lift"],
        close_time=close_time,
        opening=opening,
        width=width,
        origin=origin,
    )
    _require_rest(parts, plan)
    if origin is not None:
        _require_within(plan.whole, origin)
    return plan


def _rows(points: list[dict[str, Any]], n: int) -> list[Array]:
    """Positions, velocities and accelerations, (T, n) each."""
    found = []
    for name in ("positions", "velocities", "accelerations"):
        for k, point in enumerate(points):
            if len(point[name]) != n or not np.isfinite(point[name]).all():
                raise InvalidInputError(f"{name} of point {k} are not {n} finite numbers")
        found.append(np.array([point[name] for point in points], dtype=float))
    return found


def _read_spans(phases: dict[str, Any], count: int) -> dict[str, tuple[int, int]]:
    """First and last point of each phase, which cover all points without a gap."""
    spans, end = {}, 0
    for name in PHASES:
        first, last = phases[name]
        complete = name != PHASES[-1] or last == count - 1
        if not (first == end < last < count and complete):
            wanted = "to a later one" if name != PHASES[-1] else f"to the last one, {count - 1}"
            raise InvalidInputError(
                f"phase {name!r} has points {first} to {last}; it has to go from point {end}"
                f" {wanted}"
            )
        spans[name], end = (first, last), last
    return spans


def _require_rest(parts: dict[str, Trajectory], plan: Plan) -> None:
    """The arm rests between the phases, and for as long as the hand closes."""
    for name, part in parts.items():
        if np.any([part.v[[0, -1]], part.a[[0, -1]]]):
            raise InvalidInputError(f"at an end of phase {name!r} the arm does not rest")
    close = parts["close"]
    if not np.isfinite(plan.close_time) or len(plan.phases["close"].t) != len(close.t):
        raise InvalidInputError(
            f"phase 'close' takes {close.duration:g} s, and the hand closes for"
            f" {plan.close_time:g} s"
        )
    if np.any(close.q != close.q[0]):
        raise InvalidInputError("the arm moves in phase 'close'")


def _require_within(whole: Trajectory, origin: Origin) -> None:
    """Every joint keeps its limits."""
    limits = origin.limits
    outside = (whole.q < limits.lower - SLACK) | (whole.q > limits.upper + SLACK)
    if outside.any():
        row, joint = np.argwhere(outside)[0]
        raise InvalidInputError(
            f"point {row} has joint {origin.joints[joint]!r} at {whole.q[row, joint]:.4f}, outside"
            f" its limits {limits.lower[joint]:.4f} to {limits.upper[joint]:.4f}"
        )
    for name, peak in zip(("velocity", "acceleration", "jerk"), whole.peaks(), strict=True):
        limit = getattr(limits, name)
        if (peak > limit * (1.0 + SLACK)).any():
            joint = int((peak / limit).argmax())
            raise InvalidInputError(
                f"the {name} of joint {origin.joints[joint]!r} gets to {peak[joint]:.4g}, beyond"
                f" its limit of {limit[joint]:.4g}"
            )


def _spans(plan: Plan) -> dict[str, tuple[int, int]]:
    """First and last row of each phase; two that follow one another share one."""
    spans, first = {}, 0
    for name, phase in plan.phases.items():
        spans[name] = (first, first + len(phase.t) - 1)
        first = spans[name][1]
    return spans


def _width(plan: Plan, phase: str) -> float:
    """Commanded distance between the pads [m]."""
    width = plan.width if phase in ("close", "lift") else plan.opening
    return 0.0 if phase in ("close", "lift") and np.isnan(width) else float(width)


def _number(value: float) -> float | None:
    """For JSON, which has no infinity and no NaN."""
    return float(value) if np.isfinite(value) else None


def _origin_data(origin: Origin) -> dict[str, Any]:
    data: dict[str, Any] = {
        f.name: getattr(origin, f.name)
        for f in fields(origin)
        if f.name not in ("joints", "limits", "X_WG")
    }
    limits = {f.name: _numbers(getattr(origin.limits, f.name)) for f in fields(origin.limits)}
    return data | {"X_WG": origin.X_WG.tolist(), "limits": limits}


def _numbers(values: Array) -> list[float | None]:
    return [_number(value) for value in values]


def _read_origin(data: dict[str, Any], joints: tuple[str, ...]) -> Origin:
    given = {
        name: np.array([none if value is None else value for value in values], dtype=float)
        for name, values in data["limits"].items()
        for none in (-np.inf if name == "lower" else np.inf,)
    }
    limits = ArmLimits(**given)
    if any(len(values) != len(joints) for values in given.values()):
        raise InvalidInputError(f"the limits in 'origin' are not those of {len(joints)} joints")
    rest = {name: value for name, value in data.items() if name not in ("limits", "X_WG")}
    return Origin(joints=joints, limits=limits, X_WG=check_pose(data["X_WG"], "X_WG"), **rest)
