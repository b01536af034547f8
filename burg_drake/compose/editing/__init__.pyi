from .background_editor import BackgroundEditor as BackgroundEditor
from .drag import Drag as Drag
from .library_watch import (
    LibraryWatch as LibraryWatch,
    UseLibrary as UseLibrary,
    changes_notice as changes_notice,
)
from .view import (
    STATUS as STATUS,
    SessionView as SessionView,
)
