"""The judge of a station whose documents and models have come in a bundle."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.core.grasps import Mode
from burg_drake.evaluation.cluster.bundles.bundle import (
    Bundle,
    load_bundle,
    make_bundle,
    require_content,
)
from burg_drake.evaluation.cluster.bundles.judge_recipe import JudgeRecipe
from burg_drake.evaluation.stages import Judge, StationJudge, StationJudgeFactory
from burg_drake.station.document import Engine

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings


@dataclass(frozen=True)
class BundledJudgeFactory:
    """A `StationJudgeFactory` whose scene and station are in an unpacked bundle.

    Attributes:
        bundle: its name and hashes, without data.
        engine, mode, settings: as in `StationJudgeFactory`.
        folder: where it is unpacked; the worker says so.
    """

    bundle: Bundle
    engine: Engine
    mode: Mode
    settings: TrialSettings | None
    folder: Path | None = None

    def __call__(self) -> StationJudge:
        assert self.folder is not None
        scene, station = load_bundle(self.folder)
        require_content(self.bundle, scene, station)
        return StationJudgeFactory(scene, station, self.engine, self.mode, self.settings)()


def recipe_of(make_judge: Callable[[], Judge]) -> tuple[JudgeRecipe, Bundle | None]:
    """Recipe and bundle for a judge; where there is no `StationJudgeFactory`, no bundle is needed.

    Raises:
        BurgError: see `make_bundle`.
    """
    buffer = io.BytesIO()
    packer = _Packer(buffer)
    packer.dump(make_judge)
    bundle = packer.bundle
    return JudgeRecipe(buffer.getvalue(), bundle.name if bundle else ""), bundle


class _Packer(pickle.Pickler):
    """Puts a `BundledJudgeFactory` in the place of a `StationJudgeFactory`, wherever that is in
    what it pickles.

    Attributes:
        bundle: scene and station of that factory.
    """

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file)
        self.bundle: Bundle | None = None

    def persistent_id(self, value: Any) -> BundledJudgeFactory | None:
        if not isinstance(value, StationJudgeFactory):
            return None
        self.bundle = make_bundle(value.scene, value.station)
        hashes = replace(self.bundle, data=b"")
        return BundledJudgeFactory(hashes, value.engine, value.mode, value.settings)
