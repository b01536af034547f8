"""How an object comes to rest on a horizontal plane, and how often.

Quasi-static: the minima of the landscape (see `objects.physics.landscape`) are the stable poses.
Two minima are one pose

- when a tilt of a few degrees leads from one to the other (facets of a rolling surface, dents of a
  scan), and
- when a turn of the object onto itself takes one to the other (the ends of a plain cylinder).
"""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.core import Array, make_pose
from burg_drake.core.documents import Pose
from burg_drake.objects.library import StablePose
from burg_drake.objects.physics.landscape import TILT_MARGIN, PotentialLandscape, RestingFacet
from burg_drake.objects.physics.symmetry import Symmetries, SymmetrySearch

MIN_PROBABILITY = 0.01
"""Rarer poses are left out, and the others scaled to a sum of one."""


def stable_poses(
    surface: trimesh.Trimesh,
    support: Array,
    p_OOcm: Array,
    search: SymmetrySearch | None = None,
) -> tuple[StablePose, ...]:
    """Resting poses, most probable first.

    Args:
        surface: in O [m]; tells which poses are the same by symmetry.
        support: (N, 3) points of O whose hull rests on the plane [m].
        p_OOcm: (3,) centre of mass [m].
        search: of the surface about `p_OOcm`, where others need it as well; made if None.

    Returns:
        At least one pose; probabilities sum to one.
    """
    landscape = PotentialLandscape(support, p_OOcm)
    classes = _merge_symmetric(landscape, search or SymmetrySearch(surface, p_OOcm))
    most = max(c.probability for c in classes)
    kept = [c for c in classes if c.probability >= min(MIN_PROBABILITY, most)]
    total = sum(c.probability for c in kept)
    kept.sort(key=RestingFacet.rank)
    return tuple(
        StablePose(
            probability=round(c.probability / total, 6),
            X_SO=Pose.from_matrix(resting_pose(c.down, c.height, p_OOcm), quaternion=True),
            rolls=landscape.rolls(c.down),
        )
        for c in kept
    )


def resting_pose(down: Array, height: float, p_OOcm: Array) -> Array:
    """`X_SO` (4, 4) with `down` (3,) of O pointing down by the shortest turn, and the centre of
    mass `height` [m] above the origin of S."""
    R_SO = _shortest_rotation(down, np.array([0.0, 0.0, -1.0]))
    return make_pose(R_SO, np.array([0.0, 0.0, height]) - R_SO @ p_OOcm)


def _merge_symmetric(landscape: PotentialLandscape, search: SymmetrySearch) -> list[RestingFacet]:
    facets = landscape.minima()
    heights = np.sort([facet.height for facet in facets])
    if not (np.diff(heights) <= search.tolerance).any():
        return facets
    symmetries = search.find()
    classes: list[list[RestingFacet]] = []
    for facet in facets:
        alike = [
            c
            for c in classes
            if any(
                abs(facet.height - known.height) <= search.tolerance
                and same_minimum(landscape, symmetries, facet.down, known.down)
                for known in c
            )
        ]
        classes = [c for c in classes if not any(c is a for a in alike)]
        classes.append(
            sorted([*(known for c in alike for known in c), facet], key=RestingFacet.rank)
        )
    return [RestingFacet(sum(f.probability for f in c), c[0].down, c[0].height) for c in classes]


def same_minimum(landscape: PotentialLandscape, symmetries: Symmetries, a: Array, b: Array) -> bool:
    """Whether a symmetry takes direction a (3,) to the minimum b (3,) of the landscape.

    Several facets can belong to one minimum, of which b is one.
    """
    return any(
        float(landscape.basin(image) @ b) > np.cos(TILT_MARGIN) for image in symmetries.images(a, b)
    )


def _shortest_rotation(a: Array, b: Array) -> Array:
    """(3, 3) rotation that takes unit vector a to unit vector b by the shortest turn (about x where
    they are opposite)."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + c)
