"""Compares runs with trials on the robot, or with each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, nearest, quoted
from burg_drake.evaluation.store import Campaign, Run
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.of_runs import compare_runs
from burg_drake.experiment.comparison.of_trials import compare_trials
from burg_drake.experiment.comparison.placement_error import LIMIT_MM
from burg_drake.experiment.trials import Success

SUCCESSES: tuple[Success, ...] = ("lifted", "held")


def compare(
    first: Run | Campaign | str | Path,
    second: Run | Campaign | str | Path,
    trials: str | Path | None = None,
    *,
    success: Success | None = None,
    placement_limit_mm: float = LIMIT_MM,
    robustness: str | Path | None = None,
    seed: int = 0,
) -> Comparison:
    """Compares a run with trials on the robot or with another run, or two runs with trials.

    Example::

        found = burg.trials.compare("runs/first", "trials.yaml").judgement
        print(found.selected.precision.value, found.selected.precision.low)

    Args:
        first: run whose verdicts are taken as predictions, or its folder.
        second: a trials file, or a run of the same grasps, which then counts as what happened.
        trials: a trials file; both runs are then compared with it, and with each other.
        success: what counts as success; if None what the trials were planned with, or `lifted`.
        placement_limit_mm: how far off every object may be in trials with good placement [mm].
        robustness: table of robustness whose shares of success are a predicted probability;
            `robustness.csv` in the folder of the first run if None and it is there.
        seed: of the intervals' resampling.

    Raises:
        InvalidInputError: they have nothing in common that can be compared.
        DocumentError: the trials file does not fit its schema.
    """
    if success is not None and success not in SUCCESSES:
        raise InvalidInputError(f"success is {quoted(success)}; {nearest(str(success), SUCCESSES)}")
    if not np.isfinite(placement_limit_mm) or placement_limit_mm < 0.0:
        raise InvalidInputError(f"the placement limit is {placement_limit_mm} mm; give 0 or more")
    if trials is None and not is_trials(second):
        return compare_runs(
            first, second, success=success or "lifted", robustness=robustness, seed=seed
        )
    sheet = second if trials is None else trials
    return compare_trials(
        [first] if trials is None else [first, second],
        Path(str(sheet)),
        success=success,
        placement_limit_mm=placement_limit_mm,
        robustness=robustness,
        seed=seed,
    )


def is_trials(path: Run | Campaign | str | Path) -> bool:
    """Whether it is a trials file rather than a run, going by its name."""
    return isinstance(path, (str, Path)) and Path(path).suffix in (".yaml", ".yml")
