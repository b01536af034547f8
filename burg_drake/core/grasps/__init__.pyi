from .column import (
    PLAIN as PLAIN,
    TEXT as TEXT,
    Column as Column,
)
from .column_meanings import (
    INPUT_PREFIX as INPUT_PREFIX,
    column_metadata as column_metadata,
    describe as describe,
    shown_axis as shown_axis,
    shown_figures as shown_figures,
    shown_number as shown_number,
    shown_title as shown_title,
    shown_unit as shown_unit,
)
from .csv_metadata_file import (
    csv_metadata as csv_metadata,
    metadata_path as metadata_path,
)
from .grasp_set import GraspSet as GraspSet
from .mode import (
    MODES as MODES,
    Mode as Mode,
)
from .outcome import (
    STAGES_AMONG as STAGES_AMONG,
    UNTRIED as UNTRIED,
    Among as Among,
    Outcome as Outcome,
    RealOutcome as RealOutcome,
    Stage as Stage,
    outcome_label as outcome_label,
)
from .provenance import parts_of as parts_of
from .storage import (
    FIXED_COLUMNS as FIXED_COLUMNS,
    FORMAT as FORMAT,
)
from .verdict import (
    CONTESTED as CONTESTED,
    Findings as Findings,
    Margins as Margins,
    TrialFindings as TrialFindings,
    Verdict as Verdict,
)
from .verdict_columns import (
    ARM_SCREEN_MARGINS as ARM_SCREEN_MARGINS,
    CPU_COLUMNS as CPU_COLUMNS,
    LIFT_HEIGHT as LIFT_HEIGHT,
    MARGINS as MARGINS,
    MOVED as MOVED,
    PREFIXES as PREFIXES,
    PUSHED as PUSHED,
    SMALLER_IS_BETTER as SMALLER_IS_BETTER,
    TRIAL_FINDINGS as TRIAL_FINDINGS,
    TRIAL_MARGINS as TRIAL_MARGINS,
    TURNED as TURNED,
    VERDICT_FIELDS as VERDICT_FIELDS,
    fields_in as fields_in,
    joined_findings as joined_findings,
    shown_order as shown_order,
)
from .verdict_field import (
    TableShape as TableShape,
    TextField as TextField,
    VerdictPart as VerdictPart,
)
