"""What the trials of a file are carried out on: scene, station and grasp of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from burg_drake.core import Array, InvalidInputError
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.store import Run
from burg_drake.experiment.trials import RealTrial, TrialSheet, load_sources, load_trials
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station


@dataclass(frozen=True, eq=False)
class TriedScene:
    """What the trials of a run are carried out on.

    Attributes:
        run: on the disk.
        scene, station: as they were judged.
    """

    run: Run
    scene: Scene
    station: Station

    @cached_property
    def candidates(self) -> dict[str, Candidate]:
        """The grasps by id."""
        return {candidate.id: candidate for candidate in self.run.candidates}


class TriedRuns:
    """The runs of a trials file.

    Args:
        path: of the trials file.
        moved: folders of runs in place of those in the file, by key.

    Attributes:
        path: as given.
        sheet: the file's contents when it was opened.

    Raises:
        BurgError: the file does not fit the schema or has no trials; a run or a grasp is gone, or
            not the one that was planned with.
    """

    def __init__(self, path: str | Path, moved: Mapping[str, str | Path] | None = None) -> None:
        self.path = Path(path)
        self.sheet: TrialSheet = load_trials(path)
        if not self.sheet.trials:
            raise InvalidInputError(
                f"{path} has no trials; burg-drake trials plan makes a file with trials"
            )
        used = {trial.run: None for trial in self.sheet.trials}
        runs = load_sources(self.sheet, path, moved=moved, only=used)
        self._tried = {
            key: TriedScene(run, run.scene(), run.station()) for key, run in runs.items()
        }

    def of(self, trial: RealTrial) -> TriedScene:
        """What a trial is carried out on."""
        return self._tried[trial.run]

    def candidate(self, trial: RealTrial) -> Candidate:
        """The grasp of a trial."""
        return self.of(trial).candidates[trial.grasp]

    def X_SG(self, trial: RealTrial) -> Array:
        """(4, 4) the grasp of a trial on the board."""
        candidate = self.candidate(trial)
        return self.of(trial).scene.X_SO(candidate.instance) @ candidate.X_OG

    def width(self, trial: RealTrial) -> float:
        """Distance between the pads at the grasp [m]; that of the open hand if it is unknown."""
        width = self.candidate(trial).width
        return float(self.of(trial).station.hand.opening[1]) if math.isnan(width) else width


def in_blocks(sheet: TrialSheet) -> dict[int, tuple[RealTrial, ...]]:
    """The trials of a sheet in their order, by block."""
    blocks: dict[int, list[RealTrial]] = {}
    for trial in sorted(sheet.trials, key=lambda trial: trial.number):
        blocks.setdefault(trial.block, []).append(trial)
    return {block: tuple(trials) for block, trials in blocks.items()}
