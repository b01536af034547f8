"""Objects of other collections as things to build: BURG-Toolkit's libraries and the YCB set."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from burg_drake.core import Array, InvalidInputError, UnknownNameError, nearest
from burg_drake.core.documents import Pose
from burg_drake.formats.collections import BurgLibrary, BurgObject, YcbObject
from burg_drake.objects.library import ObjectLibrary
from burg_drake.objects.physics import SymmetrySearch
from burg_drake.pipeline.source import ObjectSource, check_source, object_name

SAME_POSE = np.deg2rad(10.0)
"""Poses whose directions down differ by less are one pose [rad]. BURG-Toolkit records where a fall
onto its V-HACD pieces came to rest, and not the face of the surface that the object lies on."""


def burg_sources(
    library: BurgLibrary,
    masses: Mapping[str, float] | None = None,
    *,
    density: float | None = None,
    friction: float | None = None,
    skip: Collection[str] = (),
) -> list[ObjectSource]:
    """What to build from an object library of BURG-Toolkit.

    Mesh, scale, mass and friction are taken over. What has no mass stays fixed, as it is there.
    Convex pieces, URDF, thumbnails and stable poses are made anew; `compare_poses` tells how the
    listed poses agree with the new ones.

    Args:
        library: from `formats.collections.burg_library.read_burg_library`.
        masses: by identifier or object name [kg]; they go before the document's.
        density: for objects that have no mass, which are fixed otherwise [kg/m^3].
        friction: coefficient of objects that have none.
        skip: identifiers or object names to leave out.

    Returns:
        Sources in the document's order; an object's name is `object_name(identifier)`.

    Raises:
        UnknownNameError: a mass or `skip` names no object.
        InvalidInputError: two objects get the same name, or a number is impossible.
    """
    names = burg_names(library)
    given = _by_identifier(masses or {}, names, "a mass")
    left_out = _by_identifier(dict.fromkeys(skip, 0.0), names, "skip")
    objects = [o for o in library.objects if o.identifier not in left_out]
    sources = []
    for item in objects:
        mass = given.get(item.identifier, item.mass)
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
    names: dict[str, str] = {}
    owner: dict[str, BurgObject] = {}
    for item in library.objects:
        name = object_name(item.identifier)
        if name in owner:
            raise InvalidInputError(
                f"{library.path}:{item.line}: {owner[name].identifier!r} and {item.identifier!r}"
                f" both become object {name!r}; rename one of them"
            )
        names[item.identifier] = name
        owner[name] = item
    return names


def ycb_sources(
    objects: Iterable[YcbObject],
    masses: Mapping[str, float] | None = None,
    *,
    density: float | None = None,
    friction: float | None = None,
) -> list[ObjectSource]:
    """What to build from meshes of the YCB set.

    Args:
        objects: from `formats.collections.ycb.find_ycb`.
        masses: by YCB name or object name [kg]; they go before the published ones.
        density: for objects that have no mass [kg/m^3]; the pipeline's default if None.
        friction: coefficient of all.

    Returns:
        Sources in the given order; an object's name is `object_name(name)`, which is the YCB name
        but for `065-a_cups` and its like.

    Raises:
        UnknownNameError: a mass names no object.
        InvalidInputError: a number is impossible.
    """
    objects = list(objects)
    given = _by_identifier(masses or {}, {o.name: object_name(o.name) for o in objects}, "a mass")
    sources = []
    for item in objects:
        mass = given.get(item.name, item.mass)
        source = ObjectSource(
            name=object_name(item.name),
            mesh=item.mesh,
            mass=mass,
            density=density if mass is None else None,
            friction=friction,
            description=_ycb_description(item, item.name in given),
        )
        check_source(source)
        sources.append(source)
    return sources


@dataclass(frozen=True)
class PoseComparison:
    """How recorded stable poses agree with those of a library.

    Attributes:
        listed: number of recorded poses.
        distinct: number of them without near-duplicates, up to the object's symmetry.
        here: number of the library's poses.
        unknown: indices of recorded poses that are none of the library's.
    """

    listed: int
    distinct: int
    here: int
    unknown: tuple[int, ...]

    def sentence(self, file: str) -> str:
        """For people."""
        listed = f"{file} lists {_count(self.listed, 'stable pose')}"
        if self.distinct < self.listed:
            listed += f" ({self.distinct} different)"
        unknown = ""
        if self.unknown:
            was = "was" if len(self.unknown) == 1 else "were"
            unknown = f"; {len(self.unknown)} of the listed {was} not found"
        return f"{listed}, {_count(self.here, 'pose')} found here{unknown}"


def compare_poses(recorded: Sequence[Pose], library: ObjectLibrary, name: str) -> PoseComparison:
    """Compares stable poses from elsewhere with those of a built object.

    Only the direction down in the object matters: neither a turn about the vertical nor the place
    or scale do.

    Args:
        recorded: `X_SO` of each pose, such as those of `BurgObject.stable_poses`.
        library: has the object.
        name: of the object in `library`.
    """
    entry = library.entry(name)
    test = _SamePose(library.surface(name), np.array(entry.mass_properties.center_of_mass))
    listed = [_down(X_SO) for X_SO in recorded]
    here = [_down(pose.X_SO) for pose in entry.stable_poses]
    distinct: list[Array] = []
    for down in listed:
        if not any(test.same(down, other) for other in distinct):
            distinct.append(down)
    unknown = tuple(
        i for i, down in enumerate(listed) if not any(test.same(down, other) for other in here)
    )
    return PoseComparison(len(listed), len(distinct), len(here), unknown)


def _down(X_SO: Pose) -> Array:
    """(3,) direction of gravity in O."""
    return -X_SO.matrix()[2, :3]


class _SamePose:
    """Whether directions down are near each other, or one pose by the object's symmetry.

    As for `objects.physics.stability`, the centre of mass has to be at one height then.
    """

    def __init__(self, surface: trimesh.Trimesh, p_OOcm: Array) -> None:
        search = SymmetrySearch(surface, p_OOcm)
        self.symmetries, self.tolerance = search.find(), search.tolerance
        self.points = surface.vertices - p_OOcm

    def same(self, a: Array, b: Array) -> bool:
        if float(a @ b) > np.cos(SAME_POSE):
            return True
        rise = abs(float((self.points @ a).max() - (self.points @ b).max()))
        return rise <= self.tolerance and self.symmetries.same(a, b, SAME_POSE)


def _by_identifier(
    values: Mapping[str, float], names: Mapping[str, str], what: str
) -> dict[str, float]:
    """The values by identifier, for keys that are identifiers or object names."""
    identifiers = {name: identifier for identifier, name in names.items()}
    identifiers |= {identifier: identifier for identifier in names}
    for key in values:
        if key not in identifiers:
            raise UnknownNameError(
                f"{what} is given for unknown object {key!r}; {nearest(key, names.values())}"
            )
    return {identifiers[key]: value for key, value in values.items()}


def _ycb_description(item: YcbObject, weighed: bool) -> str:
    label = item.name.split("_", 1)[1].replace("_", " ")
    scan = f", {item.variant} scan" if item.variant else ""
    mass = f"; mass: {item.mass_source}" if item.mass_source and not weighed else ""
    return f"YCB {item.number} {label}{scan}{mass}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
