"""Grasps whose verdict was wrong, and how to look at them."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.pairing import VerdictPairs
from burg_drake.experiment.trials import RealTrial

MOST_LISTED = 200
"""Of each kind; the matrix counts all."""


@dataclass(frozen=True, kw_only=True)
class Disagreement:
    """A grasp whose verdict was wrong.

    Attributes:
        kind: `fp` if success was predicted, `fn` if failure was.
        scene, object, grasp: which grasp on what.
        simulated, stage, blocker: the verdict.
        ended: what happened.
        replays: commands that show the trials in simulation.
        trial: number of the real trial; None if there is none.
        note, photo: of the real trial; the photo as the sheet names it.
        offset_mm: largest offset of any object [mm]; None where unknown.
    """

    kind: Literal["fp", "fn"]
    scene: str
    object: str
    grasp: str
    simulated: str
    stage: str
    blocker: str
    ended: str
    replays: tuple[str, ...]
    trial: int | None = None
    note: str = ""
    photo: str = ""
    offset_mm: float | None = None


def disagreements(
    pairs: VerdictPairs,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
    trials: Sequence[RealTrial] = (),
    offset_mm: Array | None = None,
) -> tuple[Disagreement, ...]:
    """Lists what was predicted wrongly, false successes first.

    Args:
        pairs: N grasps.
        scenes: names of the scenes by their content.
        folders: of the runs by content of the scene; one mapping for each run to be replayed.
        trials: (N,) the real trials, if that is what happened.
        offset_mm: (N,) largest offset of any object in them; NaN where unknown.
    """
    found = []
    for kind, wrong in (
        ("fp", pairs.predicted & ~pairs.actual),
        ("fn", ~pairs.predicted & pairs.actual),
    ):
        for row in np.flatnonzero(wrong)[:MOST_LISTED].tolist():
            scene, grasp = pairs.scene[row], pairs.id[row]
            trial = trials[row] if trials else None
            offset = np.nan if offset_mm is None else float(offset_mm[row])
            found.append(
                Disagreement(
                    kind="fp" if kind == "fp" else "fn",
                    scene=scenes.get(scene, scene),
                    object=pairs.object[row],
                    grasp=grasp,
                    simulated=pairs.simulated[row],
                    stage=pairs.stage[row],
                    blocker=pairs.blocker[row],
                    ended=pairs.ended[row],
                    replays=replay_commands(folders, scene, grasp),
                    trial=None if trial is None else trial.number,
                    note="" if trial is None else trial.note,
                    photo="" if trial is None else trial.photo,
                    offset_mm=None if np.isnan(offset) else offset,
                )
            )
    return tuple(found)


def replay_commands(
    folders: Sequence[Mapping[str, str]], scene: str, grasp: str
) -> tuple[str, ...]:
    """Commands that show a grasp in each run that has its scene.

    Args:
        folders: of the runs by content of the scene; one mapping for each run.
        scene: its content.
        grasp: its id.
    """
    return tuple(
        shlex.join(["burg-drake", "replay", known[scene], "--grasp", grasp])
        for known in folders
        if scene in known
    )
