from .page import (
    REPORT_FILE as REPORT_FILE,
    write_gap_report as write_gap_report,
)
from .rejudging import (
    rejudged_section as rejudged_section,
    rejudged_view as rejudged_view,
)
from .sentences import step_sentences as step_sentences
from .tables import (
    gap_json as gap_json,
    reality_view as reality_view,
    steps_view as steps_view,
)
