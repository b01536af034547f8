"""What counts as lifted, and whether the hand's approach was simulated: as numbers of a recorded
run, as text, and as settings of `evaluate`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

TILT, SLIP, APPROACH = "tilt_limit", "slip_limit", "approach"
"""Names in a record, see `simulation.trials.trial_settings.TrialSettings`."""
FARTHEST = "farthest_point"
"""Name in a record: 1 if others were moved as far as their farthest point; releases that watched
their centres of mass did not record it."""
AS_MEASURED = {FARTHEST: 1.0}
"""What a run of this release records of how it measures, beside its settings."""


def limit_settings(values: Mapping[str, float]) -> dict[str, Any]:
    """Fields of `EvaluationSettings` that recorded numbers ask for. What is not recorded, as in
    runs of releases before there were limits, is no limit.

    Args:
        values: settings of the trial's phases.
    """
    return {
        "tilt_limit_deg": _degrees(values.get(TILT, math.pi)),
        "slip_limit_mm": _millimetres(values.get(SLIP, math.inf)),
        "approach": bool(values.get(APPROACH, False)),
    }


def without_limits(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers of other settings."""
    return {k: v for k, v in values.items() if k not in (TILT, SLIP, APPROACH, FARTHEST)}


def without_measures(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers that are settings."""
    return {k: v for k, v in values.items() if k not in AS_MEASURED}


def measure_text(values: Mapping[str, float]) -> str:
    """Of what point it is measured how far others were moved, for people."""
    return "of farthest points" if values.get(FARTHEST) else "of centres of mass"


def limits_text(values: Mapping[str, float]) -> str:
    """The limits for people."""
    asked = limit_settings(values)
    tilt, slip = asked["tilt_limit_deg"], asked["slip_limit_mm"]
    parts = [f"tilt {tilt:.12g} degrees"] if tilt < 180.0 else []
    parts += [f"slip {slip:.12g} mm"] if math.isfinite(slip) else []
    return ", ".join(parts) or "none"


def _degrees(angle: float) -> float:
    """An angle [rad] in few digits, if they are the same angle."""
    short = float(f"{math.degrees(angle):.12g}")
    return short if math.radians(short) == angle else math.degrees(angle)


def _millimetres(length: float) -> float:
    short = float(f"{1e3 * length:.12g}")
    return short if short / 1000.0 == length else 1e3 * length
