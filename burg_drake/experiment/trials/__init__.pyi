from .book import (
    TrialBook as TrialBook,
    TrialChanged as TrialChanged,
)
from .entries import (
    Entry as Entry,
    MissingValues as MissingValues,
    entered as entered,
    journal_path as journal_path,
    read_entries as read_entries,
)
from .evidence import (
    keep_evidence as keep_evidence,
    measured as measured,
    object_places as object_places,
    require_same_scene as require_same_scene,
    require_scene as require_scene,
)
from .export import (
    INDEX_FILE as INDEX_FILE,
    ExportedMotion as ExportedMotion,
    export_trials as export_trials,
)
from .given_entry import real_outcome as real_outcome
from .sheet import (
    Balance as Balance,
    ObjectPlace as ObjectPlace,
    RealTrial as RealTrial,
    RobotReport as RobotReport,
    Selection as Selection,
    SourceRun as SourceRun,
    Stratum as Stratum,
    Success as Success,
    TrialSheet as TrialSheet,
    load_trials as load_trials,
    save_trials as save_trials,
    succeeded as succeeded,
)
from .sources import (
    grasp_content as grasp_content,
    grasp_contents as grasp_contents,
    load_run_of as load_run_of,
    load_sources as load_sources,
    source_of as source_of,
    trial_rows as trial_rows,
)
