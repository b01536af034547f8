"""The judge of a station whose documents and models have come in a bundle."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.evaluation.cluster.bundle import (
    Bundle,
    load_bundle,
    make_bundle,
    require_content,
)
from burg_drake.evaluation.cluster.recipe import Recipe
from burg_drake.evaluation.judge import Judge
from burg_drake.evaluation.mode import Mode
from burg_drake.evaluation.station_judge import StationJudge, StationJudgeFactory
from burg_drake.station.engine import Engine
from burg_drake.station.grasp_motion import GraspMotion


@dataclass(frozen=True)
class BundledJudgeFactory:
    """A `StationJudgeFactory` whose scene and station are in an unpacked bundle.

    Attributes:
        bundle: its name and hashes, without data.
        engine, mode, motion: as in `StationJudgeFactory`.
        folder: where it is unpacked; the worker says so.
    """

    bundle: Bundle
    engine: Engine
    mode: Mode
    motion: GraspMotion | None
    folder: Path | None = None

    def __call__(self) -> StationJudge:
        assert self.folder is not None
        scene, station = load_bundle(self.folder)
        require_content(self.bundle, scene, station)
        return StationJudgeFactory(scene, station, self.engine, self.mode, self.motion)()


def recipe_of(make_judge: Callable[[], Judge]) -> tuple[Recipe, Bundle | None]:
    """Recipe and bundle for a judge; what is no `StationJudgeFactory` needs no bundle.

    Raises:
        BurgError: see `make_bundle`.
    """
    if not isinstance(make_judge, StationJudgeFactory):
        return Recipe(pickle.dumps(make_judge)), None
    bundle = make_bundle(make_judge.scene, make_judge.station)
    factory = BundledJudgeFactory(
        replace(bundle, data=b""), make_judge.engine, make_judge.mode, make_judge.motion
    )
    return Recipe(pickle.dumps(factory), bundle.name), bundle
