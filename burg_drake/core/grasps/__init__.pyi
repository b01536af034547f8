from .columns import (
    INPUT_PREFIX as INPUT_PREFIX,
    PLAIN as PLAIN,
    TEXT as TEXT,
    Column as Column,
    describe as describe,
)
from .csv_metadata_file import (
    csv_metadata as csv_metadata,
    metadata_path as metadata_path,
)
from .grasp_set import (
    FIXED_COLUMNS as FIXED_COLUMNS,
    GraspSet as GraspSet,
    parts_of as parts_of,
)
from .outcome import (
    UNTRIED as UNTRIED,
    Outcome as Outcome,
    RealOutcome as RealOutcome,
    Stage as Stage,
)
from .storage import FORMAT as FORMAT
