"""The steps in which grasps are judged, and what is recorded of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from burg_drake.core.grasps import Mode
from burg_drake.evaluation.store import Run

StepName = Literal["hand", "reach", "arm", "placed"]


@dataclass(frozen=True, kw_only=True)
class GapDocument:
    """A measurement of the gap between simulation and robot, step by step (`gap.yaml`).

    Attributes:
        source: hash of the run whose grasps are evaluated; empty if they were sampled.
        scene: hash of the scene.
        station: hash of the station.
        last: mode of the last step.
        place_mm: standard deviation of the objects' positions [mm].
        turn_deg: standard deviation of the objects' turns about the vertical [degrees].
        seed: seed of the displacements.
        samples: number of displaced scenes.
        redrawn: how often places were drawn again, for each displaced scene.
        kept: objects that stay as planned because no other place was found, by displaced scene.
        versions: versions of the software.
    """

    version: int = 1
    source: str = ""
    scene: str
    station: str
    last: Mode
    place_mm: float
    turn_deg: float
    seed: int
    samples: int
    redrawn: tuple[int, ...] = ()
    kept: dict[str, tuple[str, ...]] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GapStep:
    """One step.

    Attributes:
        name: which.
        runs: one, or one for each displaced scene.
    """

    name: StepName
    runs: tuple[Run, ...]


@dataclass(frozen=True, eq=False)
class GapSteps:
    """All steps.

    Attributes:
        path: folder.
        document: what was asked.
        steps: in order.
        tried: further grasps in the displaced scenes of the last step, those of real trials that
            fail in the last mode.
    """

    path: Path
    document: GapDocument
    steps: tuple[GapStep, ...]
    tried: tuple[Run, ...] = ()

    @property
    def first(self) -> Run:
        """The run of the hand alone."""
        return self.steps[0].runs[0]
