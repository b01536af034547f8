"""Samples one scene: draws until one is accepted, and counts what was wrong with the others.

All that is random follows from the recipe's content, the scene's number and that of the attempt: a
scene is the same alone, among others, and on any worker.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import (
    content_hash,
    rng_from,
    software_versions,
)
from burg_drake.evaluation.records import (
    HASH_DIGITS,
)
from burg_drake.generation.heap import settle_heap
from burg_drake.generation.rules import broken_rule, require_rules
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.arrangement import ObjectRequest, ObjectShapes, arrange, choose
from burg_drake.scene.document import (
    SamplingProvenance,
    Scene,
    SceneDocument,
    SceneOrigin,
    SceneRecipe,
)
from burg_drake.simulation.settling import settle_scene
from burg_drake.station.checks import SceneCheck, surface_issues
from burg_drake.station.document import (
    MODEL_NAMES,
    Station,
    StationLike,
    as_station,
    boxes_in_scene,
)

SAME_OBJECTS_SHARE = 0.8
"""Share of the attempts in which a scene keeps the objects that were drawn for it: poses and places
are drawn anew first, so that objects that are refused often do not get rare. Others are drawn for
the last attempts, so that a set for which there is no room does not cost the scene."""

NO_ROOM = "an object found no place"
REASONS = {
    "out_of_bounds": "an object came to rest beyond the edge of the board or table",
    "in_ground": "an object reaches into the table",
    "overlap": "objects overlap each other or what stands around the board",
}
"""Why a scene is refused, by what is wrong with it."""
FALLEN = "an object fell off the table"
MOVING = "an object did not come to rest"


@dataclass(frozen=True)
class SampledScene:
    """What came of a number.

    Attributes:
        scene: the accepted scene; if none was, the attempt with the most objects, without origin.
        number: of the scene.
        accepted: it fulfils all that the recipe asks for.
        missing: names of objects that found no place in it.
        attempts: scenes that were drawn.
        tries: places that were looked at.
        refused: how many attempts were refused, by reason.
    """

    scene: Scene
    number: int
    accepted: bool
    missing: tuple[str, ...]
    attempts: int
    tries: int
    refused: Mapping[str, int]

    @property
    def placed(self) -> int:
        """Number of objects in the scene."""
        return len(self.scene.instances)


class SceneSampler:
    """Samples scenes of a recipe, with the library's shapes at hand."""

    def __init__(self, recipe: SceneRecipe, library: ObjectLibrary, station: Station) -> None:
        """
        Raises:
            UnknownNameError, InvalidInputError: see `require_possible`; or the station's robot
                cannot be built.
        """
        require_possible(recipe, library, station)
        self.recipe, self.library, self.station = recipe, library, station
        self.provenance = provenance_of(recipe, library, station)
        self._content = recipe.content
        self._shapes = ObjectShapes(library)
        self._check = SceneCheck(station, library)
        self._obstacles = boxes_in_scene(station)

    def sample(
        self,
        number: int,
        folder: Path | None = None,
        *,
        refused: Callable[[], None] | None = None,
    ) -> SampledScene:
        """The scene of a number.

        Args:
            number: from 0.
            folder: of the file that the scene is to be written to.
            refused: called when an attempt was.

        Raises:
            BurgError: the station or an object cannot be built.
        """
        reasons: Counter[str] = Counter()
        tries = 0
        best: tuple[Scene, tuple[str, ...]] | None = None
        for attempt in range(1, self.recipe.attempts + 1):
            scene, missing, used = self._draw(number, attempt, folder or Path())
            tries += used
            enough = not missing or (self.recipe.fewer and bool(scene.instances))
            again = rng_from("dropped again", self._content, number, attempt)
            reason, scene = self._settled(scene, again) if enough else (NO_ROOM, scene)
            if not reason:
                scene = self._with_origin(scene, number, attempt)
                return SampledScene(scene, number, True, missing, attempt, tries, dict(reasons))
            reasons[reason] += 1
            if refused is not None:
                refused()
            if best is None or len(scene.instances) > len(best[0].instances):
                best = scene, missing
        assert best is not None
        return SampledScene(
            best[0], number, False, best[1], self.recipe.attempts, tries, dict(reasons)
        )

    def _draw(self, number: int, attempt: int, folder: Path) -> tuple[Scene, tuple[str, ...], int]:
        """An attempt before it is settled, what is missing in it, and the tries that it took."""
        recipe = self.recipe
        first = 1 if attempt <= attempts_with_same_objects(recipe) else attempt
        rng = rng_from("sampled scene", self._content, number, first)
        wanted = _chosen(recipe, self.library, self.station, rng)
        if attempt != first:
            rng = rng_from("sampled scene", self._content, number, attempt)
        laid_out = arrange(
            wanted,
            self._shapes,
            recipe.board,
            rng,
            layout=recipe.layout,
            poses=recipe.poses,
            obstacles=self._obstacles,
            tries=recipe.tries,
            needs_all=not recipe.fewer,
        )
        name = f"scene_{number:04d}"
        document = SceneDocument(
            name=name, library=recipe.library, board=recipe.board, instances=laid_out.instances
        )
        scene = Scene(document, self.library, folder / f"{name}.yaml")
        return scene, laid_out.missing, laid_out.tries

    def _settled(self, scene: Scene, rng: np.random.Generator) -> tuple[str, Scene]:
        """The first reason to refuse a scene, if any, and the scene at rest."""
        found = self._faults(scene)
        if found:
            return found, scene
        if self.recipe.settle and self.recipe.layout == "heap":
            heap = settle_heap(scene, self.station, self._check, self._shapes, rng)
            scene = heap.scene
            if heap.faulty:
                return self._faults(scene) or MOVING, scene
        elif self.recipe.settle:
            settled = settle_scene(scene, self.station)
            if settled.fallen or settled.moving:
                return FALLEN if settled.fallen else MOVING, scene
            scene = settled.scene
            found = self._faults(scene)
            if found:
                return found, scene
        return broken_rule(scene, self.station, self.recipe), scene

    def _faults(self, scene: Scene) -> str:
        """What keeps a scene from being built as its document says; "" if nothing does.

        A heap is too dear to be dropped again for surfaces that overlap.
        """
        kinds = {issue.kind for issue in self._check.issues(scene) if issue.is_error}
        if not kinds and self.recipe.layout != "heap" and surface_issues(scene):
            kinds.add("overlap")
        return next((reason for kind, reason in REASONS.items() if kind in kinds), "")

    def _with_origin(self, scene: Scene, number: int, attempt: int) -> Scene:
        origin = SceneOrigin(**vars(self.provenance), number=number, attempt=attempt)
        return Scene(replace(scene.document, origin=origin), scene.library, scene.path)


def attempts_with_same_objects(recipe: SceneRecipe) -> int:
    """Number of attempts in which a scene keeps the objects that were drawn for it."""
    return max(1, round(SAME_OBJECTS_SHARE * recipe.attempts))


def sample_scene(
    recipe: SceneRecipe,
    library: ObjectLibrary | None = None,
    station: StationLike | None = None,
    *,
    number: int = 0,
) -> SampledScene:
    """Samples one scene of a recipe.

    Example::

        recipe = burg.SceneRecipe(library="household", count=5, layout="close", seed=3)
        sampled = burg.sample_scene(recipe)
        if sampled.accepted:
            burg.save_scene(sampled.scene.document, "close.yaml")

    Args:
        recipe: how scenes are drawn.
        library: the object library; that of the recipe, from the current folder, if None.
        station: likewise.
        number: of the scene: another one for each, from 0.

    Raises:
        UnknownNameError, InvalidInputError: the recipe asks for what is not there.
        BurgError: the station or an object cannot be built.
    """
    library = library or load_library(recipe.library)
    station = as_station(recipe.station if station is None else station)
    return SceneSampler(recipe, library, station).sample(number)


def provenance_of(
    recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> SamplingProvenance:
    """What scenes of a recipe are made with here and now."""
    return SamplingProvenance(
        recipe=recipe,
        library_content=content_hash(library.content)[:HASH_DIGITS],
        station_content=station.content[:HASH_DIGITS],
        versions=software_versions(),
    )


def require_possible(recipe: SceneRecipe, library: ObjectLibrary, station: Station) -> None:
    """Refuses a recipe that no scene can come of, before anything is built.

    Raises:
        UnknownNameError: it asks for objects or for a camera that are not there.
        InvalidInputError: there are fewer objects than it asks for; or it asks for the reach of an
            arm, and the station has none.
    """
    _chosen(recipe, library, station, rng_from("who is there"))
    require_rules(recipe, station)


def _chosen(
    recipe: SceneRecipe, library: ObjectLibrary, station: Station, rng: np.random.Generator
) -> tuple[ObjectRequest, ...]:
    return choose(
        library,
        recipe.count,
        rng,
        only=recipe.only,
        repeat=recipe.repeat,
        taken=(*MODEL_NAMES, *station.document.background),
    )
