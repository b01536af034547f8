from .closed_form import ClosedFormLineSearch as ClosedFormLineSearch
from .line_poses import LinePoses as LinePoses
from .line_search import (
    Chain as Chain,
    Failure as Failure,
    LineSearch as LineSearch,
    LineSearchBatch as LineSearchBatch,
)
from .numeric_search import NumericLineSearch as NumericLineSearch
from .reach_settings import ReachSettings as ReachSettings
from .successive import SuccessiveLineSearch as SuccessiveLineSearch
