from .grasp_plan import (
    Plan as Plan,
    load_plan as load_plan,
)
from .planned_motion import PlanOrigin as PlanOrigin
from .trajectory import (
    Motion as Motion,
    Trajectory as Trajectory,
)
