"""The recipe of sampled scenes: everything that, with a scene's number, decides about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, get_args

from burg_drake.core import LARGEST_SEED, content_hash, setting
from burg_drake.core.documents import dump_document, require_ranges
from burg_drake.scene.document.board import Board
from burg_drake.scene.document.layout import TRIES, LayoutName, PoseChoice

ATTEMPTS = 100
"""Whole scenes that are drawn until one is accepted."""

RANGES = {
    "count": (1, 1000),
    "seed": (0, LARGEST_SEED),
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
    repeat: bool = setting(False, "allow an object several times in a scene")
    board: Board = Board()
    layout: LayoutName = "random"
    poses: PoseChoice = setting(
        "probability", "how to choose an object's stable pose", choices=get_args(PoseChoice)
    )
    tries: int = setting(TRIES, "random places to try for each object", metavar="K", low=1)
    fewer: bool = setting(False, "accept scenes with fewer objects if some found no place")
    seed: int = setting(0, "random seed", high=LARGEST_SEED)
    station: str = "panda_tabletop"
    settle: bool = setting(True, "do not settle objects in simulation", name="no_settle")
    attempts: int = setting(ATTEMPTS, "scenes to sample until one is accepted", low=1)
    within_reach: bool = setting(False, "require that the arm can grasp each object")
    clear_grasps: int = setting(
        0,
        "require K grasps on each object with a clear hand",
        metavar="K",
        low=1,
    )
    visible_from: str = setting(
        "",
        "require that this camera of the station sees half of each object",
        metavar="CAMERA",
    )

    def __post_init__(self) -> None:
        require_ranges(self, RANGES)

    @property
    def content(self) -> str:
        """Hash of all but where library and station are: seeds of scenes follow from it."""
        return content_hash(dump_document(replace(self, library="", station="")))
