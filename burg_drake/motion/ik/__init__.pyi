from .limits import ArmLimits as ArmLimits
from .links import (
    ArmLinks as ArmLinks,
    LinkPoses as LinkPoses,
)
from .numeric import (
    ArmKinematics as ArmKinematics,
    rotation_vector as rotation_vector,
    solve_ik as solve_ik,
)
from .panda import (
    BRANCHES as BRANCHES,
    PandaIk as PandaIk,
    panda_forward as panda_forward,
)
from .routine import (
    IkRoutine as IkRoutine,
    RoutineSolutions as RoutineSolutions,
)
from .solutions import (
    ArmSolutions as ArmSolutions,
    NumericSolutions as NumericSolutions,
    arm_solutions as arm_solutions,
)
