"""The grasps on which two runs part, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.experiment.comparison.disagreement import replay_commands
from burg_drake.experiment.pairing import VerdictPairs
from burg_drake.experiment.statistics import Flags


@dataclass(frozen=True, kw_only=True)
class PartedGrasp:
    """A grasp that only one of two runs holds.

    Attributes:
        scene, object, grasp: which grasp on what.
        first, second: its outcome in either run.
        confidence: of the first run's verdict; None where it has none.
        replays: commands that show it in the first run, and in the second.
    """

    scene: str
    object: str
    grasp: str
    first: str
    second: str
    confidence: float | None
    replays: tuple[str, ...]


def parted_grasps(
    pairs: VerdictPairs,
    parted: Flags,
    scenes: Mapping[str, str],
    folders: Sequence[Mapping[str, str]],
) -> tuple[PartedGrasp, ...]:
    """Names grasps in the order of the first run.

    Args:
        pairs: N grasps with the verdicts of the first run, and how they ended in the second.
        parted: (N,) which of them are named.
        scenes: names of the scenes by their content.
        folders: of the two runs, by content of the scene.
    """
    found = []
    for row in np.flatnonzero(parted).tolist():
        scene, grasp, confidence = pairs.scene[row], pairs.id[row], float(pairs.confidence[row])
        found.append(
            PartedGrasp(
                scene=scenes.get(scene, scene),
                object=pairs.object[row],
                grasp=grasp,
                first=pairs.simulated[row],
                second=pairs.ended[row],
                confidence=None if np.isnan(confidence) else confidence,
                replays=replay_commands(folders, scene, grasp),
            )
        )
    return tuple(found)
