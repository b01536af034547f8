from .arrays import (
    Flags as Flags,
    Rows as Rows,
    Values as Values,
)
from .confusion import (
    Agreement as Agreement,
    agreement as agreement,
    agreements as agreements,
    grouped as grouped,
    matrix_of as matrix_of,
)
from .estimates import (
    CELLS as CELLS,
    MEASURES as MEASURES,
    Estimate as Estimate,
    share as share,
)
from .margin_calibration import (
    PREDICTORS as PREDICTORS,
    PROBABILITY as PROBABILITY,
    Bin as Bin,
    IsotonicStep as IsotonicStep,
    MarginCalibration as MarginCalibration,
    calibration as calibration,
    calibrations as calibrations,
)
from .paired_answers import (
    Paired as Paired,
    paired as paired,
    paired_counts as paired_counts,
)
from .rank_statistics import MIN_OF_EACH_OUTCOME as MIN_OF_EACH_OUTCOME
