"""The runs whose grasps a trials file names: scene, station and grasp of each trial."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.results import load_runs
from burg_drake.evaluation.run_store import Run
from burg_drake.experiment.trials.sheet import RealTrial, TrialSheet, load_trials
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station


@dataclass(frozen=True, eq=False)
class TriedScene:
    """What the trials of a run are carried out on.

    Attributes:
        key: of the run in the trials file.
        run: on the disk.
        scene, station: as they were judged.
    """

    key: str
    run: Run
    scene: Scene
    station: Station

    @cached_property
    def candidates(self) -> dict[str, Candidate]:
        """The grasps by id."""
        return {candidate.id: candidate for candidate in self.run.candidates}


class TriedRuns:
    """The runs of a trials file, loaded when they are first asked for.

    Args:
        path: of the trials file.

    Attributes:
        path: as given.
        sheet: the file's contents when it was opened.

    Raises:
        DocumentError: the file does not fit the schema.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.sheet: TrialSheet = load_trials(path)
        self._tried: dict[str, TriedScene] = {}
        if not self.sheet.trials:
            raise InvalidInputError(f"{path} has no trials; burg-drake trials plan makes some")

    def of(self, trial: RealTrial) -> TriedScene:
        """What a trial is carried out on.

        Raises:
            InvalidInputError: the run is gone, is another one, or its library has changed.
        """
        if trial.run not in self._tried:
            self._tried[trial.run] = self._load(trial)
        return self._tried[trial.run]

    def candidate(self, trial: RealTrial) -> Candidate:
        """The grasp of a trial.

        Raises:
            InvalidInputError: the run does not have it.
        """
        tried = self.of(trial)
        found = tried.candidates.get(trial.grasp)
        if found is None:
            raise InvalidInputError(
                f"{self.path}: trial {trial.number}: run {tried.run.path} has no grasp"
                f" {trial.grasp!r}; the file is of another run"
            )
        return found

    def X_SG(self, trial: RealTrial) -> Array:
        """(4, 4) the grasp of a trial on the board."""
        candidate = self.candidate(trial)
        return self.of(trial).scene.X_SO(candidate.instance) @ candidate.X_OG

    def width(self, trial: RealTrial) -> float:
        """Distance between the pads at the grasp [m]; that of the open hand if it is unknown."""
        width = self.candidate(trial).width
        return float(self.of(trial).station.hand.opening[1]) if math.isnan(width) else width

    def blocks(self) -> dict[int, tuple[RealTrial, ...]]:
        """The trials in their order, by block."""
        ordered = sorted(self.sheet.trials, key=lambda trial: trial.number)
        numbers = np.unique([trial.block for trial in ordered]).tolist()
        return {n: tuple(t for t in ordered if t.block == n) for n in numbers}

    def _load(self, trial: RealTrial) -> TriedScene:
        source = self.sheet.runs.get(trial.run)
        where = f"{self.path}: trial {trial.number}"
        if source is None:
            known = ", ".join(self.sheet.runs) or "none"
            raise InvalidInputError(f"{where}: there is no run {trial.run!r}; runs: {known}")
        folder = self.path.absolute().parent / source.path
        runs = load_runs(folder)
        run = next((run for run in runs if run.document.hash == source.hash), None)
        if run is None:
            there = ", ".join(run.document.hash for run in runs)
            raise InvalidInputError(
                f"{where}: {folder} holds run {there}, the file is of run {source.hash}"
            )
        return TriedScene(trial.run, run, run.scene(), run.station())
