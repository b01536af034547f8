"""What a worker needs to judge grasps of a scene that nobody has looked at before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from burg_drake.core.content import content_hash
from burg_drake.core.errors import BurgError
from burg_drake.core.outcome import Outcome, Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import Decide, Decision, Judge, Screen, one_line
from burg_drake.evaluation.mode import Mode
from burg_drake.evaluation.station_judge import StationJudge
from burg_drake.scene.scene import Scene
from burg_drake.station.engine import Engine
from burg_drake.station.station import Station

if TYPE_CHECKING:
    from burg_drake.simulation.trial_settings import TrialSettings


@dataclass(frozen=True)
class SceneJudgeFactory:
    """Builds the judge of a station, or of a scene that cannot be built one that says so: with many
    scenes, one of them must not end the work on all.

    Attributes:
        scene, station: what to build.
        engine, mode, settings: see `StationJudge`.
    """

    scene: Scene
    station: Station
    engine: Engine
    mode: Mode
    settings: TrialSettings

    def __call__(self) -> Judge:
        try:
            return StationJudge(
                self.scene,
                self.station,
                engine=self.engine,
                mode=self.mode,
                settings=self.settings,
            )
        except BurgError as error:
            return NoScene(one_line(error))

    @property
    def content(self) -> str:
        """Hash of all that decides about its verdicts, but for the versions."""
        return content_hash(
            *(self.scene.content, self.station.content, self.mode),
            *(asdict(self.engine), asdict(self.settings)),
        )


class NoScene:
    """Says of every grasp that it could not be simulated, and why."""

    screens: Sequence[Screen] = ()

    def __init__(self, reason: str) -> None:
        self._reason = reason
        self.stages: Sequence[tuple[Stage, Decide]] = ((Stage.EXECUTED, self._decide),)

    def _decide(self, grasp: Candidate, motion: object) -> Decision:
        return Decision(Outcome.SIMULATION_FAILED, reason=self._reason)
