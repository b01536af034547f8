"""Scenes of household objects, composed for the tests of what is counted while composing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from burg_drake.core import Pose
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene


def composed(*placed: tuple[str, str, float, float, float]) -> Scene:
    """A scene of the household library.

    Args:
        placed: name, object, x and y [m] and turn about the vertical [degrees] of each object,
            which stands as its mesh does.
    """
    instances = tuple(
        Instance(name=name, object=object, X_SO=Pose((x, y, 0.0), rpy_deg=(0.0, 0.0, yaw)))
        for name, object, x, y, yaw in placed
    )
    document = SceneDocument(name="composed", library="household", instances=instances)
    return Scene(document, load_library("household"), Path("composed.yaml"))


def tabletop(*names: str) -> Scene:
    """The built-in scene `tabletop_six` with these of its instances and no others."""
    six = load_scene("tabletop_six")
    return replace(six, document=replace(six.document, instances=tuple(map(six.instance, names))))
