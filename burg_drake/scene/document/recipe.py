"""The recipe of sampled scenes: everything that, with a scene's number, decides about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from burg_drake.core import content_hash
from burg_drake.core.documents import dump_document, require_ranges
from burg_drake.scene.document.board import Board
from burg_drake.scene.document.layout import TRIES, LayoutName, PoseChoice

ATTEMPTS = 100
"""Whole scenes that are drawn until one is accepted."""

RANGES = {
    "count": (1, 1000),
    "seed": (0, (1 << 64) - 1),
    "tries": (1, 1_000_000),
    "attempts": (1, 100_000),
    "clear_grasps": (0, 1_000_000),
}


@dataclass(frozen=True, kw_only=True)
class SceneRecipe:
    """How scenes are drawn. All of its values are written, as defaults may change one day.

    Attributes:
        library: folder of the object library, relative to the recipe's file; or a built-in name.
        count: objects in a scene.
        only: names of the objects to draw from; all that can stand if empty.
        repeat: an object may be there several times.
        board: that they stand on.
        layout: how they stand to one another.
        poses: how stable poses are drawn.
        tries: random places that are tried for an object.
        fewer: a scene in which not all have found a place is accepted, too.
        seed: all scenes of another seed are others.
        station: file of the station, relative to the recipe's file; or a built-in name. Its boxes
            are in the way, on its table scenes are settled, and its arm and cameras are asked.
        settle: let objects come to rest in simulation.
        attempts: whole scenes that are drawn until one is accepted.
        within_reach: every object is within the reach of the station's arm.
        clear_grasps: so many grasps of every object are clear of all others, at least.
        visible_from: this camera of the station, if given, sees half of every object's silhouette,
            at least.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    library: str
    count: int = 6
    only: tuple[str, ...] = ()
    repeat: bool = False
    board: Board = Board()
    layout: LayoutName = "random"
    poses: PoseChoice = "probability"
    tries: int = TRIES
    fewer: bool = False
    seed: int = 0
    station: str = "panda_tabletop"
    settle: bool = True
    attempts: int = ATTEMPTS
    within_reach: bool = False
    clear_grasps: int = 0
    visible_from: str = ""

    def __post_init__(self) -> None:
        require_ranges(self, RANGES)

    @property
    def content(self) -> str:
        """Hash of all but where library and station are: seeds of scenes follow from it."""
        return content_hash(dump_document(replace(self, library="", station="")))
