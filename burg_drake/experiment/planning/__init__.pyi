from .plan import plan_trials as plan_trials
from .power import (
    difference_text as difference_text,
    mcnemar_power as mcnemar_power,
    power_table as power_table,
    smallest_difference as smallest_difference,
)
from .settings import SelectionSettings as SelectionSettings
