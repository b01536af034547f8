"""Samples antipodal grasps on the objects of a scene, or of a library.

The random stream of an object follows from the seed and the object's content alone: neither the
rest of the scene nor the order matters, and a run judges the grasps that a file got with the same
settings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    nearest,
    rng_from,
    transform_points,
)
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates.approach_limits import from_above, from_arm_side
from burg_drake.evaluation.candidates.candidates import Candidates, distinct, join_candidates
from burg_drake.evaluation.candidates.instance_names import chosen_instances
from burg_drake.evaluation.candidates.sampling_settings import (
    DEFAULT_APPROACH_ANGLE_DEG,
    SLIPPERY_FRICTION_FACTOR,
    SamplingSettings,
)
from burg_drake.grasping.sampling import ApproachCone
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station

if TYPE_CHECKING:
    import trimesh

    from burg_drake.evaluation.candidates.clear_test import ClearTest
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.grasping.sampling import Accept


def sample_candidates(
    scene: Scene,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings | None = None,
    only: Iterable[str] | None = None,
) -> Candidates:
    """Samples antipodal grasps as candidates of a run; see `sample_on_scene`."""
    stream = sample_on_scene(scene, station, n, seed, settings or SamplingSettings(), only)
    return join_candidates(dict(stream))


def sample_on_scene(
    scene: Scene,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings,
    only: Iterable[str] | None = None,
) -> Iterator[tuple[str, GraspSet]]:
    """Samples grasps on the instances of a scene, one after the other.

    All instances of an object get the same grasps that lie on the same side and have the same
    limits, if they are sampled blind.

    Args:
        scene: the scene.
        station: gives the opening of the hand, its body, and the place of the arm.
        n: grasps for each instance; there are fewer where there are (almost) no more, and
            `sampling_shortfall.shortfall` says why.
        seed: of the random numbers.
        settings: how.
        only: names of free instances, or of objects for all their instances; all if None.

    Returns:
        Names and grasps, in the frames of the objects.

    Raises:
        InvalidInputError: n is below 1, or a setting does not fit.
        UnknownNameError: no such instance or object, or a mesh file is missing.
    """
    _check_count(n)
    names = chosen_instances(scene, only)
    objects = {instance.object for instance in scene.instances.values()}
    _known(settings.weights, objects, "weights: the scene does not have object")
    return _sampled_scene(scene, station, n, seed, settings, names)


def _sampled_scene(
    scene: Scene,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings,
    names: tuple[str, ...],
) -> Iterator[tuple[str, GraspSet]]:
    draw = ObjectSampler(scene.library, station, n, seed, settings)
    screen = None if settings.blind else _scene_screen(scene, station)
    found: dict[tuple[str, tuple[ApproachCone, ...]], GraspSet] = {}
    for name in names:
        object, X_WO = scene.instance(name).object, _X_WO(scene, station, name)
        cones = _approach_cones(draw.surface(object), X_WO, station, name, settings)
        if screen is not None:
            yield name, draw.clear(object, cones, screen, name, X_WO)
        else:
            if (object, cones) not in found:
                found[object, cones] = draw(object, cones)
            yield name, found[object, cones]


def sample_library(
    library: ObjectLibrary,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings,
    objects: Iterable[str] | None = None,
) -> Iterator[tuple[str, GraspSet]]:
    """Samples grasps on the objects of a library, one after the other, from all sides.

    Args:
        library: the library.
        station: gives the opening of the hand and its body.
        n, seed, settings: as for `sample_on_scene`.
        objects: names in the library; all if None.

    Returns:
        Names and grasps, in the frames of the objects.

    Raises:
        InvalidInputError: n is below 1, or a setting does not fit, such as limits of the approach:
            the objects of a library lie nowhere.
        UnknownNameError: no such object, or a mesh file is missing.
    """
    _check_count(n)
    if settings.approach_angle_deg is not None or settings.from_arm_side:
        raise InvalidInputError(
            f"the objects of library {library.name!r} are in no scene, so there is no"
            " straight down and no side of the arm; give a scene to limit the approach"
        )
    where = f"library {library.name!r} has no object"
    names = _known(objects, library.objects, where)
    _known(settings.weights, library.objects, f"weights: {where}")
    return _sampled_library(library, station, n, seed, settings, names)


def _sampled_library(
    library: ObjectLibrary,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings,
    names: tuple[str, ...],
) -> Iterator[tuple[str, GraspSet]]:
    from burg_drake.grasping.clearance import hand_clearance_alone

    draw = ObjectSampler(library, station, n, seed, settings)
    for name in names:
        if settings.blind:
            yield name, draw(name, ())
        else:
            screen = hand_clearance_alone(library, name, station)
            yield name, draw.clear(name, (), screen, name, np.eye(4))


class ObjectSampler:
    """Samples on objects of one library with the same settings."""

    def __init__(
        self,
        library: ObjectLibrary,
        station: Station,
        n: int,
        seed: int,
        settings: SamplingSettings,
    ) -> None:
        self._library, self._station = library, station
        self._n, self._seed, self._settings = n, seed, settings
        self._pad = _pad(station)
        self._surfaces: dict[str, trimesh.Trimesh] = {}

    def surface(self, object: str) -> trimesh.Trimesh:
        """The surface of an object, read once."""
        if object not in self._surfaces:
            self._surfaces[object] = self._library.surface(object)
        return self._surfaces[object]

    def __call__(
        self, object: str, cones: tuple[ApproachCone, ...], accept: Accept | None = None
    ) -> GraspSet:
        """Grasps of an object."""
        from burg_drake.grasping.sampling import AntipodalSettings, sample_antipodal

        settings = self._settings
        antipodal = AntipodalSettings(
            friction=self._friction(object),
            opening=self._station.hand.opening,
            approaches=settings.approaches,
            approach_cones=cones,
            standoffs=settings.standoffs,
            pad=self._pad,
            diverse=settings.diverse,
        )
        grasps = sample_antipodal(
            self.surface(object),
            self._n,
            rng_from("antipodal", self._seed, self._library.entry(object).build),
            antipodal,
            weights=settings.weights.get(object),
            accept=accept,
            object=object,
        )
        if settings.slippery:  # scores are shares of the sampler's friction: of the object's, then
            score = 1.0 - SLIPPERY_FRICTION_FACTOR * (1.0 - grasps.score)
            grasps = dataclasses.replace(grasps, score=score).select(score < 0.0)
        return distinct(grasps)

    def clear(
        self,
        object: str,
        cones: tuple[ApproachCone, ...],
        screen: HandClearance,
        name: str,
        X_WO: Array,
    ) -> GraspSet:
        """Grasps of an object, by this name and at this place (4, 4) in the screen, that the hand
        can take; their provenance counts what `blocked` the others."""
        test = self.clear_test(object, screen, name, X_WO)
        grasps = self(object, cones, test)
        notes = {"target": name, "blocked": dict(test.blocked), "margin": self._settings.margin}
        return dataclasses.replace(grasps, provenance={**grasps.provenance, **notes})

    def clear_test(self, object: str, screen: HandClearance, name: str, X_WO: Array) -> ClearTest:
        """Tells which grasps of an object the hand can take; see `clear`."""
        from burg_drake.evaluation.candidates.clear_test import ClearTest
        from burg_drake.geometry import Surface
        from burg_drake.grasping.quality import jaws_of

        surface, friction = Surface.of(self.surface(object)), self._friction(object)
        jaws = jaws_of(self._station.hand, self._station.hand_model, self._station.packages)
        return ClearTest(screen, name, X_WO, surface, jaws, friction, self._settings)

    def _friction(self, object: str) -> float:
        given = self._settings.friction
        friction = self._library.entry(object).friction if given is None else given
        return friction * (SLIPPERY_FRICTION_FACTOR if self._settings.slippery else 1.0)


def _check_count(n: int) -> None:
    if n < 1:
        raise InvalidInputError(f"grasps per object is {n}; give 1 or more")


def _known(names: Iterable[str] | None, known: Iterable[str], what: str) -> tuple[str, ...]:
    """The names, each once; all known ones if None."""
    chosen = tuple(dict.fromkeys(known if names is None else names))
    for name in chosen:
        if name not in known:
            raise UnknownNameError(f"{what} {name!r}; {nearest(name, known)}")
    return chosen


def _X_WO(scene: Scene, station: Station, instance: str) -> Array:
    X_WO: Array = station.document.X_WS.matrix() @ scene.X_SO(instance)
    return X_WO


def _approach_cones(
    surface: trimesh.Trimesh,
    X_WO: Array,
    station: Station,
    instance: str,
    settings: SamplingSettings,
) -> tuple[ApproachCone, ...]:
    """The limits of the approach to an instance; none where they hold every direction."""
    angle = settings.approach_angle_deg
    cones = from_above(X_WO, DEFAULT_APPROACH_ANGLE_DEG if angle is None else angle)
    if settings.from_arm_side:
        p_WM = transform_points(X_WO, surface.bounds).mean(axis=0)
        cones += (from_arm_side(X_WO, p_WM, station, instance),)
    return cones


def _pad(station: Station) -> tuple[float, float]:
    """From where to where the pads of the hand reach along z of G [m]."""
    from burg_drake.station.world import check_hand

    hand, document = station.hand, station.hand_path
    low, high = check_hand(hand, station.hand_model, document, station.packages).pad_bounds
    return low[2], high[2]


def _scene_screen(scene: Scene, station: Station) -> HandClearance:
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.station.diagram import build_station_diagram

    return HandClearance(build_station_diagram(scene, station, robot="hand"))
