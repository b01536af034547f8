"""A scene while it is composed by hand: commands, history, journal and status, without any page.

Read `session` first. `state` holds what is edited, the commands (`*_commands`) change it, and
`editor` keeps the history and publishes views.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "AddObject",
    "Align",
    "BackgroundJob",
    "Clear",
    "Command",
    "ComposeSession",
    "Delete",
    "Distribute",
    "Drag",
    "DragOwner",
    "Duplicate",
    "Editor",
    "FileChanged",
    "History",
    "HistoryStep",
    "MoveObjects",
    "OpenedScene",
    "PutDown",
    "RandomConfiguration",
    "Rename",
    "SceneChecker",
    "SceneInUse",
    "SceneLock",
    "SceneStorage",
    "SessionView",
    "SetBoard",
    "SetFixed",
    "SetPose",
    "SettlingProposal",
    "SnapToContact",
    "SnapToGrid",
    "State",
    "Surroundings",
    "Turn",
    "UnsavedChanges",
    "board_size",
    "board_size_name",
]


def __dir__() -> list[str]:
    return __all__
