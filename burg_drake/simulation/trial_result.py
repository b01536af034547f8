"""The result of a trial: its outcome, its margins, and the confidence in the outcome.

The confidence is an additive logistic model of the margins and the load on the grip.

Confidence is the probability that an independent model of contact, with slightly different friction
and hand pose, finds the same: that the target is held to the end, or that it is lost. Each engine
has curves for held and for lost targets. `benchmarks/confidence.py` fits them on some objects,
writes `calibration.json`, and tests them on others. `Population` has the range of these objects.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from burg_drake.core import Array, Margins as Margins, Outcome, TrialFindings
from burg_drake.grasping import Clearance
from burg_drake.objects import ObjectEntry
from burg_drake.station import ENGINES, Engine


@dataclass(frozen=True, kw_only=True)
class TrialResult(TrialFindings):
    """One executed trial.

    Attributes:
        outcome: why it ended.
        margins: margins that a trial measures, see `Margins.of_trial`.
        on_cpu: whether `BatchTrial` executed it one by one on the CPU.
    """

    outcome: Outcome
    margins: Margins
    on_cpu: bool = False


def collision_result(screen: Clearance) -> TrialResult:
    """The result of a trial that did not start, as the open hand collides at the grasp or at the
    start of its approach."""
    assert screen.outcome is not None
    margins = Margins(overlap=screen.overlap, clearance=screen.clearance, end_time=0.0)
    return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)


def simulation_failure_result(
    error: BaseException, screen: Clearance, end_time: float
) -> TrialResult:
    """The result of a trial in which the simulator failed.

    Args:
        error: the simulator's error.
        screen: screen of the open hand at the grasp.
        end_time: simulated time of the failure [s].
    """
    return TrialResult(
        outcome=Outcome.SIMULATION_FAILED,
        margins=Margins(overlap=0.0, clearance=screen.clearance, end_time=end_time),
        reason=" ".join(str(error).split()),
    )


PAD_FRICTION_LEVER = 0.0066
"""Metres. Lever of a pad's friction torque; the confidence curves are fitted with it."""
MAX_LIMIT_DISTANCE = 0.4
"""Upper bound of `GripLoad.limit`, as a logarithm to base 10."""


@dataclass(frozen=True)
class GripLoad:
    """Load on a grip, and its friction and force.

    Attributes:
        friction: coefficient between pads and target.
        force: force of each finger [N].
        mass: mass of the target [kg].
        acceleration: acceleration of the lift [m/s^2].
        lever: distance of the centre of mass from the closing axis, seen along the vertical, across
            that axis [m].
    """

    friction: float
    force: float
    mass: float
    acceleration: float
    lever: float

    @classmethod
    def of(
        cls,
        X_WG: Array,
        p_WCm: Array,
        *,
        friction: float,
        force: float,
        mass: float,
        acceleration: float,
    ) -> GripLoad:
        """The load of a target at its pose in the scene.

        Args:
            X_WG: (4, 4) grasp in the world.
            p_WCm: (3,) centre of mass in the world [m].
            friction, force, mass, acceleration: see the attributes.
        """
        x, y, _ = (p_WCm - X_WG[:3, 3]).tolist()
        closing_x, closing_y, _ = X_WG[:3, 0].tolist()
        return cls(friction, force, mass, acceleration, abs(closing_y * x - closing_x * y))

    @property
    def carried(self) -> float:
        """Ratio of the load to the friction limit of two pads."""
        return self._share(self.mass * (9.81 + self.acceleration))

    @property
    def turned(self) -> float:
        """Ratio of the load's moment about the closing axis to its friction limit."""
        return self._share(self.mass * (9.81 + self.acceleration) * self.lever / PAD_FRICTION_LEVER)

    @property
    def limit(self) -> float:
        """Distance of the load from the friction limit: absolute value of the logarithm (base 10)
        of their ratio, at most `MAX_LIMIT_DISTANCE`.

        At its limit a load straight below the pads slides down. A load with a larger moment than
        pull swings until it hangs below the pads, and is held.
        """
        if self.turned > self.carried:
            return MAX_LIMIT_DISTANCE
        return min(
            MAX_LIMIT_DISTANCE, abs(math.log10(max(math.hypot(self.carried, self.turned), 1e-3)))
        )

    def _share(self, force: float) -> float:
        max_share = 20.0  # Larger ratios carry no more information.
        limit = 2.0 * self.friction * self.force
        return min(max_share, force / limit) if limit > 0.0 else max_share


def grip_signs(margins: Margins, load: GripLoad) -> Mapping[str, float]:
    """Inputs of the confidence model, by name; logarithms are to base 10.

    Args:
        margins: margins of a trial.
        load: load on its grip.

    Returns:
        `carried`, `turned`: logarithms of the ratios of load to friction limit; `limit`: see
        `GripLoad.limit`; `slip`, `tilt`: logarithms of the motion in the hand [m, rad];
        `patch_area`: square root [m]; `lift`: distance of the target along the hand's path [m].
        Values that were not measured, for lack of a grip, are 0.
    """

    min_slip = 1e-7  # Metres. Below this the target sticks.
    min_tilt = 1e-5  # Radians. Below this the target sticks.

    def measured(value: float) -> float:
        return value if math.isfinite(value) else 0.0

    return {
        "carried": math.log10(max(load.carried, 1e-3)),
        "turned": math.log10(max(load.turned, 1e-3)),
        "limit": load.limit,
        "slip": math.log10(max(measured(margins.slip), min_slip)),
        "tilt": math.log10(max(measured(margins.tilt), min_tilt)),
        "patch_area": math.sqrt(measured(margins.patch_area)),
        "lift": measured(margins.lift),
    }


CALIBRATION_FILE = Path(__file__).with_name("calibration.json")
"""Curves that `benchmarks/confidence.py` has fitted, and the population they were fitted on."""
OUTCOMES_WITHOUT_VERDICT = (Outcome.SIMULATION_FAILED,)
"""Outcomes without a verdict, for which confidence has no meaning."""


@dataclass(frozen=True)
class Curve:
    """A piecewise linear term of the logit, constant beyond its ends.

    Attributes:
        knots: values of the sign, ascending.
        logits: value of the term at each knot.
    """

    knots: Sequence[float]
    logits: Sequence[float]

    def at(self, value: float) -> float:
        """The term for a value of the sign."""
        if value <= self.knots[0]:
            return self.logits[0]
        if value >= self.knots[-1]:
            return self.logits[-1]
        k = bisect_right(self.knots, value)
        slope = (self.logits[k] - self.logits[k - 1]) / (self.knots[k] - self.knots[k - 1])
        return slope * (value - self.knots[k - 1]) + self.logits[k - 1]


Curves = Mapping[str, Curve]
"""Terms by sign; their sum is the logit of the confidence."""


def confidence(engine: Engine, outcome: Outcome, margins: Margins, load: GripLoad) -> float | None:
    """Confidence in the verdict of a trial.

    Args:
        engine: engine of the trial.
        outcome: outcome of the trial.
        margins: margins of the trial.
        load: load on its grip.

    Returns:
        Probability; None if no trial decided, or the engine is not a calibrated preset.
    """
    engine = engine.serial
    if ENGINES.get(engine.name) != engine:
        return None
    return confidence_from_signs(engine.name, outcome, grip_signs(margins, load))


def confidence_from_signs(
    engine: str, outcome: Outcome, signs: Mapping[str, float]
) -> float | None:
    """Confidence in a verdict from the values of `grip_signs`; None without a calibration.

    Args:
        engine: name of the preset.
        outcome: outcome of the trial.
        signs: values of `grip_signs`.
    """
    curves = calibration().get((engine, outcome.held))
    if curves is None or outcome in OUTCOMES_WITHOUT_VERDICT:
        return None
    logit = sum(curve.at(signs[name]) for name, curve in curves.items())
    return 1.0 / (1.0 + math.exp(-logit))


@cache
def calibration() -> Mapping[tuple[str, bool], Curves]:
    """The curves, by name of the engine and whether the target is held to the end."""
    return {
        (engine, held == "held"): {
            sign: Curve(tuple(curve["knots"]), tuple(curve["logits"]))
            for sign, curve in curves.items()
        }
        for engine, parts in _calibration_document()["engines"].items()
        for held, curves in parts.items()
    }


@cache
def _calibration_document() -> Mapping[str, Any]:
    content: Mapping[str, Any] = json.loads(CALIBRATION_FILE.read_text(encoding="utf-8"))
    return content


@dataclass(frozen=True, kw_only=True)
class Population:
    """Range of the objects that confidence was fitted on; extents are along the axes of O.

    Attributes:
        objects: number of objects.
        max_mass: mass of the heaviest object [kg].
        min_thickness: smallest extent of the thinnest object [m].
        min_length: largest extent of the smallest object [m].
        max_length: largest extent of the longest object [m].
    """

    objects: int
    max_mass: float
    min_thickness: float
    min_length: float
    max_length: float

    @classmethod
    def of_calibration(cls) -> Population:
        """The population of the calibration."""
        return cls(**_calibration_document()["population"])

    def __str__(self) -> str:
        return (
            f"objects of up to {self.max_mass:.3g} kg that are at least"
            f" {_millimetres(self.min_thickness)} thick and {1e3 * self.min_length:.3g} to"
            f" {_millimetres(self.max_length)} long"
        )

    def differences(self, entry: ObjectEntry) -> list[str]:
        """How an object is unlike all of these, such as `3.2 kg is heavier`; empty if it is not."""
        extents = [high - low for low, high in zip(entry.lower, entry.upper, strict=True)]
        thickness, length = min(extents), max(extents)
        found = [
            (entry.mass > self.max_mass, f"{entry.mass:.3g} kg is heavier"),
            (thickness < self.min_thickness, f"{_millimetres(thickness)} is thinner"),
            (length < self.min_length, f"{_millimetres(length)} is shorter"),
            (length > self.max_length, f"{_millimetres(length)} is longer"),
        ]
        return [text for is_outside, text in found if is_outside]


def _millimetres(length: float) -> str:
    return f"{round(1e3 * length, 1):g} mm"
