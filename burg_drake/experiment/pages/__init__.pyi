from .lab_book import (
    EntryConflict as EntryConflict,
    LabBook as LabBook,
    LabEntry as LabEntry,
    entry_data as entry_data,
    plan_data as plan_data,
    states as states,
)
from .lab_camera import LabCamera as LabCamera
from .picture_cache import PictureCache as PictureCache
from .protocol import (
    SheetOptions as SheetOptions,
    sheet_page as sheet_page,
)
from .trial_pictures import TrialPictures as TrialPictures
from .tried_runs import (
    TriedRuns as TriedRuns,
    in_blocks as in_blocks,
)
