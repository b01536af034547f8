"""Trials files without runs."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core import Outcome
from burg_drake.evaluation import Input
from burg_drake.experiment import RealTrial, Selection, SourceRun, Stratum, TrialSheet, save_trials


def make_sheet(count: int = 4) -> TrialSheet:
    """Trials of one run on a mug; in simulation it is lifted and slips by turns."""
    document = Input(name="two", path="two.yaml", content="0" * 64)
    run = SourceRun(
        path="run", hash="abc", scene=document, station=document, mode="hand", engine="standard"
    )
    stratum = Stratum(
        run="two", object="mug", label="all", population=count, selected=count, wanted=count
    )
    trials = tuple(
        RealTrial(
            number=number,
            block=1,
            run="two",
            grasp=f"mug-{number:04x}",
            content=f"{number:012x}",
            instance="mug",
            object="mug",
            simulated=(Outcome.LIFTED, Outcome.SLIPPED)[number % 2],
            stratum="mug",
        )
        for number in range(1, count + 1)
    )
    return TrialSheet(
        created="2026-05-04T16:30:00+02:00",
        runs={"two": run},
        selection=Selection(per_object=count, balance="none"),
        strata={"mug": stratum},
        trials=trials,
    )


def write_sheet(folder: Path, count: int = 4) -> Path:
    """A trials file in a folder."""
    path = folder / "trials.yaml"
    save_trials(make_sheet(count), path)
    return path
