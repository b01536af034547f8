"""The suite: scenes, camera, station and budget on which all planners are compared.

A suite is one YAML file. It records the content of its objects and of its station, so that a suite
whose objects have changed is refused rather than judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from burg_drake.benchmark.settings import SUITE_FOLDER, Budget, Split
from burg_drake.benchmark.suite_camera import SuiteCamera
from burg_drake.core import (
    FieldError,
    InvalidInputError,
    Mode,
    atomic_write,
    builtin_names,
    content_hash,
    dump_document,
    ensure_writable_folder,
    list_names,
    load_document,
    portable_reference,
    require_name,
    resolve_reference,
    save_document,
)
from burg_drake.evaluation import mode_for
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.printout import print_board
from burg_drake.scene import (
    Board,
    Instance,
    Scene,
    SceneDocument,
    SceneLike,
    as_scene,
    place_objects,
    save_scene,
)
from burg_drake.station import (
    DEFAULT_ENGINE,
    ENGINES,
    Station,
    StationLike,
    as_station,
    load_station,
    require_valid_scene,
)

HASH_DIGITS = 16
"""Digits of the hashes in suites and results."""


@dataclass(frozen=True, kw_only=True)
class SuiteScene:
    """A scene of a suite.

    Attributes:
        name: name of the scene. Letters, digits, `_`, `-` and `.`.
        split: `test` for scenes that count, `tuning` for those on which a planner may be tuned.
        board: the printed board; that of the suite if left out.
        instances: objects that are free to move, and to be grasped.
        background: objects that are fixed where they are.
    """

    name: str
    split: Split = "test"
    board: Board | None = None
    instances: tuple[Instance, ...]
    background: tuple[Instance, ...] = ()

    def __post_init__(self) -> None:
        require_name(self.name, "name")
        if not self.instances:
            raise FieldError("instances is empty; give one object or more", "instances")


@dataclass(frozen=True, kw_only=True)
class SuiteDocument:
    """A suite of scenes for benchmarks.

    Attributes:
        name: name of the suite. Letters, digits, `_`, `-` and `.`.
        release: number of the suite's release; results of different releases are not compared.
        description: text for people.
        library: object library: its folder, relative to this file, or the name of a built-in one.
        station: station: its file, relative to this file, or the name of a built-in one.
        board: the printed board of the scenes.
        cameras: cameras that observe each scene, each on its own.
        budget: what a planner may use for an observation.
        mode: how grasps are judged, as in `evaluate`: `hand`, `reach` or `arm`.
        engine: physics engine of the trials.
        objects: content hash of each object, by name.
        station_content: content hash of the station.
        scenes: the scenes.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    version: int = 1
    name: str
    release: int = 1
    description: str = ""
    library: str
    station: str = "panda_tabletop"
    board: Board = Board()
    cameras: tuple[SuiteCamera, ...]
    budget: Budget = field(default_factory=Budget)
    mode: Mode = "reach"
    engine: str = DEFAULT_ENGINE
    objects: dict[str, str] = field(default_factory=dict)
    station_content: str = ""
    scenes: tuple[SuiteScene, ...]

    def __post_init__(self) -> None:
        require_name(self.name, "name")
        if self.engine not in ENGINES:
            raise FieldError(
                f"engine {self.engine!r} does not exist; give one of {list_names(list(ENGINES))}",
                "engine",
            )
        for key, items in (("cameras", self.cameras), ("scenes", self.scenes)):
            names = [one.name for one in items]
            if not names:
                raise FieldError(f"{key} is empty; give one or more", key)
            for k, name in enumerate(names):
                if name.casefold() in [other.casefold() for other in names[:k]]:
                    raise FieldError(f"two {key} are called {name!r}; rename one", key, k, "name")

    @property
    def hash(self) -> str:
        """See `Suite.hash`."""
        placed = replace(self, description="", library="", station="")
        return content_hash(dump_document(placed))[:HASH_DIGITS]


@dataclass(frozen=True, eq=False)
class Suite:
    """A suite with its library, station and scenes at hand.

    Attributes:
        document: contents of the suite file.
        library, station: library and station of the scenes.
        path: the suite file.
    """

    document: SuiteDocument
    library: ObjectLibrary
    station: Station
    path: Path

    def __repr__(self) -> str:
        return f"Suite({self.name!r}, {len(self.document.scenes)} scenes, {self.hash})"

    @property
    def name(self) -> str:
        """The suite's name."""
        return self.document.name

    @property
    def hash(self) -> str:
        """Hash of scenes, cameras, budget, name of the engine, objects and station. The figures of
        sensors and engines are those of the release of burg_drake."""
        return self.document.hash

    def scenes(self, split: Split = "test") -> dict[str, Scene]:
        """The scenes of a split by name."""
        return {name: s for name, s in self._scenes.items() if self._splits[name] == split}

    @property
    def _splits(self) -> Mapping[str, Split]:
        return {one.name: one.split for one in self.document.scenes}

    @cached_property
    def _scenes(self) -> dict[str, Scene]:
        return {
            one.name: place_objects(
                SceneDocument(
                    name=one.name,
                    description=f"Scene of the suite {self.name}, release {self.document.release}",
                    library=self.document.library,
                    board=one.board or self.document.board,
                    instances=one.instances,
                    background=one.background,
                ),
                self.library,
                self.path,
                f"scenes[{k}].",
            )
            for k, one in enumerate(self.document.scenes)
        }


SuiteLike = Suite | str | Path
"""A loaded suite, or an argument of `load_suite`."""


def suite_names() -> list[str]:
    """Names of the built-in suites."""
    return builtin_names(SUITE_FOLDER)


def load_suite(reference: str | Path) -> Suite:
    """Loads a suite with its library and station.

    Example::

        suite = burg.benchmark.load_suite("tabletop")  # built in; or a path

    Args:
        reference: path of a suite file, or the name of a built-in suite.

    Raises:
        UnknownNameError: no such file, library or station, or an instance of an unknown object.
        DocumentError: the file does not fit the schema.
        InvalidInputError: objects or the station have changed since the suite was made.
    """
    path = resolve_reference(reference, SUITE_FOLDER)
    document = load_document(path, SuiteDocument)
    library = load_library(document.library, path.parent)
    station = load_station(resolve_reference(document.station, "stations", path.parent))
    suite = Suite(document, library, station, path)
    _ = suite._scenes  # refuses unknown objects
    _require_same_contents(suite)
    return suite


def as_suite(suite: SuiteLike) -> Suite:
    """Returns a suite, loaded if it is given by name."""
    return suite if isinstance(suite, Suite) else load_suite(suite)


def _require_same_contents(suite: Suite) -> None:
    """Refuses a suite whose objects or station have changed since it was made.

    Raises:
        InvalidInputError: the message names them.
    """
    used, pinned = _used_objects(suite.library, suite.document.scenes), suite.document.objects
    missing = [name for name in used if name not in pinned]
    changed = [name for name, content in used.items() if pinned.get(name, content) != content]
    if missing:
        raise InvalidInputError(
            f"{suite.path}: objects has no hash of {list_names(missing)}; make the suite with"
            " `benchmark new`, which records them"
        )
    if changed:
        raise InvalidInputError(
            f"{suite.path}: {list_names(changed)} of library {suite.library.root} changed since the"
            " suite was made, so that its results would not be comparable; restore the objects, or"
            " make a new suite with `benchmark new`"
        )
    if suite.document.station_content != suite.station.content[:HASH_DIGITS]:
        raise InvalidInputError(
            f"{suite.path}: station {suite.station.path} changed since the suite was made, so that"
            " its results would not be comparable; restore it, or make a new suite with"
            " `benchmark new`"
        )


def _used_objects(library: ObjectLibrary, scenes: Sequence[SuiteScene]) -> dict[str, str]:
    """Content hashes of the objects in scenes, by name."""
    used = {i.object for scene in scenes for i in (*scene.instances, *scene.background)}
    return {name: library.content[name][:HASH_DIGITS] for name in sorted(used)}


@dataclass(frozen=True, kw_only=True)
class SuiteSettings:
    """How a suite is made of scenes.

    Attributes:
        description, release, budget, engine: see `SuiteDocument`.
        mode: likewise; `reach` if the station has an arm, else `hand`, if None.
        tuning: number of scenes, the last ones, on which planners may be tuned.
    """

    description: str = ""
    release: int = 1
    budget: Budget = field(default_factory=Budget)
    mode: Mode | None = None
    engine: str = DEFAULT_ENGINE
    tuning: int = 0


def make_suite(
    path: str | Path,
    scenes: Sequence[SceneLike],
    *,
    cameras: Sequence[SuiteCamera],
    station: StationLike = "panda_tabletop",
    settings: SuiteSettings | None = None,
) -> Suite:
    """Writes a suite of existing scenes, and loads it.

    Example::

        scenes = [burg.load_scene(name) for name in ("tabletop_six", "tabletop_close")]
        camera = burg.benchmark.CameraPlacement().camera(scenes[0].board)
        suite = burg.benchmark.make_suite("mine.yaml", scenes, cameras=[camera])

    Args:
        path: file to write; the suite has its name.
        scenes: scenes that share one library; a second one of the same name is numbered.
        cameras: cameras that observe each scene.
        station: station of all scenes.
        settings: the defaults if None.

    Raises:
        InvalidInputError: a scene is invalid on the station, or scenes have different libraries.
    """
    path, loaded, station = Path(path), [as_scene(scene) for scene in scenes], as_station(station)
    settings = settings or SuiteSettings()
    tuning = settings.tuning
    if not 0 <= tuning < len(loaded):
        raise InvalidInputError(
            f"{tuning} of {len(loaded)} scenes are for tuning; leave one or more to test"
        )
    roots = {scene.library.root.resolve() for scene in loaded}
    if len(roots) > 1:
        raise InvalidInputError(
            f"the scenes have objects of {len(roots)} libraries"
            f" ({list_names(sorted(map(str, roots)))}); give scenes of one library"
        )
    for scene in loaded:
        require_valid_scene(scene, station)
    library, folder = loaded[0].library, path.parent
    entries = tuple(
        SuiteScene(
            name=scene_name,
            split="tuning" if k >= len(loaded) - tuning else "test",
            board=None if scene.board == loaded[0].board else scene.board,
            instances=scene.document.instances,
            background=scene.document.background,
        )
        for k, (scene_name, scene) in enumerate(
            zip(_distinct_names([s.name for s in loaded]), loaded, strict=True)
        )
    )
    document = SuiteDocument(
        name=path.stem,
        release=settings.release,
        description=settings.description,
        library=_reference(library.root, "models", folder),
        station=_reference(station.path, "stations", folder),
        board=loaded[0].board,
        cameras=tuple(cameras),
        budget=settings.budget,
        mode=mode_for(station, settings.mode),
        engine=settings.engine,
        objects=_used_objects(library, entries),
        station_content=station.content[:HASH_DIGITS],
        scenes=entries,
    )
    save_document(document, path)
    return load_suite(path)


def _reference(path: Path, kind: str, folder: Path) -> str:
    """Reference to a library or station for a document in `folder`: its name if it is built in."""
    name = path.stem
    if name in builtin_names(kind) and resolve_reference(name, kind).resolve() == path.resolve():
        return name
    return portable_reference(path, folder)


def _distinct_names(names: Sequence[str]) -> list[str]:
    """Names with a number after those that occur before, ignoring case."""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        number, distinct = 1, name
        while distinct.casefold() in taken:
            number += 1
            distinct = f"{name}_{number}"
        taken.add(distinct.casefold())
        found.append(distinct)
    return found


def write_suite_scene(suite: Suite, scene: Scene, folder: str | Path) -> None:
    """Writes a scene of a suite as YAML, its board as PDF, and what the first camera sees as PNG.

    Args:
        suite: the suite.
        scene: one of its scenes.
        folder: folder of the files, which have the scene's name.
    """
    import cv2

    folder = ensure_writable_folder(folder)
    library = portable_reference(suite.library.root, folder)
    save_scene(replace(scene.document, library=library), folder / f"{scene.name}.yaml")
    print_board(scene).save(folder / f"{scene.name}.pdf")
    camera = suite.document.cameras[0].scene_camera()
    color = camera.observe(scene, suite.station).color
    if color is not None:
        _, png = cv2.imencode(".png", cv2.cvtColor(color, cv2.COLOR_RGB2BGR))
        atomic_write(folder / f"{scene.name}.png", png.tobytes())
