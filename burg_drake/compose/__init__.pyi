from .background_tasks import (
    BackgroundJob as BackgroundJob,
    BackgroundWorker as BackgroundWorker,
    SettlingProposal as SettlingProposal,
    names_of_moved_instances as names_of_moved_instances,
)
from .commands import (
    BOARD_SIZES as BOARD_SIZES,
    Command as Command,
    SetBoard as SetBoard,
    board_size as board_size,
    board_size_name as board_size_name,
)
from .editor import Drag as Drag, DragOwner as DragOwner, Editor as Editor
from .journal import journal_path as journal_path, recover_journal as recover_journal
from .moving_commands import (
    Align as Align,
    Axis as Axis,
    Direction as Direction,
    Distribute as Distribute,
    Edge as Edge,
    MoveObjects as MoveObjects,
    PutDown as PutDown,
    SetPose as SetPose,
    SnapToContact as SnapToContact,
    SnapToGrid as SnapToGrid,
    Turn as Turn,
)
from .placing_commands import (
    MAX_RANDOM_OBJECTS as MAX_RANDOM_OBJECTS,
    AddObject as AddObject,
    Clear as Clear,
    Delete as Delete,
    Duplicate as Duplicate,
    RandomConfiguration as RandomConfiguration,
    Rename as Rename,
    SetFixed as SetFixed,
)
from .scene_checker import (
    SceneChecker as SceneChecker,
    Surroundings as Surroundings,
    instance_bounds as instance_bounds,
    missing_objects as missing_objects,
    nearest_stable_pose as nearest_stable_pose,
    scene_of_known_objects as scene_of_known_objects,
)
from .scene_storage import (
    FileChanged as FileChanged,
    OpenedScene as OpenedScene,
    SceneInUse as SceneInUse,
    SceneLock as SceneLock,
    SceneStorage as SceneStorage,
    UnsavedChanges as UnsavedChanges,
)
from .session import ComposeSession as ComposeSession
from .session_view import STATUS_OF_ISSUE as STATUS_OF_ISSUE, SessionView as SessionView
from .state import (
    History as History,
    HistoryStep as HistoryStep,
    State as State,
    instance_name as instance_name,
)
