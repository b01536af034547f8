"""Samples single scenes of a recipe until one is accepted, and reproduces sampled scenes.

A scene is accepted if its objects are at rest on the board and it fulfils the recipe's rules.
Refused attempts are counted by reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from burg_drake.cameras import visible_from
from burg_drake.core import (
    InvalidInputError,
    SimulationError,
    UnknownNameError,
    content_hash,
    resolve_reference,
    rng_from,
    software_versions,
    suggest_names,
)
from burg_drake.evaluation import HASH_DIGITS, clear_grasp_counts, within_reach
from burg_drake.generation.heap_settling import settle_heap
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import (
    ObjectRequest,
    ObjectShapes,
    SamplingProvenance,
    Scene,
    SceneDocument,
    SceneOrigin,
    SceneRecipe,
    arrange,
    choose_objects,
)
from burg_drake.simulation import settle_scene
from burg_drake.station import (
    MODEL_NAMES,
    SceneCheck,
    Station,
    StationLike,
    as_station,
    load_station,
    obstacle_corners,
    surface_issues,
)

FEW_GRASPS_REASON = "an object has too few clear grasps"
HIDDEN_REASON = "the camera does not see half of an object"


def require_possible_rules(recipe: SceneRecipe, station: Station) -> None:
    """Refuses rules that cannot be checked on a station.

    Raises:
        UnknownNameError: the station has no such camera.
        InvalidInputError: a rule requires an arm, and the station has none.
    """
    cameras = station.document.cameras
    if recipe.visible_from and recipe.visible_from not in cameras:
        raise UnknownNameError(
            f"station {station.name!r} has no camera {recipe.visible_from!r};"
            f" {suggest_names(recipe.visible_from, cameras)}"
        )
    if recipe.within_reach and station.document.arm is None:
        raise InvalidInputError(
            f"within_reach needs an arm, but station {station.name!r} has none; choose another"
            " station"
        )


def find_broken_rule(scene: Scene, station: Station, recipe: SceneRecipe) -> str:
    """The first rule of a recipe that a scene breaks, as a reason to refuse it; "" if none.

    Raises:
        BurgError: the arm collides in its home posture, for example; see
            `evaluation.clear_grasp_counts`.
    """
    if recipe.visible_from:
        seen = visible_from(scene, station, recipe.visible_from)
        if min(seen.values(), default=0.0) < 0.5:  # of an object's silhouette
            return HIDDEN_REASON
    if recipe.clear_grasps:
        sampled = max(50, 2 * recipe.clear_grasps)
        clear = clear_grasp_counts(scene, station, grasps_per_object=sampled)
        if min(clear.values(), default=0) < recipe.clear_grasps:
            return FEW_GRASPS_REASON
    if recipe.within_reach and within_reach(scene, station):
        return "an object is out of the arm's reach"
    return ""


ISSUE_REASONS = {
    "out_of_bounds": "an object came to rest beyond the edge of the board or table",
    "in_ground": "an object reaches into the table",
    "overlap": "objects overlap each other or what stands around the board",
}
"""Reason to refuse a scene, by kind of issue."""


@dataclass(frozen=True)
class SampledScene:
    """Result of sampling a scene.

    Attributes:
        scene: the accepted scene; or else the attempt with the most objects, without origin.
        number: number of the scene.
        accepted: whether the scene fulfils the recipe.
        missing: names of objects without a free place.
        attempts: number of scenes drawn.
        tries: number of object poses tried.
        refused: number of refused attempts, by reason.
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
    """Samples scenes of a recipe; keeps the library's shapes in memory."""

    def __init__(self, recipe: SceneRecipe, library: ObjectLibrary, station: Station) -> None:
        """
        Raises:
            UnknownNameError, InvalidInputError: see `require_possible_recipe`; or the station's
                robot cannot be built.
        """
        require_possible_recipe(recipe, library, station)
        self.recipe, self.library, self.station = recipe, library, station
        self.provenance = sampling_provenance(recipe, library, station)
        self._content = recipe.content
        self._shapes = ObjectShapes(library)
        self._check = SceneCheck(station, library)
        self._obstacles = obstacle_corners(station)

    def sample(
        self,
        number: int,
        folder: Path | None = None,
        *,
        refused: Callable[[], None] | None = None,
    ) -> SampledScene:
        """Samples a scene.

        Args:
            number: number of the scene, from 0; seeds all random choices.
            folder: folder of the scene's file.
            refused: called after each refused attempt.

        Raises:
            BurgError: the station or an object cannot be built.
        """
        reasons: Counter[str] = Counter()
        tries = 0
        best: tuple[Scene, tuple[str, ...]] | None = None
        for attempt in range(1, self.recipe.attempts + 1):
            scene, missing, used = self._draw_scene(number, attempt, folder or Path())
            tries += used
            enough = not missing or (self.recipe.fewer and bool(scene.instances))
            again = rng_from("dropped again", self._content, number, attempt)
            reason, scene = (
                self._settle_or_refuse(scene, again)
                if enough
                else ("an object found no place", scene)
            )
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

    def _draw_scene(
        self, number: int, attempt: int, folder: Path
    ) -> tuple[Scene, tuple[str, ...], int]:
        """Draws the scene of an attempt, before settling; also returns the names of missing objects
        and the number of tries."""
        recipe = self.recipe
        first = 1 if attempt <= attempts_with_same_objects(recipe) else attempt
        rng = rng_from("sampled scene", self._content, number, first)
        wanted = _choose_objects(recipe, self.library, self.station, rng)
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

    def _settle_or_refuse(self, scene: Scene, rng: np.random.Generator) -> tuple[str, Scene]:
        """The first reason to refuse a scene, if any, and the scene at rest."""
        moving_reason = "an object did not come to rest"
        found = self._find_issue_reason(scene)
        if found:
            return found, scene
        if self.recipe.settle and self.recipe.layout == "heap":
            heap = settle_heap(scene, self.station, self._check, self._shapes, rng)
            scene = heap.scene
            if heap.faulty:
                return self._find_issue_reason(scene) or moving_reason, scene
        elif self.recipe.settle:
            settled = settle_scene(scene, self.station)
            if settled.fallen or settled.moving:
                return "an object fell off the table" if settled.fallen else moving_reason, scene
            scene = settled.scene
            found = self._find_issue_reason(scene)
            if found:
                return found, scene
        return find_broken_rule(scene, self.station, self.recipe), scene

    def _find_issue_reason(self, scene: Scene) -> str:
        """Reason why a scene cannot be built as its document says; "" if there is none.

        Ignores overlaps in a heap, as dropping it again takes too long.
        """
        kinds = {issue.kind for issue in self._check.issues(scene) if issue.is_error}
        if not kinds and self.recipe.layout != "heap" and surface_issues(scene):
            kinds.add("overlap")
        return next((reason for kind, reason in ISSUE_REASONS.items() if kind in kinds), "")

    def _with_origin(self, scene: Scene, number: int, attempt: int) -> Scene:
        origin = SceneOrigin(**vars(self.provenance), number=number, attempt=attempt)
        return Scene(replace(scene.document, origin=origin), scene.library, scene.path)


@lru_cache(maxsize=1)
def kept_sampler(recipe: SceneRecipe, library: Path, station: Path) -> SceneSampler:
    """The sampler of a worker process, cached from scene to scene.

    Args:
        recipe: recipe of the scenes.
        library: folder of the library.
        station: file of the station.

    Raises:
        BurgError: library or station cannot be read; and see `SceneSampler`.
    """
    return SceneSampler(recipe, load_library(library), load_station(station))


@contextmanager
def convert_drake_errors() -> Iterator[None]:
    """Converts failed assertions of Drake within the block to errors.

    Raises:
        SimulationError: in place of `SystemExit`.
    """
    try:
        yield
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"Drake failed: {error}") from error


def attempts_with_same_objects(recipe: SceneRecipe) -> int:
    """Number of attempts that use the same objects."""
    return max(1, round(0.8 * recipe.attempts))  # so that often refused objects do not get rare


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
        recipe: recipe of the scene.
        library: the object library; that of the recipe, from the current folder, if None.
        station: the station; that of the recipe, from the current folder, if None.
        number: number of the scene, from 0; each gives another scene.

    Raises:
        UnknownNameError, InvalidInputError: see `require_possible_recipe`.
        BurgError: the station or an object cannot be built.
    """
    library = library or load_library(recipe.library)
    station = as_station(recipe.station if station is None else station)
    return SceneSampler(recipe, library, station).sample(number)


def sampling_provenance(
    recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> SamplingProvenance:
    """Provenance of scenes sampled now: recipe, library, station and versions."""
    return SamplingProvenance(
        recipe=recipe,
        library_content=content_hash(library.content)[:HASH_DIGITS],
        station_content=station.content[:HASH_DIGITS],
        versions=software_versions(),
    )


def require_possible_recipe(recipe: SceneRecipe, library: ObjectLibrary, station: Station) -> None:
    """Refuses a recipe that no scene can fulfil, before anything is built.

    Raises:
        UnknownNameError: the recipe names objects or a camera that do not exist.
        InvalidInputError: there are fewer objects than the recipe needs; or it requires an arm, and
            the station has none.
    """
    _choose_objects(recipe, library, station, rng_from("who is there"))
    require_possible_rules(recipe, station)


def _choose_objects(
    recipe: SceneRecipe, library: ObjectLibrary, station: Station, rng: np.random.Generator
) -> tuple[ObjectRequest, ...]:
    return choose_objects(
        library,
        recipe.count,
        rng,
        only=recipe.only,
        repeat=recipe.repeat,
        taken=(*MODEL_NAMES, *station.document.background),
    )


@dataclass(frozen=True)
class ReproducedScene:
    """Result of reproducing a scene.

    Attributes:
        scene: the reproduced scene; None if no attempt was accepted.
        station: station of the scene.
        same: whether content and origin are equal, bit for bit.
        differences: changes of library, station or versions since the scene was made, in words; or,
            if the scene differs without any such change, that its file was changed.
    """

    scene: Scene | None
    station: Station
    same: bool
    differences: tuple[str, ...]


def sample_again(scene: Scene, *, force: bool = False) -> ReproducedScene:
    """Reproduces a sampled scene.

    Args:
        scene: a sampled scene, with its library.
        force: try even if library, station or versions have changed.

    Raises:
        InvalidInputError: the scene has no origin; or, without `force`, library, station or
            versions have changed: the message names every difference.
        UnknownNameError: there is no such station.
    """
    origin = scene.document.origin
    if origin is None:
        raise InvalidInputError(
            f"{scene.path} has no `origin`, so it was not sampled, or was edited since; it cannot"
            " be made again"
        )
    station = load_station(resolve_reference(origin.recipe.station, "stations", scene.path.parent))
    here = sampling_provenance(origin.recipe, scene.library, station)
    differences = origin.differences(here)
    if differences and not force:
        raise InvalidInputError(
            f"the inputs of {scene.path} have changed ({'; '.join(differences)}), so the scene may"
            " come out differently; force it to make the scene anyway"
        ).about("force")
    sampler = SceneSampler(origin.recipe, scene.library, station)
    sampled = sampler.sample(origin.number, scene.path.parent)
    if not sampled.accepted:
        return ReproducedScene(None, station, False, tuple(differences))
    same = sampled.scene.document == scene.document
    if not same and not differences:
        differences = ["the file was changed after it was sampled"]
    return ReproducedScene(sampled.scene, station, same, tuple(differences))
