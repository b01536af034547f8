"""The recipe of sampled scenes: everything that, with a scene's number, decides about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, get_args

from burg_drake.core import LARGEST_SEED, content_hash, setting
from burg_drake.core.documents import Ranges, dump_document, require_ranges
from burg_drake.scene.document.board import Board
from burg_drake.scene.document.layout import TRIES, LayoutName, PoseChoice

ATTEMPTS = 100
"""Whole scenes that are drawn until one is accepted."""


@dataclass(frozen=True, kw_only=True)
class SceneRecipe:
    """How scenes are drawn.

    Example::

        recipe = burg.SceneRecipe(library="household", count=6, layout="close", seed=7)
        burg.save_scene(burg.sample_scene(recipe).scene.document, "lunch.yaml")

    Files have all of its values, because defaults may change between versions.

    Attributes:
        library: object library: its folder, relative to this file, or the name of a built-in one.
        count: number of objects in a scene.
        only: names of the objects to draw from; all that can stand if empty.
        repeat: whether an object may be in a scene several times.
        board: the board on which the objects stand.
        layout: `random`: anywhere. `wide`: with room for fingers in between. `close`, `touching`:
            beside one another, a few millimetres apart or in contact. `packed`: as dense as
            possible. `heap`: dropped on a spot.
        poses: which stable pose an object gets: by probability, each as often (`uniform`), or as
            its mesh stands (`as_scanned`).
        tries: number of random places tried for each object.
        fewer: whether a scene is accepted in which some objects found no place.
        seed: seed of all random choices; another one gives other scenes.
        station: station: its file, relative to this file, or the name of a built-in one. Its boxes
            are obstacles, objects come to rest on its table, and `within_reach` and `visible_from`
            are about its arm and cameras.
        settle: whether objects come to rest in simulation.
        attempts: number of drafts of a scene until the attempt is given up.
        within_reach: whether the arm has to be able to grasp every object.
        clear_grasps: number of grasps that have to be free of collisions for every object.
        visible_from: name of a camera of the station that has to see at least half of every object;
            none if empty.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "count": (1, 1000),
        "seed": (0, LARGEST_SEED),
        "tries": (1, 1_000_000),
        "attempts": (1, 100_000),
        "clear_grasps": (0, 1_000_000),
    }

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
        require_ranges(self)

    @property
    def content(self) -> str:
        """Hash of all but where library and station are: seeds of scenes follow from it."""
        return content_hash(dump_document(replace(self, library="", station="")))
