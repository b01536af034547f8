"""Antipodal grasp sampling on triangle meshes for parallel-jaw hands.

A point is drawn on the surface, a line through the material within the friction cone about the
inward normal; where the line leaves the material again, within the friction cone of that face, the
two points are a pair of contacts that two frictional fingers can squeeze without slipping (Nguyen,
"Constructing force-closure grasps", IJRR 1988). The grasp frame G lies midway with +x along the
line; the approach direction +z is uniform about it, or about the part of the turn that an approach
cone leaves. The hand's own body is not looked at here.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.content import content_hash
from burg_drake.core.errors import InvalidInputError, MeshError
from burg_drake.core.frames import Array, grasp_from_axes
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.approach import ApproachCone
from burg_drake.grasping.rays import Indices, RayCaster
from burg_drake.objects.entry import DEFAULT_FRICTION

if TYPE_CHECKING:
    import trimesh

SAMPLER_VERSION = 1
"""Raised when the same arguments begin to give other grasps."""

PANDA_OPENING = (0.0, 0.08)
"""Smallest and largest distance between the Franka Hand's fingers [m] (its datasheet)."""

FINGER_CLEARANCE = 0.001
"""Room that each open finger keeps to its contact [m], so that the open hand can be placed."""

MIN_WIDTH = 1e-4
"""Contacts closer than this are the two sides of a surface without thickness [m]."""

CHUNK = 8192
"""Rays cast at a time. Constant, so that the first n grasps of a seed do not depend on n."""

PATIENCE = 2**18
RARITY = 20_000
"""Sampling ends after `PATIENCE + RARITY * found` rays: where none of the first 262,144 rays finds
a grasp, or less than one ray in 20,000 does, the object counts as having no (more) grasps."""


@dataclass(frozen=True)
class ContactPairs:
    """N pairs of opposing contacts.

    Attributes:
        p_OC1, p_OC2: (N, 3) contact points [m]; the closing direction is from C1 to C2, and its
            component of largest magnitude is positive.
        friction_needed: (N,) tangent of the larger of the two angles between the closing line and
            the surface normals: the smallest friction coefficient that holds the pair.
    """

    p_OC1: Array
    p_OC2: Array
    friction_needed: Array


def sample_antipodal(
    mesh: trimesh.Trimesh,
    n: int,
    rng: np.random.Generator,
    *,
    friction: float = DEFAULT_FRICTION,
    opening: tuple[float, float] = PANDA_OPENING,
    approaches: int = 1,
    approach_cone: ApproachCone | None = None,
    object: str = "",
) -> GraspSet:
    """Samples grasps whose contacts are antipodal.

    Both contacts lie within the friction cone of their surface, both fingers close on them from
    outside of the material, and neither meets another part of the object on its way from the open
    position. Fingers are exchangeable; of the two equal poses the one is given whose closing axis
    has a positive component of largest magnitude.

    Args:
        mesh: surface in the object frame O [m], faces wound so that normals point outward. It need
            not be watertight.
        n: number of grasps.
        rng: the same generator state gives the same grasps, and the first of a larger n.
        friction: coefficient between object and fingers; the cone's half angle is its arctangent.
        opening: smallest and largest distance between the fingers [m]. Widths are at most the
            largest less `FINGER_CLEARANCE` on both sides.
        approaches: evenly spaced approach angles for each pair of contacts, the first one random.
        approach_cone: where approach directions lie; anywhere if None. They are then uniform among
            the angles about the closing axis that the cone allows, and a pair of contacts without
            such an angle is left out: 60 degrees about straight down need a closing axis at most 60
            degrees from horizontal. The same generator state draws the same pairs for any cone.
        object: name of the library object.

    Returns:
        n grasps; fewer if there are none, or hardly any (see `PATIENCE`). `width` is the
        distance of the contacts. `score` is 1 where the closing line meets both surfaces at right
        angles and falls to 0 where all of the friction is needed: 1 - friction needed / friction.

    Raises:
        InvalidInputError: a parameter is out of its range.
        MeshError: the mesh has no faces, vertices that are not finite, or is wound inside out.
    """
    _check_parameters(n, friction, opening, approaches)
    surface = Surface.of(mesh)
    provenance = {
        "sampler": "antipodal",
        "version": SAMPLER_VERSION,
        "n": int(n),
        "friction": float(friction),
        "opening": [float(w) for w in opening],
        "finger_clearance": FINGER_CLEARANCE,
        "approaches": int(approaches),
        "approach_cone": None if approach_cone is None else asdict(approach_cone),
        "mesh": content_hash(
            np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        ),
        "rng": json.loads(json.dumps(rng.bit_generator.state, default=np.ndarray.tolist)),
    }
    poses, widths, scores = [np.empty((0, 4, 4))], [np.empty(0)], [np.empty(0)]
    found = rays = 0
    while found < n and rays < PATIENCE + RARITY * found:
        pairs = contact_pairs(surface, CHUNK, rng, friction, opening)
        closing, center = pairs.p_OC2 - pairs.p_OC1, 0.5 * (pairs.p_OC1 + pairs.p_OC2)
        pair, approach = _approach_directions(closing, approaches, approach_cone, rng)
        poses.append(grasp_from_axes(closing[pair], approach, center[pair]))
        widths.append(np.linalg.norm(closing, axis=1)[pair])
        scores.append(1.0 - pairs.friction_needed[pair] / friction)
        found += len(poses[-1])
        rays += CHUNK
    return GraspSet.create(
        np.concatenate(poses)[:n],
        object=object,
        width=np.concatenate(widths)[:n],
        score=np.concatenate(scores)[:n],
        provenance=provenance,
    )


@dataclass(frozen=True)
class Surface:
    """A mesh made ready for sampling; faces without area are left out.

    Attributes:
        triangles: (F, 3, 3) corners in the object frame [m].
        normals: (F, 3) outward unit normals.
        share: (F,) cumulative share of the area; the last entry is 1.
        rays: caster for these triangles.
    """

    triangles: Array
    normals: Array
    share: Array
    rays: RayCaster

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> Surface:
        """Reads a mesh.

        Raises:
            MeshError: see `sample_antipodal`.
        """
        vertices = np.asarray(mesh.vertices, np.float64)
        if not np.isfinite(vertices).all():
            raise MeshError("the mesh has vertices that are not finite; repair it before sampling")
        triangles = vertices[np.asarray(mesh.faces, np.int64).reshape(-1, 3)]
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.linalg.norm(cross, axis=1)
        kept = length > 0.0
        if not kept.any():
            raise MeshError("the mesh has no faces with area; nothing can be grasped")
        volume = np.einsum("ij,ij->", triangles[:, 0] - vertices.mean(axis=0), cross) / 6.0
        if volume < 0.0 and mesh.is_watertight:
            raise MeshError("the mesh is wound inside out; turn its faces with mesh.invert()")
        total = np.cumsum(length[kept])
        normals = cross[kept] / length[kept, None]
        return cls(triangles[kept], normals, total / total[-1], RayCaster(triangles[kept]))

    def draw(self, n: int, rng: np.random.Generator) -> tuple[Array, Indices]:
        """(n, 3) points uniform on the surface, and their faces (n,)."""
        face = np.searchsorted(self.share, rng.random(n), side="right")
        u, v = rng.random((2, n, 1))
        fold = u + v > 1.0  # the far half of the parallelogram, turned back into the triangle
        u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
        a, b, c = np.swapaxes(self.triangles[face], 0, 1)
        return a + u * (b - a) + v * (c - a), face


def contact_pairs(
    surface: Surface,
    n: int,
    rng: np.random.Generator,
    friction: float,
    opening: tuple[float, float],
) -> ContactPairs:
    """Casts n rays from random surface points and keeps the pairs that fingers can close on.

    One ray can give several pairs: a line into the side of a mug leaves the material on the inside
    of the near wall and again on the outside of the far wall, and fingers can close on both pairs.

    Args:
        surface: where to sample.
        n: number of rays.
        rng: random numbers.
        friction, opening: as for `sample_antipodal`.
    """
    widest = opening[1] - 2.0 * FINGER_CLEARANCE
    p1, face1 = surface.draw(n, rng)
    line = _directions_in_cone(-surface.normals[face1], np.arctan(friction), rng)
    ray, face2, width = surface.rays.all_hits(p1, line, widest)
    p1, face1, line = p1[ray], face1[ray], line[ray]
    cosine = np.minimum(_dot(-surface.normals[face1], line), _dot(surface.normals[face2], line))
    held = cosine >= 1.0 / np.hypot(1.0, friction)
    held &= (width >= max(opening[0], MIN_WIDTH)) & (width <= widest)
    p1, line, width, cosine = p1[held], line[held], width[held], cosine[held]
    p2 = p1 + width[:, None] * line
    travel = 0.5 * (opening[1] - width)
    free = _finger_path_free(surface, p1, -line, travel)
    free &= _finger_path_free(surface, p2, line, travel)
    p1, p2, line, cosine = p1[free], p2[free], line[free], np.minimum(cosine[free], 1.0)
    largest = np.abs(line).argmax(axis=1)[:, None]
    turned = np.take_along_axis(line, largest, axis=1) < 0.0
    return ContactPairs(
        np.where(turned, p2, p1), np.where(turned, p1, p2), np.sqrt(1.0 - cosine**2) / cosine
    )


def _finger_path_free(
    surface: Surface, p_OC: Array, outward: Array, travel: Array
) -> NDArray[np.bool_]:
    """(N,) whether fingers reach the contacts (N, 3) from `travel` (N,) [m] away along `outward`.

    What the ray meets first decides: a face within the finger's travel is in the way, and a face
    seen from behind, at any distance, means that the contact lies inside of material (solids that
    overlap or touch, a surface that is doubled with both windings).
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
    u, v = _perpendicular(axis)
    sine = np.sqrt(1.0 - cosine**2)
    return cosine * axis + sine * (np.cos(azimuth) * u + np.sin(azimuth) * v)


def _approach_directions(
    closing: Array, approaches: int, cone: ApproachCone | None, rng: np.random.Generator
) -> tuple[Indices, Array]:
    """Directions (M, 3) perpendicular to closing axes (N, 3), and whose they are (M,)."""
    u, v = _perpendicular(closing / np.linalg.norm(closing, axis=1, keepdims=True))
    first = rng.random((len(closing), 1))
    if cone is None:
        kept = np.arange(len(closing))
        angle = 2.0 * np.pi * first + 2.0 * np.pi * np.arange(approaches) / approaches
    else:
        middle, half = cone.turns(u, v)
        kept = np.flatnonzero(~np.isnan(half))
        share = (first[kept] + np.arange(approaches) / approaches) % 1.0
        angle = middle[kept, None] + half[kept, None] * (2.0 * share - 1.0)
    direction = np.cos(angle)[..., None] * u[kept, None] + np.sin(angle)[..., None] * v[kept, None]
    return np.repeat(kept, approaches), direction.reshape(-1, 3)


def _perpendicular(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors (N, 3) that make a right-handed frame with the unit vectors `axis`.

    Without branch or pole (Duff et al., "Building an orthonormal basis, revisited", JCGT 2017).
    """
    x, y, z = axis.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    u = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    v = np.stack([b, sign + y * y * a, -y], axis=1)
    return u, v


def _check_parameters(
    n: Any, friction: float, opening: tuple[float, float], approaches: Any
) -> None:
    if n < 0:
        raise InvalidInputError(f"n is {n}; give the number of grasps, 0 or more")
    if not (np.isfinite(friction) and friction > 0.0):
        raise InvalidInputError(f"friction is {friction}; antipodal grasps need a number above 0")
    if not (0.0 <= opening[0] < opening[1] < np.inf):
        raise InvalidInputError(
            f"opening is {tuple(opening)}; give the smallest and largest finger distance [m]"
        )
    if approaches < 1:
        raise InvalidInputError(f"approaches is {approaches}; give 1 or more per contact pair")
