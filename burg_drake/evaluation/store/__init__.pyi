from .campaign_folder import (
    CAMPAIGN_FILE as CAMPAIGN_FILE,
    LOCK_FILE as LOCK_FILE,
    SCENES_FOLDER as SCENES_FOLDER,
    Campaign as Campaign,
    is_campaign as is_campaign,
    load_campaign as load_campaign,
    require_campaign_folder as require_campaign_folder,
    save_campaign as save_campaign,
)
from .inputs import (
    Inputs as Inputs,
    find_inputs as find_inputs,
)
from .journal_tail import (
    JournalTail as JournalTail,
    tails_of as tails_of,
)
from .loading import (
    load_runs as load_runs,
    open_results as open_results,
    read_results as read_results,
)
from .part_file import require_arrow as require_arrow
from .part_store import (
    PARTS_FOLDER as PARTS_FOLDER,
    PartIndex as PartIndex,
    StoredRun as StoredRun,
)
from .part_writer import (
    PART_ROWS as PART_ROWS,
    PartWriter as PartWriter,
    keep_parts as keep_parts,
)
from .plan_folder import (
    PlanFolder as PlanFolder,
    PlanFormat as PlanFormat,
    PlanOutput as PlanOutput,
    plans_document as plans_document,
)
from .run_folder import (
    GRASPS_FILE as GRASPS_FILE,
    JOURNAL_FILE as JOURNAL_FILE,
    REPORT_FILE as REPORT_FILE,
    RUN_FILE as RUN_FILE,
    SCENE_FILE as SCENE_FILE,
    STATION_FILE as STATION_FILE,
    Run as Run,
    create_run as create_run,
    load_run as load_run,
    portable_station as portable_station,
    require_run_folder as require_run_folder,
    save_run as save_run,
    write_copies as write_copies,
)
from .stored_rows import StoredRows as StoredRows
from .text_codes import (
    Texts as Texts,
    member_codes as member_codes,
    texts_of as texts_of,
)
