from .trajectory import (
    Motion as Motion,
    Plan as Plan,
    PlanOrigin as PlanOrigin,
    Trajectory as Trajectory,
)
