"""Scenes: their documents, checks, sampling, settling, printing and export."""

import collections.abc
import warnings

from burg_drake.core import Pose as Pose
from burg_drake.evaluation import (
    GraspCount as GraspCount,
    clear_grasp_counts as clear_grasp_counts,
    count_grasps as count_grasps,
    within_reach as within_reach,
)
from burg_drake.export import Exported as Exported, Layout as Layout, PlacedObject as PlacedObject
from burg_drake.generation import (
    SampledFolder as SampledFolder,
    SampledScene as SampledScene,
    SceneRow as SceneRow,
)
from burg_drake.printout import (
    HeightMap as HeightMap,
    Paper as Paper,
    Printout as Printout,
    PrintSettings as PrintSettings,
    Tile as Tile,
    Tiling as Tiling,
    height_map as height_map,
)
from burg_drake.scene import (
    Board as Board,
    Extent as Extent,
    Instance as Instance,
    MarkerLayout as MarkerLayout,
    Markers as Markers,
    SamplingProvenance as SamplingProvenance,
    SceneDocument as SceneDocument,
    SceneIssue as SceneIssue,
    SceneOrigin as SceneOrigin,
    validate_scene as validate_scene,
)
from burg_drake.simulation import (
    BodySpeed as BodySpeed,
    Displacement as Displacement,
    SettledScene as SettledScene,
    is_still as is_still,
    measure_drift as measure_drift,
)
from burg_drake.station import SceneCheck as SceneCheck


def __getattr__(name: str) -> collections.abc.Callable[..., object]:
    """Earlier names, which go with 0.2."""
    if name != "stillness":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    text = "scenes.stillness is scenes.measure_drift since 0.1"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return measure_drift
