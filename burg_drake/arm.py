"""The arm: its inverse kinematics, how far it reaches, trajectories, and plans as files."""

from burg_drake.evaluation import PlanOutput as PlanOutput
from burg_drake.motion import (
    ArmKinematics as ArmKinematics,
    ArmLimits as ArmLimits,
    ArmSpan as ArmSpan,
    IkRoutine as IkRoutine,
    Motion as Motion,
    PlanOrigin as PlanOrigin,
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    ReachLayer as ReachLayer,
    Trajectory as Trajectory,
    Witness as Witness,
    map_reachability as map_reachability,
    reach_from_above as reach_from_above,
)
