"""Antipodal grasp sampling on triangle meshes for parallel-jaw hands.

Pairs of contacts come from `contact_pairs`. The grasp frame G lies midway with +x along the closing
line; the approach direction +z is uniform about it, or about the part of the turn that approach
cones leave. The hand's own body is looked at only if the caller brings a test for it.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    InvalidInputError,
    content_hash,
    grasp_from_axes,
    perpendicular,
    pregrasp,
)
from burg_drake.core.grasps import GraspSet
from burg_drake.geometry import Surface
from burg_drake.grasping.sampling.approach import ApproachCone, random_approach_angles
from burg_drake.grasping.sampling.contact_pairs import (
    BLOCK,
    FINGER_CLEARANCE,
    ContactPairs,
    draw_pairs,
)
from burg_drake.grasping.similarity import farthest_points
from burg_drake.objects.library import DEFAULT_FRICTION

if TYPE_CHECKING:
    import trimesh

SAMPLER_VERSION = 3
"""Raised when the same arguments begin to give other grasps; 2 differs from 1 by rounding, where
there is an approach cone, and 3 gives up earlier where a test passes very little."""

PANDA_OPENING = (0.0, 0.08)
"""Smallest and largest distance between the Franka Hand's fingers [m] (its datasheet)."""

PANDA_PAD = (-0.009, 0.0095)
"""From where to where the Franka Hand's rubber tips reach along z of G [m]: 0.0584 + 0.04525 m from
the hand's frame, 18.5 mm long (franka_ros, franka_hand.xacro), where G is at 0.1034 m."""

PATIENCE = 2**18
RARITY = 20_000
"""Sampling ends after `PATIENCE + RARITY * found` rays: where none of the first 262,144 rays finds
a grasp, or less than one ray in 20,000 does, the object counts as having no (more) grasps."""

TEST_PATIENCE = 20_000
TEST_RARITY = 5_000
TEST_EFFORT = 1_000
"""It ends, too, after `TEST_PATIENCE + min(TEST_RARITY * accepted, TEST_EFFORT * n)` grasps that
`accept` was asked for: where it takes none of the first 20,000, or less than one in 5,000, and in
any case after a thousand for each grasp that is wanted, which is a minute for a thousand grasps."""

NO_APPROACH = "no approach"
"""Why a pair gives no grasp, next to what `contact_pairs` leaves out: no approach direction about
its closing line lies in the cones."""

Accept = Callable[[Array], NDArray[np.bool_]]
"""Which of the grasps (N, 4, 4) in the object frame to keep, (N,); the answer for a grasp must not
depend on the others."""


@dataclass(frozen=True, kw_only=True)
class AntipodalSettings:
    """What makes a grasp antipodal, and the poses that a pair of contacts gives.

    Attributes:
        friction: coefficient between object and fingers; the cone's half angle is its arctangent.
        opening: smallest and largest distance between the fingers [m]. Widths are at most the
            largest less `FINGER_CLEARANCE` on both sides.
        approaches: evenly spaced approach angles for each pair of contacts, the first one random.
        approach_cones: where approach directions lie; of several cones all have to hold at once.
            Anywhere if there are none. Approaches are uniform among the directions that a pair's
            closing line leaves; pairs whose line leaves none give no grasp.
        standoffs: every pose is given once with each of these distances between G and the contacts
            [m]. Above 0 the hand stays back, as in `frames.pregrasp`, and holds with its finger
            tips; below 0 it goes further, and holds with what is behind the middle of its pads.
        pad: from where to where the pads reach along z of G [m]; bounds of the standoffs.
        diverse: of this many times n grasps those n are kept that `farthest_points` selects, in its
            order: any first part of them covers the grasps, too.

    Raises:
        InvalidInputError: a value is out of range.
    """

    friction: float = DEFAULT_FRICTION
    opening: tuple[float, float] = PANDA_OPENING
    approaches: int = 1
    approach_cones: tuple[ApproachCone, ...] = ()
    standoffs: tuple[float, ...] = (0.0,)
    pad: tuple[float, float] = PANDA_PAD
    diverse: int = 1

    def __post_init__(self) -> None:
        for name in ("opening", "standoffs", "pad"):  # plain numbers, as they go into files
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

    Both contacts lie within the friction cone of their surface, both fingers close on them from
    outside of the material, and neither meets another part of the object on its way from the open
    position. Fingers are exchangeable; of the two equal poses the canonical one is given, whose
    closing axis has a positive component of largest magnitude (`GraspSet.canonical`).

    Distribution: a first contact is uniform on the surface, or has the density of the weights; the
    line from it is uniform in the solid angle of the friction cone. A pair of patches dA1, dA2 at
    distance r, whose normals make angles a1, a2 with the line between them, is thus found with a
    probability in proportion to (w1 cos a2 + w2 cos a1) / r^2 dA1 dA2. It does not depend on how
    the object lies or is triangulated. Approaches are uniform among the allowed turns about the
    line. A test leaves of this what passes; with `diverse` above 1 the set covers the grasps
    instead.

    Args:
        mesh: surface in the object frame O [m], faces wound so that normals point outward. It need
            not be watertight.
        n: number of grasps.
        rng: the same generator state gives the same grasps, and, unless they are to be diverse, the
            first of a larger n.
        settings: what makes a grasp antipodal; for the Franka Hand if None.
        weights: (F,) density of first contacts on each face of the mesh, from 0, in any unit.
            Second contacts lie where the lines lead.
        accept: keeps grasps that pass, such as those at which a hand is clear; n counts these.
        object: name for the set's `object` column.

    Returns:
        n grasps, or fewer where the object has (almost) no more; see `PATIENCE` and
        `TEST_PATIENCE`. `width` is the distance of the contacts; `score` is the share of the
        friction that is left over, from 0 to 1 for a line along both normals. The provenance has
        the parameters, the state of rng, how many `rays` and grasps `tried` it took, and why the
        others were `left_out`.

    Raises:
        InvalidInputError: a parameter is out of range, or the weights do not fit the mesh.
        MeshError: the mesh has no face with area, is not finite, or is wound inside out.
    """
    settings = settings or AntipodalSettings()
    if n < 0:
        raise InvalidInputError(f"n is {n}; give the number of grasps, 0 or more")
    state = json.loads(json.dumps(rng.bit_generator.state, default=np.ndarray.tolist))
    found = _collect(Surface.of(mesh, weights), n * settings.diverse, rng, settings, accept)
    asked = asdict(settings)
    diverse = asked.pop("diverse")
    provenance = {
        "sampler": "antipodal",
        "version": SAMPLER_VERSION,
        "n": int(n),
        **asked,
        "finger_clearance": FINGER_CLEARANCE,
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
class _Grasps:
    """N grasps, and what it took to find them."""

    X_OG: Array
    width: Array
    score: Array
    rays: int = 0
    tried: int = 0
    left_out: Counter[str] = field(default_factory=Counter)


def _collect(
    surface: Surface,
    n: int,
    rng: np.random.Generator,
    settings: AntipodalSettings,
    accept: Accept | None,
) -> _Grasps:
    """The first n grasps of a stream that depends on the random numbers alone."""
    parts = [_Grasps(np.empty((0, 4, 4)), np.empty(0), np.empty(0))]
    kept = tried = rays = 0
    left_out: Counter[str] = Counter()

    def worth_testing() -> bool:
        bound = TEST_PATIENCE + min(TEST_RARITY * kept, TEST_EFFORT * n)
        return kept < n and tried < bound

    while worth_testing() and rays < PATIENCE + RARITY * tried:
        for pairs in draw_pairs(surface, rng, settings.friction, settings.opening):
            block = _grasps_on(pairs, settings, rng)
            tried += len(block.X_OG)
            parts.append(block if accept is None else _accepted(block, accept))
            kept += len(parts[-1].X_OG)
            rays += BLOCK
            left_out += pairs.left_out + block.left_out
            if not worth_testing():
                break
    return _Grasps(
        np.concatenate([part.X_OG for part in parts])[:n],
        np.concatenate([part.width for part in parts])[:n],
        np.concatenate([part.score for part in parts])[:n],
        rays,
        tried,
        left_out,
    )


def _grasps_on(
    pairs: ContactPairs, settings: AntipodalSettings, rng: np.random.Generator
) -> _Grasps:
    """All grasps of each pair in turn: each approach, and on it each standoff."""
    closing, center = pairs.p_OC2 - pairs.p_OC1, 0.5 * (pairs.p_OC1 + pairs.p_OC2)
    width = np.linalg.norm(closing, axis=1)
    u, v = perpendicular(closing / width[:, None])
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
    left_out = Counter({NO_APPROACH: len(width) - len(allowed)})
    return _Grasps(X_OG, width[pair], score[pair], left_out=left_out)


def _accepted(grasps: _Grasps, accept: Accept) -> _Grasps:
    passed = np.asarray(accept(grasps.X_OG), dtype=bool)
    if passed.shape != (len(grasps.X_OG),):
        raise InvalidInputError(
            f"accept returned an array of shape {passed.shape} for {len(grasps.X_OG)}"
            " grasps; it must return one true/false value a grasp"
        )
    return _Grasps(grasps.X_OG[passed], grasps.width[passed], grasps.score[passed])
