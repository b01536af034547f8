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
    """Schema of gap.yaml.

    Attributes:
        source: hash of the run whose grasps are judged; empty if they were sampled.
        scene, station: content hashes.
        last: the last mode.
        place_mm, turn_deg: standard deviations of the objects' places [mm, degrees].
        seed: of the places.
        samples: number of displaced scenes.
        redrawn: how many places were drawn again, by scene.
        kept: objects that stay as planned in a scene, as no other place was found.
        versions: of the software.
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
