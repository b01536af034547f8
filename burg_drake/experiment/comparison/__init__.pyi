from .comparing import (
    SUCCESSES as SUCCESSES,
    compare as compare,
)
from .comparison import (
    Comparison as Comparison,
    Coverage as Coverage,
)
from .disagreement import Disagreement as Disagreement
from .groups import (
    FactorGroup as FactorGroup,
    Stopped as Stopped,
)
from .judge_assessment import (
    Judgement as Judgement,
    Unpredictable as Unpredictable,
)
from .of_trials import strata_of as strata_of
from .parted_grasps import PartedGrasp as PartedGrasp
from .placement_error import (
    LIMIT_MM as LIMIT_MM,
    PlacementAgreement as PlacementAgreement,
)
from .record import (
    comparison_json as comparison_json,
    plain as plain,
)
from .run_agreement import (
    MarginDifference as MarginDifference,
    RunAgreement as RunAgreement,
)
from .standing_out import OutlierGroup as OutlierGroup
from .tables import comparison_tables as comparison_tables
from .wording import interval as interval
