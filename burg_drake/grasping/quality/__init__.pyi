from .contacts import (
    are_antipodal as are_antipodal,
    grasp_contacts as grasp_contacts,
)
from .jaws import (
    Jaws as Jaws,
    jaws_of as jaws_of,
)
from .metrics import (
    DEFAULT_METRIC as DEFAULT_METRIC,
    METRICS as METRICS,
    Payload as Payload,
    check_metric as check_metric,
    grasp_quality as grasp_quality,
    quality_provenance as quality_provenance,
    score_of as score_of,
)
