"""Antipodal grasp sampling on triangle meshes for parallel-jaw hands.

A point is drawn on the surface, and a line through the material within the friction cone about the
inward normal. If the line leaves the material within the friction cone of that face, the two
points are an antipodal pair (Nguyen, "Constructing force-closure grasps", IJRR 1988).

The grasp frame G lies midway with +x along the closing line. The approach direction +z is uniform
about it, within the approach cones. The hand's body is checked only if the caller passes a test.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    GraspSet,
    Indices,
    InvalidInputError,
    content_hash,
    grasp_from_axes,
    perpendicular_axes,
    pregrasp,
)
from burg_drake.geometry import Surface
from burg_drake.grasping.approach_cones import ApproachCone, random_approach_angles
from burg_drake.grasping.neighbour_search import farthest_points
from burg_drake.objects import DEFAULT_FRICTION

if TYPE_CHECKING:
    import trimesh


class ContactPairSettings:
    """Clearance and width of finger contacts, and batch sizes."""

    finger_clearance = 0.001  # Metres that each open finger keeps to its contact.
    min_width = 1e-4  # Metres. Closer contacts are the two sides of a surface without thickness.
    lines_per_chunk = 8192  # Lines drawn at a time; fixed, so that the first grasps suit any n.
    rays_per_block = 1024  # Rays cast at a time; divides `lines_per_chunk`.


class PairRejection:
    """Reasons why a line gives no pair of contacts, or a pair no grasp."""

    too_long = "too long"  # The line does not leave the material within the hand's opening.
    # A normal is outside the friction cone about the line, or the width does not fit the hand.
    slanted = "slanted"
    no_room = "no room"  # The object is in the way of a finger.
    no_approach = "no approach"  # No approach direction about the closing line lies in the cones.


@dataclass(frozen=True, eq=False)
class ContactPairs:
    """N pairs of opposing contacts.

    Attributes:
        p_OC1, p_OC2: (N, 3) contact points [m]; the closing direction is from C1 to C2, and its
            component of largest magnitude is positive.
        friction_needed: (N,) tangent of the larger of the two angles between the closing line and
            the surface normals: the smallest friction coefficient that holds the pair.
        left_out: number of lines without a pair, or of rejected pairs, by reason.
    """

    p_OC1: Array
    p_OC2: Array
    friction_needed: Array
    left_out: Counter[str] = field(default_factory=Counter)


def draw_pairs(
    surface: Surface, rng: np.random.Generator, friction: float, opening: tuple[float, float]
) -> Iterator[ContactPairs]:
    """Yields the pairs of `ContactPairSettings.lines_per_chunk` random lines, in blocks of
    `ContactPairSettings.rays_per_block` lines.

    First contacts have the density of `Surface.draw`, and lines are uniform in the solid angle of
    the friction cone about the inward normal. All pairs of a line that fingers can close on are
    returned: a line into the side of a mug leaves the material on the inside of the near wall and
    again on the outside of the far wall.

    Args:
        surface: the surface to sample.
        rng: random numbers; all those for the lines are drawn before the first pairs are yielded.
        friction: coefficient; the cone's half angle is its arctangent.
        opening: smallest and largest distance between the fingers [m].
    """
    count, size = ContactPairSettings.lines_per_chunk, ContactPairSettings.rays_per_block
    p, face = surface.draw(count, rng)
    line = _directions_in_cone(-surface.normals[face], np.arctan(friction), rng)
    for start in range(0, count, size):
        block = slice(start, start + size)
        yield _pairs_along(surface, p[block], face[block], line[block], friction, opening)


def _pairs_along(
    surface: Surface,
    p1: Array,
    face1: Indices,
    line: Array,
    friction: float,
    opening: tuple[float, float],
) -> ContactPairs:
    """The pairs on lines (N, 3) into the material from points (N, 3) on faces (N,)."""
    widest = opening[1] - 2.0 * ContactPairSettings.finger_clearance
    ray, face2, width = surface.rays.all_hits(p1, line, widest)
    left_out = Counter({PairRejection.too_long: len(p1) - len(np.unique(ray))})
    p1, face1, line = p1[ray], face1[ray], line[ray]
    cosine = np.minimum(_dot(-surface.normals[face1], line), _dot(surface.normals[face2], line))
    held = cosine >= 1.0 / np.hypot(1.0, friction)
    held &= (width >= max(opening[0], ContactPairSettings.min_width)) & (width <= widest)
    left_out[PairRejection.slanted] = int((~held).sum())
    p1, line, width, cosine = p1[held], line[held], width[held], cosine[held]
    p2 = p1 + width[:, None] * line
    travel = 0.5 * (opening[1] - width)
    free = _finger_path_free(surface, p1, -line, travel)
    free &= _finger_path_free(surface, p2, line, travel)
    left_out[PairRejection.no_room] = int((~free).sum())
    p1, p2, line, cosine = p1[free], p2[free], line[free], np.minimum(cosine[free], 1.0)
    largest = np.abs(line).argmax(axis=1)[:, None]
    turned = np.take_along_axis(line, largest, axis=1) < 0.0
    return ContactPairs(
        np.where(turned, p2, p1),
        np.where(turned, p1, p2),
        np.sqrt(1.0 - cosine**2) / cosine,
        left_out,
    )


def _finger_path_free(
    surface: Surface, p_OC: Array, outward: Array, travel: Array
) -> NDArray[np.bool_]:
    """(N,) whether fingers reach the contacts (N, 3) from `travel` (N,) [m] away along `outward`.

    The first face that the ray meets decides. A face within the finger's travel is in the way. A
    face seen from behind, at any distance, means that the contact lies inside material (solids that
    overlap or touch, or a surface that is doubled with both windings).
    """
    face, distance = surface.rays.first_hits(p_OC, outward)
    from_behind = _dot(surface.normals[face], outward) > 0.0
    return (face < 0) | ((distance > travel) & ~from_behind)


def _dot(a: Array, b: Array) -> Array:
    """(N,) inner products of the rows of (N, 3) arrays."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _directions_in_cone(axis: Array, half_angle: float, rng: np.random.Generator) -> Array:
    """(N, 3) unit vectors, uniform on the spherical caps about unit vectors `axis` (N, 3)."""
    cosine = 1.0 - rng.random((len(axis), 1)) * (1.0 - np.cos(half_angle))
    azimuth = rng.uniform(0.0, 2.0 * np.pi, (len(axis), 1))
    u, v = perpendicular_axes(axis)
    sine = np.sqrt(1.0 - cosine**2)
    directions: Array = cosine * axis + sine * (np.cos(azimuth) * u + np.sin(azimuth) * v)
    return directions


SAMPLER_VERSION = 3
"""Increase it with a change after which the same arguments give other grasps."""


class SamplingEffort:
    """Limits after which sampling ends with fewer grasps than wanted."""

    min_rays = 2**18  # Rays after which sampling may end.
    rays_per_grasp = 20_000  # Further rays for each grasp tried.
    min_tests = 20_000  # Grasps tested by `accept` after which sampling may end.
    tests_per_accepted = 5_000  # Further tests for each grasp accepted.
    tests_per_wanted = 1_000  # Upper bound of the further tests, for each grasp wanted.


Accept = Callable[[Array], NDArray[np.bool_]]
"""Takes grasps X_OG (N, 4, 4) and returns whether to keep each (N,). The result for a grasp must
not depend on the other grasps."""


@dataclass(frozen=True, kw_only=True)
class AntipodalSettings:
    """Conditions of antipodal contacts, and the grasp poses for a pair of contacts.

    Attributes:
        friction: coefficient between object and fingers; the cone's half angle is its arctangent.
        opening: smallest and largest distance between the fingers [m]. Grasps are at most as wide
            as the largest, less `ContactPairSettings.finger_clearance` on both sides.
        approaches: number of evenly spaced approach angles for each pair of contacts; the first is
            random.
        approach_cones: cones in which approach directions have to lie, all at once; any direction
            if empty. Approaches are uniform among the allowed directions perpendicular to a pair's
            closing line; pairs without an allowed direction give no grasp.
        standoffs: distances between G and the contacts [m]; every pose is returned once with each.
            Above 0 the hand stays back, as in `core.pregrasp`, and holds with its finger tips;
            below 0 it goes further, and holds with the part of its pads behind their middle.
        pad: range of the pads along z of G [m]; bounds of the standoffs.
        diverse: samples this many times n grasps and keeps the n that `farthest_points` selects, in
            its order. The first k of them cover the sampled grasps, for any k.

    Raises:
        InvalidInputError: a value is out of range.
    """

    friction: float = DEFAULT_FRICTION
    opening: tuple[float, float] = (0.0, 0.08)
    approaches: int = 1
    approach_cones: tuple[ApproachCone, ...] = ()
    standoffs: tuple[float, ...] = (0.0,)
    pad: tuple[float, float] = (-0.009, 0.0095)
    diverse: int = 1

    def __post_init__(self) -> None:
        for name in ("opening", "standoffs", "pad"):  # plain numbers for files
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        object.__setattr__(self, "friction", float(self.friction))
        object.__setattr__(self, "approach_cones", tuple(self.approach_cones))
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise InvalidInputError(
                f"friction is {self.friction}; antipodal grasps need a number above 0"
            )
        if not 0.0 <= self.opening[0] < self.opening[1] < np.inf:
            raise InvalidInputError(
                f"opening is {self.opening}; give the smallest and largest finger distance [m]"
            )
        if self.approaches < 1:
            raise InvalidInputError(
                f"approaches is {self.approaches}; give 1 or more per contact pair"
            )
        if not self.standoffs:
            raise InvalidInputError("standoffs is empty; give one or more distances, such as 0")
        low, high = self.pad
        for distance in self.standoffs:
            if not low <= distance <= high:
                raise InvalidInputError(
                    f"standoff {1e3 * distance:g} mm puts the contacts outside the finger"
                    f" pads; give {1e3 * low:g} to {1e3 * high:g} mm"
                )
        if self.diverse < 1:
            raise InvalidInputError(
                f"diverse is {self.diverse}; give a factor of 1 or more: so many times n"
                " grasps are sampled"
            )


def sample_antipodal(
    mesh: trimesh.Trimesh,
    n: int,
    rng: np.random.Generator,
    settings: AntipodalSettings | None = None,
    *,
    weights: ArrayLike | None = None,
    accept: Accept | None = None,
    object: str = "",
) -> GraspSet:
    """Samples grasps whose contacts are antipodal.

    Both contacts lie within the friction cone of their surface. Both fingers close on them from
    outside the material without meeting another part of the object. Fingers are exchangeable; of
    the two equal poses the canonical one is returned, whose closing axis has a positive component
    of largest magnitude (`GraspSet.canonical`).

    Distribution: the first contact is uniform on the surface, or has the density of the weights;
    the line from it is uniform in the solid angle of the friction cone. A pair of patches dA1, dA2
    at distance r, whose normals make angles a1, a2 with the line between them, is thus found with a
    probability proportional to (w1 cos a2 + w2 cos a1) / r^2 dA1 dA2, where w1 and w2 are the
    densities of first contacts. It does not depend on the object's pose or triangulation.
    Approaches are uniform among the allowed angles about the line. With `accept`, this is the
    distribution before the test; with `diverse` above 1, that of the grasps to select from.

    Args:
        mesh: surface in the object frame O [m], faces wound so that normals point outward. It need
            not be watertight.
        n: number of grasps.
        rng: the same generator state gives the same grasps, and, with `diverse` at 1, the first
            ones of a larger n.
        settings: see `AntipodalSettings`; for the Franka Hand if None.
        weights: (F,) density of first contacts on each face of the mesh, at least 0, in any unit.
            Second contacts follow from the lines.
        accept: test of grasps, for example whether a hand is clear; n counts grasps that pass.
        object: name for the set's `object` column.

    Returns:
        n grasps, or fewer if the object has (almost) no more; see `SamplingEffort`. `width` is the
        distance of the contacts; `score` is the unused share of the friction, from 0 to 1 (line
        along both normals). The provenance has the parameters, the state of rng, the numbers of
        `rays` and of grasps `tried`, and the numbers `left_out` by reason.

    Raises:
        InvalidInputError: a parameter is out of range, or the weights do not fit the mesh.
        MeshError: the mesh has no face with area, is not finite, or is wound inside out.
    """
    settings = settings or AntipodalSettings()
    if n < 0:
        raise InvalidInputError(f"n is {n}; give the number of grasps, 0 or more")
    state = json.loads(json.dumps(rng.bit_generator.state, default=np.ndarray.tolist))
    found = _collect_grasps(Surface.of(mesh, weights), n * settings.diverse, rng, settings, accept)
    parameters = asdict(settings)
    diverse = parameters.pop("diverse")
    provenance = {
        "sampler": "antipodal",
        "version": SAMPLER_VERSION,
        "n": int(n),
        **parameters,
        "finger_clearance": ContactPairSettings.finger_clearance,
        "weights": None if weights is None else content_hash(np.asarray(weights, float)),
        "tested": accept is not None,
        "diverse": diverse,
        "mesh": content_hash(
            np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        ),
        "rng": state,
        "rays": found.rays,
        "tried": found.tried,
        "left_out": dict(found.left_out),
    }
    grasps = GraspSet.create(
        found.X_OG, object=object, width=found.width, score=found.score, provenance=provenance
    )
    if settings.diverse == 1:
        return grasps
    return grasps.select(farthest_points(grasps.X_OG, min(n, len(grasps))))


@dataclass(frozen=True, eq=False)
class _GraspBatch:
    """N grasps, and the effort of finding them."""

    X_OG: Array
    width: Array
    score: Array
    rays: int = 0
    tried: int = 0
    left_out: Counter[str] = field(default_factory=Counter)


def _collect_grasps(
    surface: Surface,
    n: int,
    rng: np.random.Generator,
    settings: AntipodalSettings,
    accept: Accept | None,
) -> _GraspBatch:
    """The first n accepted grasps of a stream that does not depend on n."""
    parts = [_GraspBatch(np.empty((0, 4, 4)), np.empty(0), np.empty(0))]
    kept = tried = rays = 0
    left_out: Counter[str] = Counter()

    effort = SamplingEffort

    def tests_left() -> int:
        further = min(effort.tests_per_accepted * kept, effort.tests_per_wanted * n)
        return effort.min_tests + further - tried

    def worth_testing() -> bool:
        return kept < n and tests_left() > 0

    def blocks_to_test() -> int:
        """As many as likely hold the missing grasps, as one test of many grasps is quicker."""
        size, chunk = ContactPairSettings.rays_per_block, ContactPairSettings.lines_per_chunk
        if not kept:
            return 1
        missing, affordable = (n - kept) / kept, tests_left() / tried
        return max(1, min(int(min(missing, affordable) * rays), chunk) // size)

    while worth_testing() and rays < effort.min_rays + effort.rays_per_grasp * tried:
        stream = draw_pairs(surface, rng, settings.friction, settings.opening)
        while group := list(islice(stream, blocks_to_test())):
            blocks = [_grasps_on(pairs, settings, rng) for pairs in group]
            for pairs, block, passed in zip(group, blocks, _accepted(blocks, accept), strict=True):
                tried += len(block.X_OG)
                parts.append(passed)
                kept += len(passed.X_OG)
                rays += ContactPairSettings.rays_per_block
                left_out += pairs.left_out + block.left_out
                if not worth_testing():
                    break
            if not worth_testing():
                break
    columns = zip(*((part.X_OG, part.width, part.score) for part in parts), strict=True)
    X_OG, width, score = (np.concatenate(column)[:n] for column in columns)
    return _GraspBatch(X_OG, width, score, rays, tried, left_out)


def _grasps_on(
    pairs: ContactPairs, settings: AntipodalSettings, rng: np.random.Generator
) -> _GraspBatch:
    """All grasps of each pair in turn: for each approach all standoffs."""
    closing, center = pairs.p_OC2 - pairs.p_OC1, 0.5 * (pairs.p_OC1 + pairs.p_OC2)
    width = np.linalg.norm(closing, axis=1)
    u, v = perpendicular_axes(closing / width[:, None])
    turn = random_approach_angles(settings.approach_cones, u, v, settings.approaches, rng)
    allowed = np.flatnonzero(~np.isnan(turn[:, 0]))
    turn = turn[allowed, :, None]
    approach = np.cos(turn) * u[allowed, None] + np.sin(turn) * v[allowed, None]
    pair = np.repeat(allowed, settings.approaches)
    X_OG = grasp_from_axes(closing[pair], approach.reshape(-1, 3), center[pair])
    if settings.standoffs != (0.0,):
        moved = [pregrasp(X_OG, distance) for distance in settings.standoffs]
        X_OG = np.stack(moved, axis=1).reshape(-1, 4, 4)
        pair = np.repeat(pair, len(settings.standoffs))
    score = 1.0 - pairs.friction_needed / settings.friction
    left_out = Counter({PairRejection.no_approach: len(width) - len(allowed)})
    return _GraspBatch(X_OG, width[pair], score[pair], left_out=left_out)


def _accepted(blocks: Sequence[_GraspBatch], accept: Accept | None) -> list[_GraspBatch]:
    """The accepted grasps of each block."""
    if accept is None:
        return list(blocks)
    X_OG = np.concatenate([block.X_OG for block in blocks])
    passed = np.asarray(accept(X_OG), dtype=bool)
    if passed.shape != (len(X_OG),):
        raise InvalidInputError(
            f"accept returned an array of shape {passed.shape} for {len(X_OG)}"
            " grasps; it must return one true/false value a grasp"
        )
    masks = np.split(passed, np.cumsum([len(block.X_OG) for block in blocks])[:-1])
    return [
        _GraspBatch(block.X_OG[mask], block.width[mask], block.score[mask])
        for block, mask in zip(blocks, masks, strict=True)
    ]
