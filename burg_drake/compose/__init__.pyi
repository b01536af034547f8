from .background.process import BackgroundJob as BackgroundJob
from .background.settling import SettlingProposal as SettlingProposal
from .commands.arranging import (
    Align as Align,
    Distribute as Distribute,
)
from .commands.board import (
    SetBoard as SetBoard,
    board_size as board_size,
    board_size_name as board_size_name,
)
from .commands.command import Command as Command
from .commands.contact import (
    PutDown as PutDown,
    SnapToContact as SnapToContact,
)
from .commands.moving import (
    MoveObjects as MoveObjects,
    SetPose as SetPose,
    SnapToGrid as SnapToGrid,
    Turn as Turn,
)
from .commands.placing import (
    AddObject as AddObject,
    Clear as Clear,
    Delete as Delete,
    Duplicate as Duplicate,
    Rename as Rename,
    SetFixed as SetFixed,
)
from .commands.random_configuration import RandomConfiguration as RandomConfiguration
from .document.checker import SceneChecker as SceneChecker
from .document.history import (
    History as History,
    HistoryStep as HistoryStep,
)
from .document.state import State as State
from .document.surroundings import Surroundings as Surroundings
from .editing.drag import (
    Drag as Drag,
    DragOwner as DragOwner,
)
from .editing.editor import Editor as Editor
from .editing.view import SessionView as SessionView
from .session import ComposeSession as ComposeSession
from .storage.opening import Opened as Opened
from .storage.scene_file import (
    FileChanged as FileChanged,
    UnsavedChanges as UnsavedChanges,
)
from .storage.scene_lock import (
    SceneInUse as SceneInUse,
    SceneLock as SceneLock,
)
from .storage.scene_storage import Storage as Storage
