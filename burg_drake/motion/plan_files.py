"""`Plan`, the motions of one grasp, and its files: JSON, or CSV with metadata beside it.

In JSON, `joint_trajectory` is laid out as ROS's message `trajectory_msgs/JointTrajectory`, beside
the origin of the plan, its limits, its sample rate and the spans of its phases. A CSV table has
the columns `t` [s], `phase`, `q_JOINT`, `v_JOINT` and `a_JOINT` of each joint, and `width`, the
wanted distance between the pads [m]: that of the target from when the hand closes, or 0 if it is
unknown. The metadata follow the standard of CSV on the Web.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import burg_drake
from burg_drake.core import (
    READ_ERRORS,
    TEXT_UNIT,
    Array,
    BurgError,
    Column,
    DocumentError,
    FileLimits,
    InvalidInputError,
    atomic_write,
    atomic_write_all,
    check_pose,
    csv_metadata,
    load_json,
    metadata_path,
    quote_value,
    read_rows,
    suppress_numpy_warnings,
)
from burg_drake.motion.trajectory import MOTION_PHASES, PlanOrigin, Trajectory, round_to_grid

if TYPE_CHECKING:
    from pydrake.trajectories import PiecewisePolynomial

    from burg_drake.scene import Scene, SceneLike
    from burg_drake.station import Station, StationLike

PLAN_FORMAT = "burg_drake plan"  # Value of `format` in files of plans.
PLAN_VERSION = 1  # Version of files of plans.
NANOSECONDS_PER_SECOND = 1_000_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """The motions of one grasp.

    Attributes:
        transfer: from the home posture to the pregrasp.
        approach: straight from there to the grasp.
        lift: straight along the lift, which begins where the retreat ends.
        close_time: time that the hand takes to close, after the approach [s].
        opening: distance between the pads before the hand closes [m]; NaN if unknown.
        width: distance between the pads once the hand holds the target [m]; NaN if unknown.
        origin: the scene, station and grasp that the plan is for; None if unknown.
        retreat: straight back from the grasp with the target; None if the lift begins at the grasp.
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
        """Trajectories by name, in the order of `MOTION_PHASES`; each begins with the last row of
        the phase before."""
        close = Trajectory.rest(self.approach.q[-1], self.close_time, self.approach.rate)
        parts = (self.transfer, self.approach, close, self.retreat, self.lift)
        return {
            name: part for name, part in zip(MOTION_PHASES, parts, strict=True) if part is not None
        }

    def __repr__(self) -> str:
        phases = ", ".join(f"{name} {part.duration:.2f} s" for name, part in self.phases.items())
        of = f"{self.origin.instance!r} of {self.origin.scene!r}: " if self.origin else ""
        return f"Plan({of}{phases}; {self.approach.q.shape[1]} joints)"

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
            scene, station: what the plan has to be for; None is not checked.
            name: name of the plan in messages.

        Raises:
            InvalidInputError: it is for another scene or station, or its origin is unknown.
        """
        hash_digits = 12  # Digits of a content hash in messages.
        from burg_drake.scene import as_scene  # not needed to load a plan
        from burg_drake.station import as_station

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
                    f"{name} is for {kind} {changed} (content {str(there[1])[:hash_digits]}), not"
                    f" for {here.name!r} (content {here.content[:hash_digits]}); plan its grasp"
                    " here"
                )

    def to_csv(self, path: str | Path) -> None:
        """Writes a table that `load_plan` reads, and a metadata file next to it.

        Raises:
            InvalidInputError: the path cannot be written to, or the samples are not evenly spaced
                or not finite.
        """
        path, whole = Path(path), self.whole
        _require_writable(self)
        joints = _joint_names(self)
        meanings = _column_meanings(joints)
        lines = [",".join(map(_quote_cell, meanings))]
        times = format_rows(whole.t[:, None])
        rows = format_rows(np.hstack([whole.q, whole.v, whole.a]))
        for phase, (first, last) in _phase_spans(self).items():
            start, end = first if first == 0 else first + 1, f",{_width_cell(self, phase)}"
            lines += [f"{times[k]},{phase},{rows[k]}{end}" for k in range(start, last + 1)]
        described = json.dumps(csv_metadata(path.name, meanings, [_plan_metadata(self)]), indent=1)
        atomic_write_all({metadata_path(path): described + "\n", path: "\n".join(lines) + "\n"})

    def to_json(self, path: str | Path) -> None:
        """Writes a JSON document that `load_plan` reads.

        Raises:
            InvalidInputError: the path cannot be written to, or the samples are not evenly spaced
                or not finite.
        """
        _require_writable(self)
        whole = self.whole
        stamps = np.rint(whole.t * NANOSECONDS_PER_SECOND).astype(int).tolist()
        times = (divmod(stamp, NANOSECONDS_PER_SECOND) for stamp in stamps)
        rows = zip(times, *(format_rows(x, ", ") for x in (whole.q, whole.v, whole.a)), strict=True)
        points = ", ".join(
            f'{{"positions": [{q}], "velocities": [{v}], "accelerations": [{a}],'
            f' "time_from_start": {{"sec": {seconds}, "nanosec": {nanoseconds}}}}}'
            for (seconds, nanoseconds), q, v, a in rows
        )
        document = _plan_metadata(self) | {
            "phases": {name: list(span) for name, span in _phase_spans(self).items()},
            "joint_trajectory": {"joint_names": list(_joint_names(self)), "points": []},
        }
        text = json.dumps(document, allow_nan=False)
        atomic_write(path, text.removesuffix("]}}") + points + "]}}\n")


def load_plan(
    path: str | Path, *, scene: SceneLike | None = None, station: StationLike | None = None
) -> Plan:
    """Reads a plan that `Plan.to_json` or `Plan.to_csv` has written.

    Example::

        plan = burg.load_plan("plan.json", station="panda_tabletop")
        for name, phase in plan.phases.items():
            print(name, phase.duration, phase.q[-1])

    Args:
        path: the file; a table if its name ends in .csv.
        scene, station: what the plan has to be for, if given.

    Raises:
        InvalidInputError: the file does not exist or is not a plan; its times, phases or positions
            are inconsistent or exceed its own limits; or it is for another scene or station, or its
            origin is unknown.
    """
    path = Path(path)
    read = _read_csv if path.suffix.lower() == ".csv" else _read_json
    plan = read(path)
    plan.require_for(scene, station, name=str(path))
    return plan


Spans = dict[str, tuple[int, int]]
"""First and last sample of each phase; successive phases share a sample."""


@dataclass(frozen=True)
class PlanDescription:
    """Contents of a plan's file without the samples; see `Plan`."""

    rate: float
    opening: float
    width: float
    close_time: float
    origin: PlanOrigin | None


def _is_hand_closed(phase: str) -> bool:
    """Whether the hand closes, or is closed, in a phase."""
    return MOTION_PHASES.index(phase) >= MOTION_PHASES.index("close")


def _joint_names(plan: Plan) -> tuple[str, ...]:
    """Names of the joints; `joint1`, `joint2` and so on if unknown."""
    if plan.origin is not None:
        return plan.origin.joints
    return tuple(f"joint{i + 1}" for i in range(plan.approach.q.shape[1]))


def _phase_spans(plan: Plan) -> Spans:
    """Spans of the phases among the samples of the whole plan."""
    spans, first = {}, 0
    for name, phase in plan.phases.items():
        spans[name] = (first, first + len(phase.t) - 1)
        first = spans[name][1]
    return spans


def _require_writable(plan: Plan) -> None:
    """Refuses a plan that could not be read again.

    Raises:
        InvalidInputError: samples are not evenly spaced or not finite.
    """
    whole, rate = plan.whole, plan.approach.rate
    if not np.isfinite([whole.q, whole.v, whole.a]).all():
        raise InvalidInputError("the plan has samples that are not finite, so it cannot be written")
    for name, phase in plan.phases.items():
        if not np.allclose(
            phase.t, np.arange(len(phase.t)) / rate, rtol=0.0, atol=1.0 / NANOSECONDS_PER_SECOND
        ):
            raise InvalidInputError(f"phase {name!r} is not sampled at {rate:g} Hz")


def _plan_metadata(plan: Plan) -> dict[str, Any]:
    """JSON values of a plan without its samples."""
    return {
        "format": PLAN_FORMAT,
        "version": PLAN_VERSION,
        "burg_drake": burg_drake.__version__,
        "origin": _origin_data(plan.origin) if plan.origin else None,
        "hand": {
            name: _finite_or_none(getattr(plan, name))
            for name in ("opening", "width", "close_time")
        },
        "rate": plan.approach.rate,
    }


def _require_plan_version(data: Any, path: str | Path) -> None:
    """Refuses data that is not a plan, or has another version.

    Raises:
        InvalidInputError: the format or the version is another one.
    """
    if not isinstance(data, dict) or data.get("format") != PLAN_FORMAT:
        raise InvalidInputError(f"{path} is not a plan: its format is not {PLAN_FORMAT!r}")
    if data.get("version") != PLAN_VERSION:
        raise InvalidInputError(
            f"{path} has version {quote_value(data.get('version'))}; this release reads"
            f" {PLAN_VERSION}"
        )


@contextmanager
def _document_part(document: Mapping[str, Any], name: str) -> Iterator[Any]:
    """Yields a part of a document; read errors in the block become errors that name the part."""
    try:
        yield document[name]
    except BurgError:
        raise
    except READ_ERRORS as error:
        raise InvalidInputError(f"{name!r} is missing or was changed") from error


def _read_plan_description(document: Mapping[str, Any], joints: tuple[str, ...]) -> PlanDescription:
    """Reads the result of `_plan_metadata`.

    Raises:
        InvalidInputError: it is damaged, or for other joints.
    """
    with _document_part(document, "hand") as hand:
        opening, width = (
            np.nan if hand[name] is None else float(hand[name]) for name in ("opening", "width")
        )
        if min(opening, width) < 0.0 or np.inf in (opening, width):
            raise ValueError(hand)
        close_time = float(hand["close_time"])
    with _document_part(document, "rate") as rate:
        if not 0.0 < rate < np.inf:
            raise ValueError(rate)
    origin = None
    if document.get("origin") is not None:
        with _document_part(document, "origin") as data:
            origin = _read_origin(data, joints)
    return PlanDescription(rate, opening, width, close_time, origin)


def _assemble_plan(
    description: PlanDescription, t: Array, spans: Spans, rows: Sequence[Array]
) -> Plan:
    """Assembles a plan and checks its consistency.

    Args:
        description: the plan's metadata.
        t: (T,) times of the samples [s].
        spans: spans of the phases.
        rows: positions, velocities and accelerations, (T, n) each.

    Raises:
        InvalidInputError: times, phases or positions are inconsistent, or exceed the limits.
    """
    time_tolerance = 1.0  # Nanoseconds.
    exact = np.arange(len(t)) / description.rate
    apart = ~(np.abs(exact - t) * NANOSECONDS_PER_SECOND <= time_tolerance)
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
    plan = Plan(
        **{name: trajectory for name, trajectory in parts.items() if name != "close"},
        close_time=description.close_time,
        opening=description.opening,
        width=description.width,
        origin=description.origin,
    )
    _require_rest(parts, plan)
    if description.origin is not None:
        _require_limits_kept(plan.whole, description.origin)
    return plan


def _require_spans(spans: Spans, count: int) -> None:
    """Requires that the phases cover all samples in order and without gaps."""
    missing = [name for name in MOTION_PHASES if name not in spans and name != "retreat"]
    if missing:
        raise InvalidInputError(f"phase {missing[0]!r} is missing")
    end = 0
    for name in (phase for phase in MOTION_PHASES if phase in spans):
        first, last = spans[name]
        complete = name != MOTION_PHASES[-1] or last == count - 1
        if not (first == end < last < count and complete):
            wanted = (
                "to a later one" if name != MOTION_PHASES[-1] else f"to the last one, {count - 1}"
            )
            raise InvalidInputError(
                f"phase {name!r} has points {first} to {last}; it must go from point {end} {wanted}"
            )
        end = last


def _require_rest(parts: Mapping[str, Trajectory], plan: Plan) -> None:
    """Requires that the arm rests between the phases, and while the hand closes."""
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


def _require_limits_kept(whole: Trajectory, origin: PlanOrigin) -> None:
    """Requires that every joint keeps its limits."""
    limit_tolerance = 1e-5  # Radians, or relative. The timing needs less.
    limits = origin.limits
    outside = (whole.q < limits.lower - limit_tolerance) | (
        whole.q > limits.upper + limit_tolerance
    )
    if outside.any():
        row, joint = np.argwhere(outside)[0]
        raise InvalidInputError(
            f"point {row} has joint {origin.joints[joint]!r} at {whole.q[row, joint]:.4f}, outside"
            f" its limits {limits.lower[joint]:.4f} to {limits.upper[joint]:.4f}"
        )
    with suppress_numpy_warnings():  # numbers of a damaged file may be huge
        peaks = whole.peaks()
    for name, peak in zip(("velocity", "acceleration", "jerk"), peaks, strict=True):
        limit = getattr(limits, name)
        if (peak > limit * (1.0 + limit_tolerance)).any():
            joint = int((peak / limit).argmax())
            raise InvalidInputError(
                f"the {name} of joint {origin.joints[joint]!r} reaches {peak[joint]:.4g}, above"
                f" its limit of {limit[joint]:.4g}"
            )


def _finite_or_none(value: float) -> float | None:
    """The value for JSON, which has no infinity and no NaN; None instead."""
    return float(value) if np.isfinite(value) else None


def _origin_data(origin: PlanOrigin) -> dict[str, Any]:
    data: dict[str, Any] = {
        f.name: getattr(origin, f.name)
        for f in fields(origin)
        if f.name not in ("joints", "limits", "X_WG")
    }
    limits = {
        f.name: [_finite_or_none(value) for value in getattr(origin.limits, f.name)]
        for f in fields(origin.limits)
    }
    return data | {"X_WG": origin.X_WG.tolist(), "limits": limits}


def _read_origin(data: dict[str, Any], joints: tuple[str, ...]) -> PlanOrigin:
    from burg_drake.motion.joint_limits import ArmLimits  # imports Drake

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


def _read_json(path: Path) -> Plan:
    """Reads a JSON plan.

    Raises:
        InvalidInputError: see `load_plan`.
    """
    try:
        document = load_json(path, FileLimits.grasp_file)
    except DocumentError as error:
        raise DocumentError(
            f"{error}; give a file that Plan.to_json or Plan.to_csv wrote"
        ) from error
    _require_plan_version(document, path)
    try:
        return _plan_from_document(document)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: the plan is damaged: {error}; write it again") from error


def _plan_from_document(document: dict[str, Any]) -> Plan:
    with _document_part(document, "joint_trajectory") as motion:
        joints = tuple(str(name) for name in motion["joint_names"])
        rows = _read_points(motion["points"], len(joints))
        stamps = [point["time_from_start"] for point in motion["points"]]
        t = np.array(
            [stamp["sec"] + stamp["nanosec"] / NANOSECONDS_PER_SECOND for stamp in stamps],
            dtype=float,
        )
    description = _read_plan_description(document, joints)
    with _document_part(document, "phases") as phases:
        spans: Spans = {name: (first, last) for name, (first, last) in phases.items()}
        if spans.keys() - set(MOTION_PHASES):
            raise KeyError(spans)
        return _assemble_plan(description, t, spans, rows)


def _read_points(points: list[dict[str, Any]], n: int) -> list[Array]:
    """Positions, velocities and accelerations, (T, n) each."""
    found = []
    for name in ("positions", "velocities", "accelerations"):
        for k, point in enumerate(points):
            if len(point[name]) != n or not np.isfinite(point[name]).all():
                raise InvalidInputError(f"{name} of point {k} must be {n} finite numbers")
        found.append(np.array([point[name] for point in points], dtype=float))
    return found


CsvRows = Sequence[tuple[int, list[str]]]
"""Line numbers and cells of the samples."""
JOINT_COLUMNS = {
    "q": ("rad", "position of joint {}; m of a joint that slides"),
    "v": ("rad/s", "velocity of joint {}; m/s of a joint that slides"),
    "a": ("rad/s2", "acceleration of joint {}; m/s2 of a joint that slides"),
}
"""Unit and meaning of a joint's columns, by the first letter of their names."""


def _read_csv(path: Path) -> Plan:
    """Reads a CSV plan; without its metadata file the plan has no origin.

    Raises:
        InvalidInputError: see `load_plan`.
    """
    rows = read_rows(path, FileLimits.grasp_file)
    header = rows.pop(0)[1] if rows else []
    joints = tuple(name[2:] for name in header if name.startswith("q_"))
    if not joints or header != list(_column_meanings(joints)):
        raise InvalidInputError(
            f"{path} is not a plan: it must have the columns t, phase, q_JOINT, v_JOINT, a_JOINT,"
            " width"
        )
    beside = metadata_path(path)
    try:
        data = _read_csv_metadata(beside, header) if beside.exists() else None
        return _plan_from_rows(rows, joints, data)
    except InvalidInputError as error:
        if str(beside) in str(error):
            raise
        raise InvalidInputError(f"{path}: the plan is damaged: {error}; write it again") from error


def _read_csv_metadata(path: Path, header: Sequence[str]) -> dict[str, Any]:
    """Reads the plan's metadata from the file next to a table."""
    document = load_json(path)
    try:
        (data,) = document["notes"]
        titles = [column["titles"] for column in document["tableSchema"]["columns"]]
    except READ_ERRORS as error:
        raise InvalidInputError(f"{path} does not describe a plan; write the plan again") from error
    if titles != list(header):
        raise InvalidInputError(
            f"{path} describes a table with other columns; write the plan again"
        )
    _require_plan_version(data, path)
    return dict(data)


def _plan_from_rows(rows: CsvRows, joints: tuple[str, ...], data: Any) -> Plan:
    n = len(joints)
    for line, row in rows:
        if len(row) != 3 * n + 3:
            raise InvalidInputError(f"line {line} has {len(row)} cells; expected {3 * n + 3}")
    spans = _read_spans(rows)
    t = np.array([_parse_number(row[0], "t", line) for line, row in rows])
    names = [f"{kind}_{joint}" for kind in JOINT_COLUMNS for joint in joints]
    values = np.empty((len(rows), 3 * n))
    for k, (line, row) in enumerate(rows):
        try:
            values[k] = row[2:-1]
        except ValueError:
            values[k] = [_parse_number(c, m, line) for c, m in zip(row[2:-1], names, strict=True)]
    if not np.isfinite(values).all():
        k, column = np.argwhere(~np.isfinite(values))[0]
        raise InvalidInputError(f"{names[column]} in line {rows[k][0]} is not a finite number")
    q, v, a = np.hsplit(values, 3)
    if data is None:
        data = _describe_by_rows(rows, t, spans)
    plan = _assemble_plan(_read_plan_description(data, joints), t, spans, (q, v, a))
    _require_widths(plan, rows)
    return plan


def _require_widths(plan: Plan, rows: CsvRows) -> None:
    """Requires that all rows have the open width before the hand closes, and the target's after."""
    for line, (_, phase, *_, text) in rows:
        wanted = _width_cell(plan, phase)
        if text == wanted:
            continue
        # Other programs may round off a micrometre.
        if not (wanted and abs(_parse_number(text, "width", line) - float(wanted)) <= 1e-6):
            raise InvalidInputError(
                f"width in line {line} is {quote_value(text)}; in phase {phase!r} of this plan it"
                f" is {quote_value(wanted)}"
            )


def _read_spans(rows: CsvRows) -> dict[str, tuple[int, int]]:
    """First and last row of each phase."""
    spans: dict[str, tuple[int, int]] = {}
    for k, (line, row) in enumerate(rows):
        name = row[1]
        if name not in MOTION_PHASES:
            raise InvalidInputError(
                f"line {line} has phase {quote_value(name)}; expected one of"
                f" {', '.join(MOTION_PHASES)}"
            )
        if name in spans and spans[name][1] != k - 1:
            raise InvalidInputError(f"phase {name!r} starts a second time in line {line}")
        spans[name] = (spans[name][0] if name in spans else max(0, k - 1), k)
    return spans


def _describe_by_rows(rows: CsvRows, t: Array, spans: dict[str, tuple[int, int]]) -> dict[str, Any]:
    """Metadata of a plan that follow from its table alone."""
    step = float(t[1]) if len(t) > 1 else 0.0
    if not step > 0.0:
        raise InvalidInputError("the times t do not increase from 0")
    near = round(1.0 / step, 6)
    first, last = spans.get("close", (0, 0))
    widths = [_parse_number(r[-1], "width", n) if r[-1] else None for n, r in (rows[0], rows[-1])]
    rate = near if near and 1.0 / near == step else 1.0 / step
    hand = {"opening": widths[0], "width": widths[1] or None, "close_time": (last - first) / rate}
    return {"rate": rate, "hand": hand, "origin": None}


def _parse_number(text: str, name: str, line: int) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError(
            f"{name} in line {line} is {quote_value(text)}, which is not a number"
        ) from error


def _width_cell(plan: Plan, phase: str) -> str:
    """Commanded distance between the pads [m]; empty if the hand's opening is unknown."""
    width = plan.width if _is_hand_closed(phase) else plan.opening
    if np.isnan(width):
        return "0.0" if _is_hand_closed(phase) else ""
    return repr(float(width))


def _column_meanings(joints: Sequence[str]) -> dict[str, tuple[str, Column]]:
    """Datatype, unit and meaning of each column."""
    moves = {
        f"{kind}_{joint}": ("double", Column(unit, text.format(joint)))
        for kind, (unit, text) in JOINT_COLUMNS.items()
        for joint in joints
    }
    return {
        "t": ("double", Column("s", "time since the plan's beginning")),
        "phase": ("string", Column(TEXT_UNIT, f"one of {', '.join(MOTION_PHASES)}")),
        **moves,
        "width": ("double", Column("m", "wanted distance between the pads; 0: closed")),
    }


def _quote_cell(text: str) -> str:
    """A text of the header, quoted if needed."""
    quotes = any(sign in text for sign in ',"\n\r')
    return '"' + text.replace('"', '""') + '"' if quotes else text


def format_rows(values: Array, separator: str = ",") -> list[str]:
    """Each row of finite numbers (T, n) as text, which reads back bit by bit.

    Rows on the grid, see `round_to_grid`, are plain decimals; others are Python's `repr`.
    """
    on_grid = (np.abs(values) <= 9000.0) & (round_to_grid(values) == values)
    on_grid &= (values != 0.0) | ~np.signbit(values)
    rows = zip(values.tolist(), on_grid.all(axis=1).tolist(), strict=True)
    return [separator.join(map(_decimal_text if plain else repr, row)) for row, plain in rows]


def _decimal_text(value: float) -> str:
    text = f"{value:.12f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text
