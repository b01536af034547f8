"""Objects and scenes of other collections: BURG-Toolkit's libraries and scenes, and the YCB set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    UnknownNameError,
    count_with_noun,
    make_name,
    suggest_names,
)
from burg_drake.formats import BurgLibrary, BurgScene, YcbObject
from burg_drake.objects import ObjectLibrary, SymmetrySearch
from burg_drake.pipeline.object_source import ObjectSource, check_source, object_name
from burg_drake.scene import Board, Instance, Markers, SceneDocument
from burg_drake.station import MODEL_NAMES


def burg_sources(
    library: BurgLibrary,
    masses: Mapping[str, float] | None = None,
    *,
    density: float | None = None,
    friction: float | None = None,
    skip: Collection[str] = (),
) -> list[ObjectSource]:
    """Makes object sources from an object library of BURG-Toolkit.

    Mesh, scale, mass and friction are copied. Objects without mass stay fixed. Convex pieces, URDF,
    thumbnails and stable poses are not copied; `compare_poses` compares the stable poses that
    BURG-Toolkit recorded with the new ones.

    Args:
        library: from `read_burg_library`.
        masses: by identifier or object name [kg]; they replace the masses of BURG-Toolkit.
        density: for objects that have no mass, which are fixed otherwise [kg/m^3].
        friction: coefficient for objects without one.
        skip: identifiers or object names to leave out.

    Returns:
        Sources in the document's order; an object's name is `object_name(identifier)`.

    Raises:
        UnknownNameError: a key of `masses` or a name in `skip` is not an object.
        InvalidInputError: two objects get the same name, or a number is impossible.
    """
    names = burg_names(library)
    given_masses = _resolve_masses(masses or {}, names)
    skipped = _find_identifiers(skip, names, "skip names")
    sources = []
    for item in library.objects:
        if item.identifier in skipped:
            continue
        mass = given_masses.get(item.identifier, item.mass)
        source = ObjectSource(
            name=names[item.identifier],
            mesh=item.mesh,
            mass=mass,
            density=density if mass is None else None,
            fixed=mass is None and density is None,
            friction=friction if item.friction is None else item.friction,
            scale=item.scale,
            description="" if item.name == item.identifier else item.name,
        )
        check_source(source)
        sources.append(source)
    return sources


def fixed_note(library: BurgLibrary, sources: Iterable[ObjectSource]) -> str:
    """One line that names all sources that are fixed; empty if there are none."""
    fixed = [source.name for source in sources if source.fixed]
    if not fixed:
        return ""
    return (
        f"{library.path}: these objects have mass 0 in BURG-Toolkit and become"
        f" background, which does not move: {', '.join(fixed)}"
    )


def burg_names(library: BurgLibrary) -> dict[str, str]:
    """Object names by identifier.

    Raises:
        InvalidInputError: two objects get the same name, or an identifier makes none.
    """
    identifiers: dict[str, str] = {}
    for item in library.objects:
        name = object_name(item.identifier)
        if name in identifiers:
            raise InvalidInputError(
                f"{library.path}:{item.line}: {identifiers[name]!r} and {item.identifier!r}"
                f" both become object {name!r}; rename one of them"
            )
        identifiers[name] = item.identifier
    return {identifier: name for name, identifier in identifiers.items()}


def ycb_sources(
    objects: Iterable[YcbObject],
    masses: Mapping[str, float] | None = None,
    *,
    density: float | None = None,
    friction: float | None = None,
) -> list[ObjectSource]:
    """Makes object sources from meshes of the YCB set.

    Args:
        objects: from `find_ycb`.
        masses: by YCB name or object name [kg]; they replace the published masses.
        density: for objects without a mass [kg/m^3]; the pipeline's default if None.
        friction: coefficient of all objects.

    Returns:
        Sources in the given order; an object's name is `object_name(name)`, which is the YCB name
        except for names such as `065-a_cups`.

    Raises:
        UnknownNameError: a key of `masses` is not an object.
        InvalidInputError: a number is impossible.
    """
    objects = list(objects)
    names = {o.name: object_name(o.name) for o in objects}
    given_masses = _resolve_masses(masses or {}, names)
    sources = []
    for item in objects:
        mass = given_masses.get(item.name, item.mass)
        source = ObjectSource(
            name=names[item.name],
            mesh=item.mesh,
            mass=mass,
            density=density if mass is None else None,
            friction=friction,
            description=_ycb_description(item, item.name in given_masses),
        )
        check_source(source)
        sources.append(source)
    return sources


@dataclass(frozen=True)
class PoseComparison:
    """Agreement of recorded stable poses with those of a library.

    Attributes:
        n_recorded: number of recorded poses.
        n_distinct: number of recorded poses without near-duplicates, up to the object's symmetry.
        n_library: number of the library's poses.
        unmatched: indices of recorded poses that the library does not have.
    """

    n_recorded: int
    n_distinct: int
    n_library: int
    unmatched: tuple[int, ...]

    def sentence(self, file: str) -> str:
        """The comparison in words."""
        sentence = f"{file} lists {count_with_noun(self.n_recorded, 'stable pose')}"
        if self.n_distinct < self.n_recorded:
            sentence += f" ({self.n_distinct} different)"
        sentence += f", {count_with_noun(self.n_library, 'pose')} found here"
        if self.unmatched:
            was = "was" if len(self.unmatched) == 1 else "were"
            sentence += f"; {len(self.unmatched)} of the listed {was} not found"
        return sentence


def compare_poses(recorded: Sequence[Pose], library: ObjectLibrary, name: str) -> PoseComparison:
    """Compares recorded stable poses with those of a built object.

    Only the direction of gravity in the object counts, not rotation about the vertical, position or
    scale.

    Args:
        recorded: `X_SO` of each pose, such as those of `BurgObject.stable_poses`.
        library: library with the object.
        name: name of the object in `library`.
    """
    entry = library.entry(name)
    matcher = _PoseMatcher(library.surface(name), np.array(entry.mass_properties.center_of_mass))
    recorded_downs = [_gravity_direction(X_SO) for X_SO in recorded]
    library_downs = [_gravity_direction(pose.X_SO) for pose in entry.stable_poses]
    distinct: list[Array] = []
    for down in recorded_downs:
        if not matcher.is_among(down, distinct):
            distinct.append(down)
    unmatched = tuple(
        i for i, down in enumerate(recorded_downs) if not matcher.is_among(down, library_downs)
    )
    return PoseComparison(len(recorded), len(distinct), len(library_downs), unmatched)


def _gravity_direction(X_SO: Pose) -> Array:
    """(3,) direction of gravity in O."""
    return -X_SO.matrix()[2, :3]


class _PoseMatcher:
    """Matches gravity directions in the object, up to its symmetry.

    As in `objects.resting_poses`, symmetric poses must have the same height of the centre of mass.
    """

    def __init__(self, surface: trimesh.Trimesh, p_OOcm: Array) -> None:
        search = SymmetrySearch(surface, p_OOcm)
        self.symmetries, self.tolerance = search.find(), search.tolerance
        self.points = surface.vertices - p_OOcm

    def is_among(self, down: Array, others: Iterable[Array]) -> bool:
        return any(self._is_same_pose(down, other) for other in others)

    def _is_same_pose(self, a: Array, b: Array) -> bool:
        # BURG-Toolkit records the pose after a fall onto V-HACD pieces, not the face.
        max_angle = np.deg2rad(10.0)
        if float(a @ b) > np.cos(max_angle):
            return True
        rise = abs(float((self.points @ a).max() - (self.points @ b).max()))
        return rise <= self.tolerance and self.symmetries.maps_close(a, b, max_angle)


def _resolve_masses(masses: Mapping[str, float], names: Mapping[str, str]) -> dict[str, float]:
    """The masses by identifier, for keys that are identifiers or object names."""
    identifiers = _find_identifiers(masses, names, "a mass is given for")
    return dict(zip(identifiers, masses.values(), strict=True))


def _find_identifiers(keys: Collection[str], names: Mapping[str, str], use: str) -> list[str]:
    """The identifier of each key, which is an identifier or an object name.

    Args:
        keys: identifiers and object names.
        names: object names by identifier.
        use: begins the error message of an unknown key.
    """
    identifiers = {name: identifier for identifier, name in names.items()}
    identifiers |= {identifier: identifier for identifier in names}
    for key in keys:
        if key not in identifiers:
            raise UnknownNameError(
                f"{use} unknown object {key!r}; {suggest_names(key, names.values())}"
            )
    return [identifiers[key] for key in keys]


def _ycb_description(item: YcbObject, weighed: bool) -> str:
    label = item.name.split("_", 1)[1].replace("_", " ")
    scan = f", {item.variant} scan" if item.variant else ""
    mass = f"; mass: {item.mass_source}" if item.mass_source and not weighed else ""
    return f"YCB {item.number} {label}{scan}{mass}"


@dataclass(frozen=True)
class ImportedScene:
    """A scene of another collection.

    Attributes:
        document: the scene.
        notes: differences from the original scene, one sentence each.
    """

    document: SceneDocument
    notes: tuple[str, ...] = ()


def import_burg_scene(
    scene: BurgScene, library: ObjectLibrary, name: str = "", reference: str = ""
) -> ImportedScene:
    """Converts a scene of BURG-Toolkit to a scene document.

    Objects are found in `library` by `object_name(identifier)`, the name that `burg_sources` gives
    them. Objects without mass in `library` become background, even if the scene lists them as free.
    Instances have no names in BURG-Toolkit; they get the names of their objects, the second
    instance of an object `NAME_2` and so on. Names that every station uses, such as `table`, begin
    with `NAME_1`. The board is the scene's printout with its markers; a scene without printout gets
    a board of the size of the ground area with the markers of this project.

    Args:
        scene: from `read_burg_scene`.
        library: library with the objects.
        name: name of the document; that of the scene's file if empty.
        reference: reference to the library in the document; the library's folder if empty.

    Raises:
        UnknownNameError: the library lacks objects; the message names file and line of each.
        InvalidInputError: an identifier makes no object name; the printout's markers do not exist
            or do not fit.
    """
    made = _make_instances(scene, library)
    free, fixed, notes = [], [], []
    for item, instance in zip(scene.objects, made, strict=False):
        if library.entry(instance.object).is_fixed:
            fixed.append(instance)
            notes.append(
                f"{scene.path}:{item.line}: {instance.object!r} has no mass, so it"
                " becomes background, which does not move"
            )
        else:
            free.append(instance)
    fixed += made[len(scene.objects) :]
    notes += [
        f"an instance of object {i.object!r} is called {i.name!r}, as every station has"
        f" something called {i.object!r} already"
        for i in (*free, *fixed)
        if i.object in MODEL_NAMES
    ]
    document = SceneDocument(
        name=name or make_name(scene.path.stem),
        description=f"Imported from BURG-Toolkit's {scene.path.name}",
        library=reference or str(library.root),
        board=_import_board(scene),
        instances=tuple(free),
        background=tuple(fixed),
    )
    return ImportedScene(document, tuple(notes))


def _import_board(scene: BurgScene) -> Board:
    printout = scene.printout
    if printout is None:
        return Board(size=scene.ground_area)
    given = printout.marker_info
    markers = Markers(
        dictionary=given.aruco_dict.removeprefix("DICT_"),
        side=round(given.marker_size_mm * 1e-3, 9),
        spacing=round(given.marker_spacing_mm * 1e-3, 9),
        count=(given.marker_count_x, given.marker_count_y),
    )
    board = Board(size=printout.size, markers=markers)
    try:
        _ = board.layout
    except InvalidInputError as error:
        raise InvalidInputError(f"{scene.path}: printout: {error}") from error
    return board


def _make_instances(scene: BurgScene, library: ObjectLibrary) -> list[Instance]:
    """Makes the instances of the scene's free and then of its fixed objects. Objects that the
    library lacks are an error."""
    items = [(item, object_name(item.object_type)) for item in (*scene.objects, *scene.bg_objects)]
    lacking = [
        f"{scene.path}:{item.line}: object {name!r} ({item.object_type!r}) is not in library"
        f" {library.root}; {suggest_names(name, library.objects)}"
        for item, name in sorted(items, key=lambda pair: pair[0].line)
        if name not in library.objects
    ]
    if lacking:
        raise UnknownNameError("; ".join(lacking))
    taken = {name for _, name in items}  # an object may be called mug_2
    count: Counter[str] = Counter()
    made = []
    for item, object in items:
        count[object] += 1
        name = "" if count[object] == 1 and object not in MODEL_NAMES else object
        if name:
            while f"{object}_{count[object]}" in taken:
                count[object] += 1
            name = f"{object}_{count[object]}"
        made.append(Instance(name=name, object=object, X_SO=item.X_SO))
    return made
