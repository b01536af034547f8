"""Verdicts beside what happened, row by row: what all figures of a comparison are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.experiment.pairing.matching import CONTENT, KEY
from burg_drake.experiment.pairing.result_table import ResultTable
from burg_drake.experiment.pairing.text_codes import Factor, Ids
from burg_drake.experiment.statistics import PREDICTORS, Flags, Values
from burg_drake.experiment.trials import Success, succeeded

NUMBERS = (*PREDICTORS, "confidence")
"""Columns of numbers of the run whose verdicts are predictions."""
NAMES = (
    *(*KEY, *CONTENT, "object", "outcome", "stage", "blocker", "run", "judged_again"),
    *NUMBERS,
)
"""Columns of the run whose verdicts are predictions."""
MEASURED = tuple(name for name in PREDICTORS if name != "score")
"""Margins that two runs may measure differently: a score belongs to the grasp."""
REFERENCE_NAMES = (*KEY, *CONTENT, "outcome", "stage", "judged_again", "confidence", *MEASURED)
"""Columns of a run whose verdicts count as what happened."""
UNDECIDED = (Outcome.SIMULATION_FAILED, Outcome.REACHABLE)
"""Verdicts that predict nothing: no simulation came to an end."""


@dataclass(frozen=True, eq=False)
class VerdictPairs:
    """N grasps with a verdict and an outcome each.

    Attributes:
        id: (N,) of the grasps.
        run: (N,) hashes of the runs of the verdicts.
        scene, object: of each grasp.
        simulated, stage, blocker: the verdict.
        judged_again: engine that gave the verdict; empty where it is the run's own.
        confidence: (N,) of the verdicts; NaN where there is none.
        ended: what happened: outcome of a trial, or verdict of the other run.
        predicted, actual: (N,) whether that is success.
        margins: (N,) numbers of the verdicts by name.
    """

    id: Ids
    run: Factor
    scene: Factor
    object: Factor
    simulated: Factor
    stage: Factor
    blocker: Factor
    judged_again: Factor
    confidence: Array
    ended: Factor
    predicted: Flags
    actual: Flags
    margins: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.predicted)

    def with_margin(self, name: str, values: Array) -> VerdictPairs:
        """With one more number of each verdict, (N,)."""
        return replace(self, margins={**self.margins, name: values})

    def take(self, rows: Values) -> VerdictPairs:
        """Some rows, as indices or truth values."""
        factors = (
            *("run", "scene", "object", "simulated", "stage", "blocker", "judged_again"),
            "ended",
        )
        return replace(
            self,
            id=self.id.take(rows),
            confidence=self.confidence[rows],
            predicted=self.predicted[rows],
            actual=self.actual[rows],
            margins={name: values[rows] for name, values in self.margins.items()},
            **{name: getattr(self, name).take(rows) for name in factors},
        )


def make_pairs(
    verdicts: ResultTable, ended: Factor, actual: Flags, success: Success
) -> VerdictPairs:
    """Pairs from rows of results.

    Args:
        verdicts: columns `NAMES`, N rows.
        ended: what happened in each row.
        actual: (N,) whether that is success.
        success: what counts as success.
    """
    texts = verdicts.texts
    return VerdictPairs(
        id=verdicts.id,
        run=texts["run"],
        scene=texts["scene_content"],
        object=texts["object"],
        simulated=texts["outcome"],
        stage=texts["stage"],
        blocker=texts["blocker"],
        judged_again=texts["judged_again"],
        confidence=verdicts.numbers["confidence"],
        ended=ended,
        predicted=successes(texts["outcome"], success),
        actual=actual,
        margins={name: verdicts.numbers[name] for name in PREDICTORS},
    )


def successes(simulated: Factor, success: Success) -> Flags:
    """(N,) whether verdicts are success."""
    return simulated.where([succeeded(Outcome(name), success) for name in simulated.names])


def undecided(simulated: Factor) -> dict[str, Flags]:
    """Which rows have a verdict that predicts nothing, by the verdict."""
    return {
        outcome.value: simulated.where([name == outcome.value for name in simulated.names])
        for outcome in UNDECIDED
        if outcome.value in simulated.names
    }
