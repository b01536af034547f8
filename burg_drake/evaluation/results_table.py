"""The results table, one row per trial: makes its columns, reads trials back, and ranks rows."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    CONTESTED_CONFIDENCE,
    INPUT_PREFIX,
    Array,
    InvalidInputError,
    MarginNames,
    Outcome,
    RecordedFields,
    Stage,
    TableShape,
    UnknownNameError,
    Verdict,
    VerdictPart,
    check_pose,
    fields_of_part,
    list_names,
    quaternion_from_rotation,
    quote_value,
)
from burg_drake.evaluation.candidates import Candidate, Candidates, rows_of_names
from burg_drake.evaluation.trial_origin import ORIGIN_TEXT, TrialOrigin, engine_label, read_choice


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedTrial:
    """A grasp and its verdict.

    Attributes:
        id: id of the grasp, or of this trial of it.
        instance: name of the target in the scene.
        object: name of the target in the library.
        X_OG: (4, 4) grasp in the target's frame.
        width: distance between the contacts [m].
        score: score of the sampler.
        friction: friction coefficient of the target; None for the library's.
        mass: mass of the target [kg]; None for the library's.
        verdict: the verdict; None if the grasp is not judged.
    """

    id: str
    instance: str
    object: str = ""
    X_OG: Array
    width: float = math.nan
    score: float = math.nan
    friction: float | None = None
    mass: float | None = None
    verdict: Verdict | None = None

    @property
    def lift(self) -> float | None:
        """Length of the executed lift [m]; None if unknown, as in rows of older releases."""
        margins = {} if self.verdict is None else self.verdict.margins
        height = margins.get(MarginNames.lift_height, math.nan)
        return None if math.isnan(height) else height

    @property
    def candidate(self) -> Candidate:
        """The grasp as a judge takes it."""
        grasp = (self.id, self.instance, self.X_OG, self.friction, self.mass)
        return Candidate(*grasp, width=self.width, lift=self.lift)


def pose_text(X_OG: Array) -> str:
    """Upper three rows of a pose (4, 4) as 12 numbers; every bit is kept."""
    return " ".join(map(repr, X_OG[:3].ravel().tolist()))


def pose_from_text(text: str, where: str) -> Array:
    """Reads a pose (4, 4) that `pose_text` wrote.

    Raises:
        InvalidInputError: the text is not such a pose.
    """
    numbers = []
    expected = "it must be the 12 numbers of the upper three rows of the pose"
    for word in text.split():
        try:
            numbers.append(float(word))
        except ValueError as error:
            raise InvalidInputError(
                f"{where}: X_OG contains {quote_value(word)}; {expected}"
            ) from error
    if len(numbers) != 12:
        raise InvalidInputError(f"{where}: X_OG has {len(numbers)} numbers; {expected}")
    upper = np.array(numbers).reshape(3, 4)
    return check_pose(np.vstack([upper, (0.0, 0.0, 0.0, 1.0)]), f"{where}: X_OG")


def read_trial(row: Mapping[str, Any], where: str) -> RecordedTrial:
    """Reads the trial in a row of a table.

    Args:
        row: cells by column.
        where: name of the row, for messages.

    Raises:
        InvalidInputError: columns are missing, or a cell cannot be read.
    """
    # Columns without which a row cannot be executed again.
    needed = ("id", "instance", "outcome", "stage", "X_OG", "engine", *ORIGIN_TEXT)
    missing = [name for name in needed if name not in row]
    if missing:
        raise InvalidInputError(
            f"{where}: column {', '.join(missing)} is missing (older releases did not"
            " write it), so this row cannot be replayed by itself; give the folder of"
            " its run"
        )
    empty = [name for name in needed if row[name] == ""]
    if empty:
        raise InvalidInputError(
            f"{where}: {', '.join(empty)} is empty, without which a row alone cannot be replayed;"
            " give the folder of its run"
        )
    outcome = read_choice(row["outcome"], tuple(Outcome), f"{where}: outcome")
    stage = read_choice(row["stage"], tuple(Stage), f"{where}: stage")
    findings = {one.name: one.from_row(row) for one in RecordedFields.trial}
    return RecordedTrial(
        id=row["id"],
        instance=row["instance"],
        object=row.get("object", ""),
        X_OG=pose_from_text(row["X_OG"], where),
        width=_read_number(row, "width", where),
        friction=_read_property(row, "friction", where),
        mass=_read_property(row, "mass", where),
        verdict=Verdict(outcome, stage, **findings),
    )


def _read_property(row: Mapping[str, Any], name: str, where: str) -> float | None:
    """Reads a property that replaces the library's; None if the cell is empty or missing."""
    max_value = 1e6  # Of mass [kg] and friction; larger ones cannot be simulated.
    value = _read_number(row, name, where)
    if math.isnan(value):
        return None
    if value < 0.0 or value > max_value or (name == "mass" and value == 0.0):
        raise InvalidInputError(
            f"{where}: {name} is {value:g}; it must be above 0 and at most {max_value:g}"
        )
    return value


def _read_number(row: Mapping[str, Any], name: str, where: str) -> float:
    """Reads a number; NaN if the column is missing."""
    value = row.get(name, math.nan)
    try:
        return float(value)
    except ValueError as error:
        raise InvalidInputError(f"{where}: {name} is {quote_value(value)}, not a number") from error


T = TypeVar("T")
ColumnValues = NDArray[Any]
Columns = dict[str, ColumnValues]

TEXT_COLUMNS = (
    *("id", "instance", "object"),
    *(one.name for one in RecordedFields.verdict if one.is_text),
    *("engine", "run"),
    *ORIGIN_TEXT,
    "X_OG",
)
"""Names of the columns that hold texts."""


class TextValues(NamedTuple):
    """A column of texts that stores each distinct text once.

    Attributes:
        codes: (N,) index of each row's text in `names`.
        names: the texts.
    """

    codes: NDArray[Any]
    names: Sequence[str]

    def equal(self, text: str) -> NDArray[np.bool_]:
        """(N,) whether each row has this text."""
        equal: NDArray[np.bool_] = self.codes == self.code_of(text)
        return equal

    def code_of(self, text: str) -> int:
        """Code of a text; -1 if it does not occur."""
        return self.names.index(text) if text in self.names else -1

    def most_common(self, rows: NDArray[np.int64], most: int) -> tuple[tuple[str, int], ...]:
        """The `most` most frequent texts of some rows (M,), with counts; without empty texts."""
        counts = np.bincount(self.codes[rows], minlength=len(self.names))
        ranked = np.argsort(-counts, kind="stable").tolist()
        found = [(self.names[k], int(counts[k])) for k in ranked if counts[k] and self.names[k]]
        return tuple(found[:most])


def code_texts(values: NDArray[np.str_]) -> TextValues:
    """Encodes a column (N,) of few distinct texts."""
    texts = values.tolist()
    code_of_text = {text: code for code, text in enumerate(dict.fromkeys(texts))}
    codes = np.fromiter(map(code_of_text.__getitem__, texts), dtype=np.int64, count=len(texts))
    return TextValues(codes, tuple(code_of_text))


def make_columns(
    candidates: Candidates,
    rows: NDArray[np.int64],
    verdicts: Sequence[Verdict],
    origin: TrialOrigin,
    *,
    instances: Sequence[str],
    joints: int = 0,
) -> Columns:
    """Makes the table of judged grasps.

    Args:
        candidates: all grasps of a run.
        rows: (N,) rows of the judged candidates.
        verdicts: verdict of each judged candidate.
        origin: scene, station, engine and settings of the trials.
        instances: names of the scene's free objects.
        joints: number of the arm's joints, 0 without an arm.
    """
    grasps = grasp_columns(candidates, rows)
    return arrange_columns(grasps, verdicts, origin, instances=instances, joints=joints)


def grasp_columns(
    candidates: Candidates, rows: NDArray[np.int64], names: Sequence[str] | None = None
) -> Columns:
    """Columns of `make_columns` that do not depend on verdicts; all if `names` is None."""
    grasps = candidates.grasps
    X_OG = grasps.X_OG[rows]
    poses: Columns = {}

    def pose_column(name: str) -> ColumnValues:
        poses.update(poses or pose_columns(X_OG))
        return poses[name]

    def input_column(name: str) -> ColumnValues:
        values = grasps.columns[name][rows]
        # booleans become 1 and 0, which every reader takes for numbers
        return values.astype(np.int64) if values.dtype.kind == "b" else values

    known: dict[str, Callable[[], ColumnValues]] = {
        "id": lambda: _text_column([candidates.id[row] for row in rows.tolist()]),
        "instance": lambda: _text_column(candidates.instance[rows].tolist()),
        "object": lambda: _text_column(grasps.object[rows].tolist()),
        "width": lambda: grasps.width[rows],
        "score": lambda: grasps.score[rows],
        **{name: partial(pose_column, name) for name in ("x", "y", "z", "qw", "qx", "qy", "qz")},
        "X_OG": lambda: _text_column([pose_text(X) for X in X_OG]),
        **{INPUT_PREFIX + name: partial(input_column, name) for name in grasps.columns},
    }
    friction = candidates.friction
    if friction is not None:
        known["friction"] = lambda: friction[rows]
    return {name: known[name]() for name in names or known}


def trial_columns(
    trials: Sequence[RecordedTrial],
    origin: TrialOrigin,
    *,
    instances: Sequence[str],
    joints: int = 0,
) -> Columns:
    """Makes the table of judged trials; see `make_columns`. Their ids need not be unique."""
    rows = [t.verdict for t in trials if t.verdict is not None]
    if len(rows) != len(trials):
        raise ValueError("a table is made of judged trials only")
    numbers = ("width", "score", "friction", "mass")
    grasps: Columns = {
        **{n: _text_column([getattr(t, n) for t in trials]) for n in ("id", "instance", "object")},
        **{n: _number_column([getattr(t, n) for t in trials]) for n in numbers},
        **pose_columns(np.array([t.X_OG for t in trials]).reshape(-1, 4, 4)),
        "X_OG": _text_column([pose_text(t.X_OG) for t in trials]),
    }
    return arrange_columns(grasps, rows, origin, instances=instances, joints=joints)


def arrange_columns(
    grasps: Mapping[str, T],
    verdicts: Sequence[Verdict],
    origin: TrialOrigin,
    *,
    instances: Sequence[str],
    joints: int,
) -> dict[str, T | ColumnValues]:
    """Arranges the columns of a table in their order.

    Args:
        grasps: columns of N grasps by the names of `grasp_columns`, and `friction` and `mass` if
            they are not the library's.
        verdicts: verdict of each grasp.
        origin, instances, joints: see `make_columns`.
    """
    approach = bool(origin.trial.get("approach"))
    shape = TableShape(origin.mode, instances, joints, approach)
    count = len(verdicts)
    judges = [verdict.judged_again for verdict in verdicts]
    origins = {name: origin.judged_by(name) for name in {*judges, ""}}
    labels = {name: engine_label(one.engine) for name, one in origins.items()}
    cells = {name: one.cells() for name, one in origins.items()}
    texts = {name: {judge: cells[judge][name] for judge in cells} for name in ORIGIN_TEXT}
    properties = ("friction", "mass")
    named = ("id", "instance", "object", "X_OG", *properties)
    return {
        **{name: grasps[name] for name in named[:3]},
        **columns_of_verdicts(verdicts, "decided", shape),
        **{n: v for n, v in grasps.items() if n not in named and not n.startswith(INPUT_PREFIX)},
        **columns_of_verdicts(verdicts, "measured", shape),
        **{name: grasps.get(name, np.full(count, np.nan)) for name in properties},
        **columns_of_verdicts(verdicts, "posture", shape),
        "seed": np.full(count, origin.seed, dtype=np.int64),
        "engine": _judge_column(labels, judges),
        "run": _constant_column(origin.run, count),
        **columns_of_verdicts(verdicts, "cost", shape),
        **{name: _judge_column(texts[name], judges) for name in ORIGIN_TEXT},
        "X_OG": grasps["X_OG"],
        **{name: values for name, values in grasps.items() if name.startswith(INPUT_PREFIX)},
    }


def pose_columns(X_OG: Array) -> Columns:
    """Position and quaternion columns of poses (N, 4, 4)."""
    wxyz = quaternion_from_rotation(X_OG[:, :3, :3]) if len(X_OG) else np.empty((0, 4))
    columns = {name: X_OG[:, k, 3] for k, name in enumerate("xyz")}
    return columns | {name: wxyz[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))}


def columns_of_verdicts(rows: Sequence[Verdict], part: VerdictPart, shape: TableShape) -> Columns:
    """Columns of verdicts that belong to one part of a row, see `TableShape`."""
    columns: Columns = {}
    for one in fields_of_part(shape, part):
        values = [getattr(verdict, one.name) for verdict in rows]
        make = _text_column if one.is_text else _number_column
        for name, key in one.columns(shape).items():
            columns[name] = make([one.cell(value, key) for value in values])
    return columns


def table_row(columns: Columns, index: int) -> dict[str, Any]:
    """One row as Python values by column."""
    return {name: values[index].item() for name, values in columns.items()}


def _text_column(values: Sequence[str]) -> NDArray[Any]:
    return np.array(values, dtype=np.str_)


def _constant_column(text: str, count: int) -> NDArray[Any]:
    """A column with the same text in all rows, which takes the memory of one cell."""
    return np.broadcast_to(np.array(text, dtype=np.str_), count)


def _judge_column(texts: Mapping[str, str], judges: Sequence[str]) -> NDArray[Any]:
    """A column with the text of each row's judge."""
    if len(set(texts.values())) == 1:
        return _constant_column(texts[""], len(judges))
    return _text_column([texts[judge] for judge in judges])


def _number_column(values: Sequence[float | None]) -> NDArray[Any]:
    return np.array([math.nan if value is None else value for value in values], dtype=float)


def contested_rows(confidence: Array, settled: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask (N,) of rows whose verdict is contested, by the rule of `Verdict.contested`.

    Args:
        confidence: (N,) confidence of each verdict; NaN if there is none.
        settled: (N,) whether another engine has judged the grasp again.
    """
    contested: NDArray[np.bool_] = (confidence < CONTESTED_CONFIDENCE) & ~settled  # not NaN
    return contested


RANKING_CLEARANCE_STEP = 5e-4
"""Metres; smaller differences in clearance do not rank grasps."""


def best_rows(
    columns: Mapping[str, ColumnValues],
    count: int = 1,
    *,
    each: bool = False,
    only: Iterable[str] | None = None,
) -> list[int]:
    """Indices of the most robust lifted grasps, best first; fewer if fewer were lifted.

    Ranked by the clearance of the open hand, in steps of 0.5 mm. Of all margins it best predicts
    how often a grasp is lifted if pose, mass and friction are perturbed, as in four of five
    failures the open hand then hits something: its rank correlation with that share is 0.6, that
    of any other margin is between -0.35 and 0.25 (`benchmarks/best.py`). Ties go to the smaller
    disturbance, slip / 5 mm + tilt / 0.1 rad + push of other objects / 10 mm, rounded to 0.1 mm and
    0.1 deg; then to the larger contact patch of the weaker pad, rounded to 1 mm2, to the higher
    score of the sampler, and by id. Contested grasps, and those without a known clearance, rank
    last; other unknown margins count as 0.

    Args:
        columns: a table of results.
        count: number of grasps.
        each: return `count` grasps of each object, in the order of the table.
        only: names of objects or instances; others are left out.

    Raises:
        UnknownNameError: the table has no such object or instance.
    """
    chosen = columns["outcome"] == Outcome.LIFTED
    if only:
        chosen &= rows_of_names(only, "the table", columns["object"], columns["instance"])
    lifted = np.flatnonzero(chosen)
    lifted = _clearest_rows(columns, lifted, count, each=each)
    clearance_steps = _clearance_steps(columns, lifted)
    penalty = (
        _round_to_step(columns["slip"][lifted], 1e-4) / 0.005
        + _round_to_step(columns["tilt"][lifted], float(np.deg2rad(0.1))) / 0.1
        + _round_to_step(columns["others_moved"][lifted], 1e-4) / 0.01
    )
    patch = _round_to_step(columns["patch_area"][lifted], 1e-6)
    score = np.nan_to_num(columns["score"][lifted], nan=-np.inf)
    # equal sums may differ in their last digits
    order = np.lexsort((columns["id"][lifted], -score, -patch, penalty.round(9), -clearance_steps))
    ranked = lifted[order].tolist()
    if not each:
        return [int(row) for row in ranked[:count]]
    objects = columns["object"]
    return [
        int(row)
        for name in dict.fromkeys(objects.tolist())
        for row in [row for row in ranked if objects[row] == name][:count]
    ]


def _clearance_steps(columns: Mapping[str, ColumnValues], rows: NDArray[np.int64]) -> Array:
    """Clearances of some rows in steps; lowered for contested grasps, so that they rank last."""
    max_steps = 1e6  # More steps of clearance than any grasp has.
    clearance = columns["clearance"][rows] if "clearance" in columns else np.zeros(len(rows))
    steps = np.nan_to_num(np.floor(clearance / RANKING_CLEARANCE_STEP + 1e-9), nan=-max_steps)
    if "confidence" not in columns or "judged_again" not in columns:  # of earlier releases
        return steps
    settled = columns["judged_again"][rows] != ""
    contested = contested_rows(columns["confidence"][rows], settled)
    return np.where(contested, steps - 2.0 * max_steps, steps)


def _clearest_rows(
    columns: Mapping[str, ColumnValues], rows: NDArray[np.int64], count: int, *, each: bool
) -> NDArray[np.int64]:
    """Rows whose clearance may rank them among the first `count`, overall or of each object.

    Saves the full ranking of the others, which takes seconds for a million rows.
    """
    groups = [rows]
    if each:
        objects = columns["object"][rows]
        groups = [rows[objects == name] for name in set(objects.tolist())]
    kept = []
    for mine in groups:
        steps = _clearance_steps(columns, mine)
        most = len(steps)
        least = np.partition(steps, most - count)[-count] if 0 < count < most else -np.inf
        kept.append(mine[steps >= least])
    return np.sort(np.concatenate(kept)) if kept else rows


def _round_to_step(values: Array, step: float) -> Array:
    """Rounds to the nearest multiple of a step; NaN becomes 0."""
    return np.nan_to_num(np.round(values / step) * step)


def rows_of(columns: Columns, id: str, where: str) -> list[int]:
    """Indices of the rows of one grasp, at least one.

    Raises:
        UnknownNameError: there is none; the message names the most similar ids.
    """
    ids = columns["id"].tolist()
    rows = [row for row, known in enumerate(ids) if known == id]
    if not rows:
        raise unknown_grasp_error(id, ids, where)
    return rows


def unknown_grasp_error(
    id: str, ids: Sequence[str], where: str, hint: str = ""
) -> UnknownNameError:
    """Error about an unknown id; names similar ids, if any."""
    min_similarity = 0.7  # Two grasps of one object have 0.43 on average.
    close = difflib.get_close_matches(id, ids, n=3, cutoff=min_similarity)
    known = f"did you mean {' or '.join(close)}?" if close else f"known: {list_names(ids)}"
    hint = f" ({hint})" if hint else ""
    return UnknownNameError(f"{where} has no judged grasp {id!r}; {known}{hint}")
