"""Robustness as a table: one row a grasp.

    id, instance, object      which grasp on what
    tug_+x_g ... tug_-z_g     largest steady acceleration that the grip bears along each direction
                              of the grasp frame G, in units of g; `inf` beyond what was tried
    tug_+x_N ... tug_-z_N     the same as a force on the centre of mass [N]
    shake_x_g ... shake_z_g   largest amplitude of an oscillating acceleration [g]
    friction_min              smallest coefficient that lifts; 0 below what was tried
    friction                  the library's coefficient
    repeats, lifted           perturbed repeats, and how many of them lifted
    success, success_low, success_high   their share, with Wilson's 95 % interval
    n_OUTCOME                 how many of them ended so
    failed                    tests that could not be simulated
    engine, seed, settings    how it was tested
    run                       short hash of the run that the grasps are of

What was never asked for is an empty cell. Answers that earlier calls got with the same settings
stay in the table, further perturbed repeats among them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from operator import itemgetter
from typing import TypeVar

import numpy as np

from burg_drake.core.grasps import Outcome, Stage
from burg_drake.core.terminal import TextTable, format_number
from burg_drake.evaluation.records import Columns, engine_label, pairs_text
from burg_drake.evaluation.robustness.probe_answer import ProbeAnswer
from burg_drake.evaluation.robustness.settings import (
    RobustnessSettings,
)
from burg_drake.simulation.robustness import AXES, DIRECTIONS, HoldForces, SuccessRate
from burg_drake.station.document import Engine

T = TypeVar("T")

OF_HANDS = tuple(o for o in Outcome if o.stage in (Stage.CLEAR, Stage.EXECUTED))
"""What becomes of a grasp that no arm is asked about."""


@dataclass(frozen=True)
class GraspRobustness:
    """What is known of one grasp.

    Attributes:
        id, instance, object: which grasp on what.
        friction: the target's coefficient.
        tug, shake: what the grip bears; None if not asked or failed.
        friction_min: smallest coefficient that lifts; None if not asked or failed.
        success: of the perturbed repeats; None if not asked.
        failed: tests that could not be simulated, each once; perturbed repeats are counted by
            outcome instead.
    """

    id: str
    instance: str
    object: str
    friction: float
    tug: HoldForces | None = None
    shake: HoldForces | None = None
    friction_min: float | None = None
    success: SuccessRate | None = None
    failed: tuple[str, ...] = ()


def gathered(
    id: str, instance: str, object: str, friction: float, answers: Sequence[ProbeAnswer]
) -> GraspRobustness:
    """What the answers to the probes of a grasp say of it; see `GraspRobustness`."""
    by_test = {answer.test: answer for answer in answers if answer.test != "noise"}
    repeats = Counter(
        answer.outcome
        for answer in answers
        if answer.test == "noise" and answer.outcome is not None
    )
    tug, shake, friction_min = (by_test.get(test) for test in ("tug", "shake", "friction"))
    return GraspRobustness(
        id,
        instance,
        object,
        friction,
        tug=tug.forces if tug else None,
        shake=shake.forces if shake else None,
        friction_min=friction_min.friction if friction_min else None,
        success=SuccessRate(repeats) if repeats else None,
        failed=tuple(test for test, answer in by_test.items() if answer.failed),
    )


def robustness_columns(
    grasps: Sequence[GraspRobustness],
    settings: RobustnessSettings,
    engines: Sequence[Engine],
    run: str,
) -> Columns:
    """The table; `engines` are those of the grasps."""
    columns: Columns = {
        name: np.array([getattr(g, name) for g in grasps], dtype=np.str_)
        for name in ("id", "instance", "object")
    }
    tugs = [None if g.tug is None else g.tug.accelerations for g in grasps]
    forces = [None if g.tug is None else g.tug.forces for g in grasps]
    shakes = [None if g.shake is None else g.shake.accelerations for g in grasps]
    columns |= {f"tug_{name}_g": _column(tugs, itemgetter(name)) for name in DIRECTIONS}
    columns |= {f"tug_{name}_N": _column(forces, itemgetter(name)) for name in DIRECTIONS}
    columns |= {f"shake_{name}_g": _column(shakes, itemgetter(name)) for name in AXES}
    columns["friction_min"] = _column([g.friction_min for g in grasps], float)
    columns["friction"] = np.array([g.friction for g in grasps], dtype=float)
    rates = [g.success for g in grasps]
    columns["repeats"] = _counts(rates, lambda r: r.trials)
    columns["lifted"] = _counts(rates, lambda r: r.lifted)
    columns["success"] = _column(rates, lambda r: r.probability)
    columns["success_low"] = _column(rates, lambda r: r.interval[0])
    columns["success_high"] = _column(rates, lambda r: r.interval[1])
    counts = [None if rate is None else rate.outcomes for rate in rates]
    columns |= {f"n_{outcome}": _counts(counts, itemgetter(outcome)) for outcome in OF_HANDS}
    columns["failed"] = np.array([" ".join(g.failed) for g in grasps], dtype=np.str_)
    columns["engine"] = np.array([engine_label(engine) for engine in engines], dtype=np.str_)
    columns["seed"] = np.full(len(grasps), settings.seed, dtype=np.int64)
    columns["settings"] = np.array([_settings_text(settings)] * len(grasps), dtype=np.str_)
    columns["run"] = np.array([run] * len(grasps), dtype=np.str_)
    return columns


def _settings_text(settings: RobustnessSettings) -> str:
    return pairs_text(
        {
            f"{group}.{name}": value
            for group in ("loads", "friction", "noise")
            for name, value in asdict(getattr(settings, group)).items()
        }
    )


def robustness_view(grasps: Sequence[GraspRobustness], settings: RobustnessSettings) -> TextTable:
    """The table for a terminal: weakest directions, friction and success."""
    table = TextTable("Robustness of lifted grasps", caption=_caption(settings)).texts("grasp")
    heads = {"tug": "tug", "shake": "shake", "friction": "least mu", "noise": "success"}
    table.numbers(*(heads[test] for test in settings.tests))
    if "noise" in settings.tests:
        table.numbers("95 % CI")
    largest = settings.loads.largest
    for g in grasps:
        cells = {
            "tug": _weakest(g.tug, largest),
            "shake": _weakest(g.shake, largest),
            "friction": _friction(g, settings),
            "noise": "-" if g.success is None else f"{g.success.lifted} of {g.success.trials}",
        }
        row = [cells[test] for test in settings.tests]
        if "noise" in settings.tests:
            low, high = (0.0, 1.0) if g.success is None else g.success.interval
            row.append(f"{100 * low:.0f}-{100 * high:.0f} %")
        table.row(g.id, *row)
    return table


def _weakest(forces: HoldForces | None, largest: float) -> str:
    if forces is None:
        return "-"
    name, value = forces.weakest
    return f"> {largest:g} g   " if math.isinf(value) else f"{format_number(value, 1)} g {name:>2}"


def _friction(grasp: GraspRobustness, settings: RobustnessSettings) -> str:
    if grasp.friction_min is None:
        return "-"
    if grasp.friction_min == 0.0:
        return f"< {settings.friction.smallest:g}"
    if math.isinf(grasp.friction_min):
        return f"> {settings.friction.largest:g}"
    return f"{format_number(grasp.friction_min, 3)} of {format_number(grasp.friction)}"


def _caption(settings: RobustnessSettings) -> str:
    parts = []
    if {"tug", "shake"} & set(settings.tests):
        parts.append(
            "tug, shake: acceleration withstood along the weakest direction of the grasp frame"
            " (x closing, z approach), in g = 9.81 m/s²"
        )
    if "friction" in settings.tests:
        parts.append("least mu: smallest friction coefficient that lifts, and the object's own")
    if "noise" in settings.tests:
        noise = settings.noise
        parts.append(
            f"success: lifted of the repeats with deviations of"
            f" {noise.translation * 1e3:g} mm, {math.degrees(noise.rotation):g} deg,"
            f" mass {100 * noise.mass:g} %, friction {100 * noise.friction:g} %"
        )
    return "\n".join(parts)


def _counts(values: Sequence[T | None], count: Callable[[T], int]) -> np.ndarray:
    """A whole number of each value, None where there is none."""
    return np.array([None if v is None else count(v) for v in values], dtype=object)


def _column(values: Sequence[T | None], number: Callable[[T], float]) -> np.ndarray:
    """A number of each value, NaN where there is none."""
    return np.array([math.nan if v is None else number(v) for v in values], dtype=float)
