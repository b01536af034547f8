from .corners import IsFree as IsFree
from .grasp_timing import (
    PathChecks as PathChecks,
    time_motion as time_motion,
)
from .timing_settings import TimingSettings as TimingSettings
