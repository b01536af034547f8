from .assessment import (
    Robustness as Robustness,
    assess_robustness as assess_robustness,
)
from .probe_answer import ProbeAnswer as ProbeAnswer
from .settings import (
    DEFAULT_BEST as DEFAULT_BEST,
    TESTS as TESTS,
    RobustnessSettings as RobustnessSettings,
)
from .shares import (
    TABLE_FILES as TABLE_FILES,
    lifted_shares as lifted_shares,
    own_table as own_table,
)
from .table import (
    GraspRobustness as GraspRobustness,
    robustness_view as robustness_view,
)
