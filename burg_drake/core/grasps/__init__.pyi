from .columns import (
    GIVEN as GIVEN,
    PLAIN as PLAIN,
    TEXT as TEXT,
    Column as Column,
    describe as describe,
)
from .csv_metadata_file import (
    csv_metadata as csv_metadata,
    metadata_path as metadata_path,
)
from .grasp_set import GraspSet as GraspSet
from .outcome import (
    UNTRIED as UNTRIED,
    Outcome as Outcome,
    RealOutcome as RealOutcome,
    Stage as Stage,
)
from .provenance import parts_of as parts_of
from .storage import (
    FIXED_COLUMNS as FIXED_COLUMNS,
    FORMAT as FORMAT,
)
