from .opening import (
    Opened as Opened,
    new_scene as new_scene,
    open_reference as open_reference,
    open_scene_file as open_scene_file,
)
from .scene_file import (
    FileChanged as FileChanged,
    UnsavedChanges as UnsavedChanges,
    fingerprint as fingerprint,
    scene_path as scene_path,
)
from .scene_storage import Storage as Storage
