from .plan import plan_trials as plan_trials
from .power import (
    difference_text as difference_text,
    power_table as power_table,
)
