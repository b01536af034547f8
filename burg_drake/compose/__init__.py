"""Composing a scene by hand: document, selection, commands and history, without any page."""

from __future__ import annotations

from burg_drake.core.lazy import attach

__all__, __getattr__, __dir__ = attach(
    __name__,
    {
        "burg_drake.compose.arranging": ["Align", "Distribute"],
        "burg_drake.compose.board_change": ["SetBoard", "board_size", "board_size_name"],
        "burg_drake.compose.contact": ["PutDown", "SnapToContact"],
        "burg_drake.compose.drag": ["Drag"],
        "burg_drake.compose.moving": ["Move", "SetPose", "SnapToGrid", "Turn"],
        "burg_drake.compose.placing": [
            "AddObject",
            "Clear",
            "Delete",
            "Duplicate",
            "Rename",
            "SetFixed",
        ],
        "burg_drake.compose.random_configuration": ["RandomConfiguration"],
        "burg_drake.compose.scene_file": ["FileChanged", "UnsavedChanges"],
        "burg_drake.compose.scene_lock": ["SceneInUse"],
        "burg_drake.compose.session": ["ComposeSession"],
        "burg_drake.compose.settling": ["Proposal"],
        "burg_drake.compose.view": ["View"],
    },
)
