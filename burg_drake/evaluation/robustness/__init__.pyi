from .assessment import assess_robustness as assess_robustness
from .probes import RobustnessSettings as RobustnessSettings
from .shares import (
    TABLE_FILES as TABLE_FILES,
    lifted_shares as lifted_shares,
    own_table as own_table,
)
from .table import robustness_view as robustness_view
