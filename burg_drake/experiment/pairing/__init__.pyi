from .matching import (
    Match as Match,
    match_rows as match_rows,
)
from .pairs import (
    MEASURED as MEASURED,
    NAMES as NAMES,
    NUMBERS as NUMBERS,
    REFERENCE_NAMES as REFERENCE_NAMES,
    VerdictPairs as VerdictPairs,
    make_pairs as make_pairs,
    successes as successes,
    undecided as undecided,
)
from .phases import (
    approach_note as approach_note,
    require_same_phases as require_same_phases,
    unpredictable_for as unpredictable_for,
    unpredictable_outcomes as unpredictable_outcomes,
)
from .probability import predicted_probability as predicted_probability
from .result_table import ResultTable as ResultTable
from .side import (
    JudgedRuns as JudgedRuns,
    Side as Side,
    require_common_scene as require_common_scene,
    settings_apart as settings_apart,
    settled_side as settled_side,
    side_of_trials as side_of_trials,
)
from .text_codes import Factor as Factor
from .tried import find_tried as find_tried
