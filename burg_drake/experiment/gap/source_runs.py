"""The runs that a sheet of trials was planned from."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core.errors import InvalidInputError
from burg_drake.evaluation.results import load_runs
from burg_drake.evaluation.run_store import Run
from burg_drake.experiment.trials.sheet import TrialSheet


def source_runs(sheet: TrialSheet, path: str | Path) -> dict[str, Run]:
    """The runs of a sheet by key.

    Args:
        sheet: the trials.
        path: their file.

    Raises:
        InvalidInputError: a run is not where the sheet says, or is another one.
    """
    found = {}
    for key, source in sheet.runs.items():
        folder = Path(path).parent / source.path
        runs = {run.document.hash: run for run in load_runs(folder)}
        if source.hash not in runs:
            raise InvalidInputError(
                f"{folder} holds run {', '.join(runs)}; the trials are of run {source.hash}"
                f" (runs.{key}): write its folder into the trials file"
            )
        found[key] = runs[source.hash]
    return found
