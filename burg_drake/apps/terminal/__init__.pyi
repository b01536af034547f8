from .interrupts import (
    interrupts_ignored as interrupts_ignored,
    terminated_as_interrupted as terminated_as_interrupted,
    wait_for_interrupt as wait_for_interrupt,
)
from .legend import print_legend as print_legend
from .meshcat_view import (
    open_in_browser as open_in_browser,
    open_view as open_view,
    present as present,
)
from .number_tables import (
    QUANTILES as QUANTILES,
    print_numbers as print_numbers,
)
