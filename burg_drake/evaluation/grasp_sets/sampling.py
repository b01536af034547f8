"""Samples antipodal grasps on the objects of a scene or library, and explains a shortfall."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    rng_from,
    suggest_names,
    transform_points,
)
from burg_drake.evaluation.candidates import (
    Candidates,
    chosen_instances,
    drop_equal_grasps,
    join_candidates,
)
from burg_drake.evaluation.judge import build_hand_clearance
from burg_drake.evaluation.settings import (
    DEFAULT_APPROACH_ANGLE_DEG,
    SLIPPERY_FRICTION_FACTOR,
    SamplingSettings,
)
from burg_drake.grasping import ApproachCone, PairRejection, are_antipodal, grasp_contacts
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Scene
from burg_drake.station import Station

if TYPE_CHECKING:
    import trimesh

    from burg_drake.geometry import Surface
    from burg_drake.grasping import Accept, ClearanceMode, HandClearance, Jaws


def approach_cone_from_above(X_WO: Array, angle_deg: float) -> tuple[ApproachCone, ...]:
    """Cone of approach directions about straight down, in the object frame.

    Args:
        X_WO: (4, 4) pose of the object.
        angle_deg: largest angle to straight down; 180 or more allows all directions.
    """
    if angle_deg >= 180.0:
        return ()
    return (
        ApproachCone(_direction_in_object(X_WO, (0.0, 0.0, -1.0)), float(np.deg2rad(angle_deg))),
    )


def approach_half_space_of_arm(
    X_WO: Array, p_WM: Array, station: Station, name: str
) -> ApproachCone:
    """Half space of approaches that do not point back to the arm, in the object frame: at most 90
    degrees from the horizontal direction from the arm's base to the object.

    Args:
        X_WO: (4, 4) pose of the object.
        p_WM: (3,) middle of the object [m].
        station: station with the arm.
        name: name of the instance, for messages.

    Raises:
        InvalidInputError: the station has no arm, or the object is right above its base.
    """
    arm = station.document.arm
    if arm is None:
        raise InvalidInputError(
            f"station {station.name!r} has no arm, so there is no side of the arm from"
            " which the hand could approach"
        )
    x, y, _ = p_WM - arm.X_WA.matrix()[:3, 3]
    if np.hypot(x, y) < 0.01:  # metres
        raise InvalidInputError(
            f"{name!r} is right above the base of the arm, so the hand cannot approach it"
            " from the arm's side"
        )
    return ApproachCone(_direction_in_object(X_WO, (x, y, 0.0)), np.pi / 2)


def _direction_in_object(
    X_WO: Array, v_W: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A world direction as a rounded unit vector in the object frame."""
    v_O = np.asarray(v_W) @ X_WO[:3, :3] / np.linalg.norm(v_W)
    # rounded, so that objects turned about the vertical share grasps; without negative zeros
    x, y, z = np.round(v_O, 6) + 0.0
    return float(x), float(y), float(z)


PAD_CONTACT = "pads"
"""Blocker name for grasps at which the pads do not meet the object antipodally."""


class ClearanceFilter:
    """Accepts clear grasps of one object; see `grasping.Accept`.

    Args:
        screen: collision screen of the open hand.
        name: name of the object in the screen.
        X_WO: (4, 4) pose of the object in the screen's world.
        surface: surface of the object.
        jaws: jaws of the hand.
        friction: coefficient between object and pads.
        settings: margin and mode of the screen.

    Attributes:
        blocked: number of rejected grasps by the body that the open hand hits, which may be the
            object itself, or under `PAD_CONTACT`.
    """

    def __init__(
        self,
        screen: HandClearance,
        name: str,
        X_WO: Array,
        surface: Surface,
        jaws: Jaws,
        friction: float,
        settings: SamplingSettings,
    ) -> None:
        self._screen, self._name, self._X_WO = screen, name, X_WO
        self._surface, self._jaws, self._friction = surface, jaws, friction
        self._mode: ClearanceMode = "conservative" if settings.conservative else "exact"
        self._margin = settings.margin
        self.blocked: Counter[str] = Counter()

    def __call__(self, X_OG: Array) -> NDArray[np.bool_]:
        """(N,) whether to keep each of the grasps (N, 4, 4)."""
        X_WG = self._X_WO @ X_OG
        if self._margin > 0.0:
            found = self._screen.measure(self._name, X_WG, mode=self._mode, margin=self._margin)
            blocker = found.blocker
        else:
            blocker = self._screen.blockers(self._name, X_WG, self._mode)
        passed = np.asarray(blocker == "")
        self.blocked.update(blocker[~passed].tolist())
        clear = np.flatnonzero(passed)
        contacts = grasp_contacts(self._surface, X_OG[clear], self._jaws)
        passed[clear] = are_antipodal(contacts, X_OG[clear], self._friction)
        self.blocked[PAD_CONTACT] += len(clear) - int(passed.sum())
        return passed


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

    With `settings.blind`, instances of an object that lie on the same side and have the same limits
    of the approach get the same grasps.

    Args:
        scene: the scene.
        station: station with the hand and the place of the arm.
        n: grasps for each instance; fewer if (almost) no more exist; `shortfall_note` says why.
        seed: seed of the random numbers.
        settings: sampling settings.
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
    _require_known_names(settings.weights, objects, "weights: the scene does not have object")

    def sampled() -> Iterator[tuple[str, GraspSet]]:
        from burg_drake.station import instance_pose

        sampler = ObjectSampler(scene.library, station, n, seed, settings)
        screen = None if settings.blind else build_hand_clearance(scene, station)[0]
        found: dict[tuple[str, tuple[ApproachCone, ...]], GraspSet] = {}
        for name in names:
            object, X_WO = scene.instance(name).object, instance_pose(scene, station, name)
            cones = _approach_cones(sampler.surface(object), X_WO, station, name, settings)
            if screen is not None:
                yield name, sampler.sample_clear(object, cones, screen, name, X_WO)
            else:
                if (object, cones) not in found:
                    found[object, cones] = sampler.sample(object, cones)
                yield name, found[object, cones]

    return sampled()


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
        station: station with the hand.
        n, seed, settings: as for `sample_on_scene`.
        objects: names in the library; all if None.

    Returns:
        Names and grasps, in the frames of the objects.

    Raises:
        InvalidInputError: n is below 1, or a setting does not fit, such as limits of the approach,
            as the objects of a library have no pose.
        UnknownNameError: no such object, or a mesh file is missing.
    """
    _check_count(n)
    if settings.approach_angle_deg is not None or settings.from_arm_side:
        raise InvalidInputError(
            f"the objects of library {library.name!r} are in no scene, so there is no"
            " straight down and no side of the arm; give a scene to limit the approach"
        )
    where = f"library {library.name!r} has no object"
    names = _require_known_names(objects, library.objects, where)
    _require_known_names(settings.weights, library.objects, f"weights: {where}")

    def sampled() -> Iterator[tuple[str, GraspSet]]:
        from burg_drake.grasping import hand_clearance_alone

        sampler = ObjectSampler(library, station, n, seed, settings)
        for name in names:
            if settings.blind:
                yield name, sampler.sample(name, ())
            else:
                screen = hand_clearance_alone(library, name, station)
                yield name, sampler.sample_clear(name, (), screen, name, np.eye(4))

    return sampled()


class ObjectSampler:
    """Samples grasps on objects of one library with the same settings."""

    def __init__(
        self,
        library: ObjectLibrary,
        station: Station,
        n: int,
        seed: int,
        settings: SamplingSettings,
    ) -> None:
        from burg_drake.station import check_hand

        self._library, self._station = library, station
        self._n, self._seed, self._settings = n, seed, settings
        path, packages = station.hand_path, station.packages
        low, high = check_hand(station.hand, station.hand_model, path, packages).pad_bounds
        self._pad = (low[2], high[2])  # along z of G [m]
        self._surfaces: dict[str, trimesh.Trimesh] = {}

    def surface(self, object: str) -> trimesh.Trimesh:
        """The surface of an object, read once."""
        if object not in self._surfaces:
            self._surfaces[object] = self._library.surface(object)
        return self._surfaces[object]

    def sample(
        self, object: str, cones: tuple[ApproachCone, ...], accept: Accept | None = None
    ) -> GraspSet:
        """Samples grasps of an object; see `sample_antipodal`."""
        from burg_drake.grasping import AntipodalSettings, sample_antipodal

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
        if settings.slippery:  # from shares of the sampler's friction to shares of the object's
            score = 1.0 - SLIPPERY_FRICTION_FACTOR * (1.0 - grasps.score)
            grasps = dataclasses.replace(grasps, score=score).select(score < 0.0)
        return drop_equal_grasps(grasps)

    def sample_clear(
        self,
        object: str,
        cones: tuple[ApproachCone, ...],
        screen: HandClearance,
        name: str,
        X_WO: Array,
    ) -> GraspSet:
        """Samples collision-free grasps of an object with this name and pose (4, 4) in the screen.

        The provenance of the grasps has, under `blocked`, `ClearanceFilter.blocked`.
        """
        accept = self.clearance_filter(object, screen, name, X_WO)
        grasps = self.sample(object, cones, accept)
        notes = {"target": name, "blocked": dict(accept.blocked), "margin": self._settings.margin}
        return dataclasses.replace(grasps, provenance={**grasps.provenance, **notes})

    def clearance_filter(
        self, object: str, screen: HandClearance, name: str, X_WO: Array
    ) -> ClearanceFilter:
        """The filter of `sample_clear`."""
        from burg_drake.geometry import Surface
        from burg_drake.grasping import jaws_of

        surface, friction = Surface.of(self.surface(object)), self._friction(object)
        jaws = jaws_of(self._station.hand, self._station.hand_model, self._station.packages)
        return ClearanceFilter(screen, name, X_WO, surface, jaws, friction, self._settings)

    def _friction(self, object: str) -> float:
        given = self._settings.friction
        friction = self._library.entry(object).friction if given is None else given
        return friction * (SLIPPERY_FRICTION_FACTOR if self._settings.slippery else 1.0)


def _check_count(n: int) -> None:
    if n < 1:
        raise InvalidInputError(f"grasps per object is {n}; give 1 or more")


def _require_known_names(
    names: Iterable[str] | None, known: Iterable[str], what: str
) -> tuple[str, ...]:
    """The names without repetitions; all known names if None."""
    chosen = tuple(dict.fromkeys(known if names is None else names))
    for name in chosen:
        if name not in known:
            raise UnknownNameError(f"{what} {name!r}; {suggest_names(name, known)}")
    return chosen


def _approach_cones(
    surface: trimesh.Trimesh,
    X_WO: Array,
    station: Station,
    instance: str,
    settings: SamplingSettings,
) -> tuple[ApproachCone, ...]:
    """Limits of the approach to an instance; none if they allow every direction."""
    angle = settings.approach_angle_deg
    cones = approach_cone_from_above(X_WO, DEFAULT_APPROACH_ANGLE_DEG if angle is None else angle)
    if settings.from_arm_side:
        p_WM = transform_points(X_WO, surface.bounds).mean(axis=0)
        cones += (approach_half_space_of_arm(X_WO, p_WM, station, instance),)
    return cones


LINE_REJECTIONS = {
    PairRejection.too_long: "are longer than the hand can open",
    PairRejection.slanted: (
        "meet the surface at an angle at which a friction of {friction:g} does not hold"
    ),
    PairRejection.no_room: "leave no room for a finger",
    PairRejection.no_approach: "allow no approach within the limits",
}
"""Why the sampler rejects lines through an object, in words."""
SAMPLING_REMEDIES = {
    PairRejection.too_long: "a hand that opens wider would help",
    PairRejection.slanted: "more friction would help",
    PairRejection.no_room: "a hand with thinner fingers would help",
    PairRejection.no_approach: "wider limits of the approach would help",
    PAD_CONTACT: "smaller pads would help",
}
"""Remedies for each cause of a shortfall."""
TARGET_WORDS = "the object itself"  # The target and the table in messages.
TABLE_WORDS = "the table"


def shortfall_note(name: str, asked: int, provenance: Mapping[str, Any], found: int) -> str:
    """Reason for fewer grasps than requested, by the sampler's counts; "" if there are enough.

    Args:
        name: name of the instance or object.
        asked: number of requested grasps.
        provenance: provenance of the grasps by `sample_on_scene` or `sample_library`.
        found: number of sampled grasps.
    """
    if found >= asked:
        return ""
    text = f"{name}: only {found:,} of {asked:,} grasps were found"
    lines, blocked = provenance.get("left_out", {}), provenance.get("blocked", {})
    parts, causes = [], {}
    tried = provenance.get("tried", 0)
    if tried < max(asked, 10 * found) and lines:  # lines are rare
        parts.append(_describe_lines(provenance))
        causes = dict(lines)
    if sum(blocked.values()):
        bodies = _name_blockers(blocked, provenance.get("target", name))
        margin = provenance.get("margin", 0.0)
        parts.append(f"of {tried:,} antipodal grasps tried, {_describe_bodies(bodies, margin)}")
        causes = bodies if tried > found else causes
    if not parts:
        return text
    return f"{text}: {'; '.join(parts)}; {_remedy(causes, provenance)}"


def _name_blockers(blocked: Mapping[str, int], target: str) -> dict[str, int]:
    """Counts by displayed name of the body, largest first."""
    names = {target: TARGET_WORDS, "table": TABLE_WORDS}
    counts = sorted(blocked.items(), key=lambda item: -item[1])
    return {names.get(body, body): count for body, count in counts if count}


def _describe_lines(provenance: Mapping[str, Any]) -> str:
    left_out = sorted(provenance["left_out"].items(), key=lambda item: -item[1])
    friction = provenance.get("friction", math.nan)
    parts = [f"{n:,} {LINE_REJECTIONS[why].format(friction=friction)}" for why, n in left_out if n]
    return f"of {provenance['rays']:,} lines through it {_join_parts(parts)}"


def _describe_bodies(bodies: Mapping[str, int], margin: float) -> str:
    hit = {body: n for body, n in bodies.items() if body != PAD_CONTACT}
    parts = [f"{body} in {n:,}" for body, n in list(hit.items())[:3]]
    rest = sum(list(hit.values())[3:])
    parts += [f"others in {rest:,}"] if rest else []
    meets = f"comes within {1e3 * margin:g} mm of" if margin else "hits"
    text = f"the open hand {meets} {_join_parts(parts)}" if parts else ""
    if bodies.get(PAD_CONTACT):
        pads = f"its pads meet the object elsewhere in {bodies[PAD_CONTACT]:,}"
        text += f", and {pads}" if text else pads
    return text


def _remedy(causes: Mapping[str, int], provenance: Mapping[str, Any]) -> str:
    """Remedy for the most frequent cause."""
    cause = max(causes, key=causes.__getitem__)
    if provenance.get("margin") and cause not in SAMPLING_REMEDIES:
        return "a smaller margin would help"
    known = {
        **SAMPLING_REMEDIES,
        TABLE_WORDS: "another pose of the object, or a hand with thinner fingers, would help",
        TARGET_WORDS: "other directions of the approach, or a slimmer hand, would help",
    }
    return known.get(cause, f"more room around {cause} would help")


def _join_parts(parts: list[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
