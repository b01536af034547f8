from .actions import (
    ViewActions as ViewActions,
    placement_summary as placement_summary,
)
from .event_log import (
    Event as Event,
    EventLog as EventLog,
)
from .frame_processing import (
    FrameProcessor as FrameProcessor,
    LocatedFrame as LocatedFrame,
    ViewSettings as ViewSettings,
    placing_order as placing_order,
    pose_line as pose_line,
    position_sd as position_sd,
)
from .picture import Picture as Picture
from .recording_files import require_video_path as require_video_path
from .session import LiveSession as LiveSession
from .snapshot import require_new_folder as require_new_folder
