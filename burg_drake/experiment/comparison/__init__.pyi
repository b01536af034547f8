from .comparing import compare as compare
from .comparison import Comparison as Comparison
from .record import (
    comparison_json as comparison_json,
    plain as plain,
)
from .tables import comparison_tables as comparison_tables
from .wording import interval as interval
