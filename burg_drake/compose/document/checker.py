"""What is wrong with a scene while it is composed, even if its library lacks some objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.compose.document.bounds_on_board import bounds
from burg_drake.compose.document.state import State
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.arrangement import ObjectShapes
from burg_drake.scene.document import TOUCH_TOLERANCE, Scene, SceneDocument, SceneIssue
from burg_drake.station.document import StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.station.checks import SceneCheck


class SceneChecker:
    """Checks states on one station; to be used by one thread at a time.

    Args:
        station: where scenes stand.
    """

    def __init__(self, station: StationLike) -> None:
        self._station = as_station(station)
        self._check: SceneCheck | None = None
        self._library: ObjectLibrary | None = None
        self._shapes: ObjectShapes | None = None
        self._state: State | None = None
        self._issues: tuple[SceneIssue, ...] = ()

    def issues(self, state: State, path: Path) -> tuple[SceneIssue, ...]:
        """What is wrong, but for instances whose object is lost.

        Args:
            state: scene and library.
            path: of the scene's file, for messages.

        Raises:
            BurgError: it cannot be checked: a file of an object is missing, for example.
        """
        known = self._state
        if known and known.document == state.document and known.library is state.library:
            return self._issues
        issues = self.check(state).issues(known_scene(state, path))
        self._state, self._issues = state, issues
        return issues

    def gaps(self, state: State, path: Path) -> dict[str, float]:
        """Free way straight down of each selected instance that touches nothing below it [m].

        Args:
            state: scene, library and selection.
            path: of the scene's file, for messages.

        Raises:
            BurgError: see `issues`.
        """
        found, missing = {}, missing_objects(state)
        for name in state.selection:
            if name in missing or (height := float(bounds(state, name)[0, 2])) <= TOUCH_TOLERANCE:
                continue
            down = (0.0, 0.0, -1.0)
            gap = self.check(state).travel(known_scene(state, path), (name,), down, height)
            if gap > TOUCH_TOLERANCE:
                found[name] = gap
        return found

    def check(self, state: State) -> SceneCheck:
        """What knows of the objects of a state's library, and of contact between them."""
        from burg_drake.station.checks import SceneCheck

        if self._check is None or self._library is not state.library:
            self._check, self._library = SceneCheck(self._station, state.library), state.library
        return self._check


def shapes_for(checker: SceneChecker, state: State) -> ObjectShapes:
    """The shapes of a state's library, which a checker keeps as it keeps its other knowledge."""
    if checker._shapes is None or checker._shapes.library is not state.library:
        checker._shapes = ObjectShapes(state.library)
    return checker._shapes


def missing_objects(state: State) -> tuple[str, ...]:
    """Instances whose object is not in the library any more."""
    return tuple(n for n, i in state.instances.items() if i.object not in state.library.objects)


def known_scene(state: State, path: Path) -> Scene:
    """The scene without lost instances."""
    names = missing_objects(state)
    if not names:
        return state.scene(path)
    missing = [state.instance(name) for name in names]
    document = replace(
        state.document,
        instances=tuple(i for i in state.document.instances if i not in missing),
        background=tuple(i for i in state.document.background if i not in missing),
    )
    return Scene(document, state.library, path)


def with_missing_objects(document: SceneDocument, state: State) -> SceneDocument:
    """What became of a `known_scene`, with the instances that it was without."""
    missing = [state.instance(name) for name in missing_objects(state)]
    return replace(
        document,
        instances=(*document.instances, *(i for i in state.document.instances if i in missing)),
        background=(*document.background, *(i for i in state.document.background if i in missing)),
    )
