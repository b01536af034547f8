"""Scenes of cans, for runs of benchmarks."""

from __future__ import annotations

from pathlib import Path

import burg_drake as burg
from burg_drake.core import Pose
from burg_drake.scene import Board, Instance, Scene, SceneDocument


def cans(name: str, *places: tuple[float, float], board: Board = Board()) -> Scene:
    """Standing cans at places of the board."""
    library = burg.load_library("household")
    height = library.entry("can").lower[2]
    instances = tuple(
        Instance(name=f"can_{k}", object="can", X_SO=Pose((x, y, -height)))
        for k, (x, y) in enumerate(places)
    )
    document = SceneDocument(name=name, library="household", board=board, instances=instances)
    return Scene(document, library, Path(f"{name}.yaml"))
