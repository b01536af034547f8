"""The arm: its inverse kinematics, how far it reaches, trajectories, and plans as files."""

import warnings

from burg_drake.evaluation import PlanOutput as PlanOutput
from burg_drake.motion import (
    ArmKinematics as ArmKinematics,
    ArmLimits as ArmLimits,
    ArmPath as ArmPath,
    ArmSpan as ArmSpan,
    IkRoutine as IkRoutine,
    Motion as Motion,
    PlanOrigin as PlanOrigin,
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    ReachLayer as ReachLayer,
    Trajectory as Trajectory,
    map_reachability as map_reachability,
    reach_from_above as reach_from_above,
)


def __getattr__(name: str) -> type[ArmPath]:
    """Earlier names, which go with 0.2."""
    if name != "Witness":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("arm.Witness is arm.ArmPath since 0.1", DeprecationWarning, stacklevel=2)
    return ArmPath
