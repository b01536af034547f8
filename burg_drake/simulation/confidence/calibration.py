"""From the signs of a verdict to its confidence: an additive logistic model.

Confidence is the probability that the same question, held to the end or not, is answered alike by
trials that differ by what nobody knows exactly (friction, place of the hand, size of the object,
duration of the lift) and by an oracle that shares no code with the engines. Each engine has curves
of its own, for what it holds and for what it loses. `benchmarks/confidence.py` fits them, on some
of its objects, and writes `calibration.json`; the others say how far they can be trusted.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from burg_drake.core.grasps import Margins, Outcome
from burg_drake.simulation.confidence.grip_signs import GripLoad, grip_signs
from burg_drake.station.document import ENGINES, Engine

CALIBRATION_FILE = Path(__file__).with_name("calibration.json")
UNSURE = (Outcome.SIMULATION_FAILED,)
"""Outcomes that are no verdict of a trial."""


@dataclass(frozen=True)
class Curve:
    """A piecewise linear term of the logit, constant beyond its ends.

    Attributes:
        knots: values of the sign, rising.
        logits: of the term there.
    """

    knots: Sequence[float]
    logits: Sequence[float]

    def at(self, value: float) -> float:
        """The term for a value of the sign."""
        return float(np.interp(value, self.knots, self.logits))


Curves = Mapping[str, Curve]
"""Terms by sign; their sum is the logit of the confidence."""


def confidence(engine: Engine, outcome: Outcome, margins: Margins, load: GripLoad) -> float | None:
    """Confidence in the verdict of a trial.

    Args:
        engine: that has executed it.
        outcome: how it ended.
        margins: of the trial, with its end counted from where the fingers met it.
        load: of its grip.

    Returns:
        Probability; None if no trial decided, or the engine is no preset that is calibrated.
    """
    if ENGINES.get(engine.name) != engine:
        return None
    return confidence_of(engine.name, outcome, grip_signs(margins, load))


def confidence_of(engine: str, outcome: Outcome, signs: Mapping[str, float]) -> float | None:
    """Confidence in a verdict by its signs, see `grip_signs`; None where there is no calibration.

    Args:
        engine: name of the preset that has executed it.
        outcome: how it ended.
        signs: by name.
    """
    curves = calibration().get((engine, outcome.held))
    if curves is None or outcome in UNSURE:
        return None
    logit = sum(curve.at(signs[name]) for name, curve in curves.items())
    return 1.0 / (1.0 + math.exp(-logit))


@lru_cache(maxsize=1)
def calibration(path: Path = CALIBRATION_FILE) -> Mapping[tuple[str, bool], Curves]:
    """The curves by name of the engine, and by whether it holds the target to the end."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return {
        (engine, held == "held"): {
            sign: Curve(tuple(curve["knots"]), tuple(curve["logits"]))
            for sign, curve in curves.items()
        }
        for engine, parts in content["engines"].items()
        for held, curves in parts.items()
    }
