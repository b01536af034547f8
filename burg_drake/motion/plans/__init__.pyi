from .grasp_plan import Plan as Plan
from .planned_motion import PlanOrigin as PlanOrigin
from .trajectory import (
    Motion as Motion,
    Trajectory as Trajectory,
)
