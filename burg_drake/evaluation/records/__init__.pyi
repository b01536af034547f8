from .campaign_document import (
    CampaignDocument as CampaignDocument,
    SceneEntry as SceneEntry,
    campaign_differences as campaign_differences,
    campaign_hash as campaign_hash,
    require_same_campaign as require_same_campaign,
)
from .folder_lock import (
    Lock as Lock,
    is_locked as is_locked,
    unchanged as unchanged,
)
from .identity import (
    differences as differences,
    grasp_differences as grasp_differences,
    input_difference as input_difference,
    request_differences as request_differences,
    require_same_run as require_same_run,
    run_differences as run_differences,
    run_hash as run_hash,
    setting_differences as setting_differences,
)
from .journal import (
    JOURNAL_FILE as JOURNAL_FILE,
    LONGEST_LINE as LONGEST_LINE,
    Journal as Journal,
    encode as encode,
    journal_lines as journal_lines,
    read_journal as read_journal,
)
from .ledger import (
    LEDGER_FILE as LEDGER_FILE,
    Ledger as Ledger,
    SceneState as SceneState,
    ledger_text as ledger_text,
)
from .limit_numbers import (
    AS_MEASURED as AS_MEASURED,
    limit_settings as limit_settings,
)
from .motion_numbers import (
    motion_in as motion_in,
    motion_options as motion_options,
    motion_text as motion_text,
    without_motion as without_motion,
)
from .origin import (
    TrialOrigin as TrialOrigin,
    engine_label as engine_label,
    pairs_text as pairs_text,
    read_origin as read_origin,
    read_trial_settings as read_trial_settings,
)
from .rows import (
    best_rows as best_rows,
    rows_of as rows_of,
    unknown_grasp as unknown_grasp,
)
from .run_document import (
    HASH_DIGITS as HASH_DIGITS,
    Grasps as Grasps,
    Input as Input,
    Library as Library,
    RunDocument as RunDocument,
    TableFormat as TableFormat,
    WorkSession as WorkSession,
    begun_now as begun_now,
    input_of as input_of,
    input_reference as input_reference,
    numbers as numbers,
    origin_of as origin_of,
)
from .settings import EvaluationSettings as EvaluationSettings
from .shard import (
    Shard as Shard,
    as_shard as as_shard,
    share as share,
)
from .table import (
    TEXT as TEXT,
    Columns as Columns,
    columns_of_verdicts as columns_of_verdicts,
    make_columns as make_columns,
    table_row as table_row,
    trial_columns as trial_columns,
)
from .table_file import (
    is_table as is_table,
    read_table as read_table,
    require_table as require_table,
    require_writer as require_writer,
    write_table as write_table,
)
from .trial import (
    RecordedTrial as RecordedTrial,
    read_trial as read_trial,
)
