"""The arm: its inverse kinematics, how far it reaches, trajectories, and plans as files."""

from burg_drake.evaluation.store import (
    PlanOutput as PlanOutput,
)
from burg_drake.motion.ik import (
    ArmKinematics as ArmKinematics,
    ArmLimits as ArmLimits,
    IkRoutine as IkRoutine,
)
from burg_drake.motion.plans import (
    Motion as Motion,
    PlanOrigin as PlanOrigin,
    Trajectory as Trajectory,
)
from burg_drake.motion.reach import (
    Witness as Witness,
)
from burg_drake.motion.workspace import (
    ArmSpan as ArmSpan,
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    ReachLayer as ReachLayer,
    map_reachability as map_reachability,
    reach_from_above as reach_from_above,
)
