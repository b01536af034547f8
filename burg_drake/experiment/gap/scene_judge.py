"""What a worker needs to judge grasps of a scene that nobody has looked at before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from burg_drake.core import content_hash
from burg_drake.core.grasps import Mode
from burg_drake.evaluation.stages import StationJudge, StationJudgeFactory, build_judge
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, Station

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings


@dataclass(frozen=True)
class SceneJudgeFactory:
    """Builds the judge of a scene with all settings that a run has recorded.

    Attributes:
        scene, station: what to build.
        engine, mode, settings: see `build_judge`.
    """

    scene: Scene
    station: Station
    engine: Engine
    mode: Mode
    settings: TrialSettings

    def __call__(self) -> StationJudge:
        return build_judge(
            self.scene,
            self.station,
            engine=self.engine,
            mode=self.mode,
            settings=self.settings,
        )

    @property
    def plain(self) -> Callable[[], StationJudge]:
        """The usual factory, which does the same: clusters know how to send that one."""
        return StationJudgeFactory(self.scene, self.station, self.engine, self.mode, self.settings)

    @property
    def content(self) -> str:
        """Hash of all that decides about its verdicts, but for the versions."""
        return content_hash(
            *(self.scene.content, self.station.content, self.mode),
            *(asdict(self.engine), asdict(self.settings)),
        )
