"""Whether an object that was aligned could as well be turned: by a mug whose handle is hidden, an
alignment sees nothing of its angle, and yet ends at some.

The object is turned through the full circle; each time it is shifted to where it fits best, and
what then disagrees with the image is counted. Turns that take the object onto itself do not count.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from burg_drake.cameras.placement.alignment import (
    Aligner,
    Alignment,
    PinholeView,
    TargetShape,
    Window,
)
from burg_drake.cameras.placement.search import SilhouetteSearch
from burg_drake.core import Array

HALF = np.deg2rad((8.0, 15.0, 25.0, 40.0, 60.0, 85.0, 110.0, 135.0, 160.0))
TURNS = np.concatenate([np.stack([HALF, -HALF], axis=1).ravel(), [np.pi]])
"""By which an object is turned from where it was found [rad]; less is up to the alignment's own
standard deviation."""
REACH = 0.025
"""How far it is shifted meanwhile [m]."""
RAYS = 2500
"""About how many pixels around the object are compared."""
SHARE, PIXELS = 0.01, 12.0
"""By how much the image may disagree more and fit as well: a share of the silhouette, and pixels of
an image 640 wide, as those along an outline are not certain."""
ROUGHLY = 2.0
"""By how many times that it may before its exact place is known."""
MISSING = 0.1
"""Share of the outline that must fit less to tell two angles apart."""
ROUGHER = 0.5
"""By what share of itself the root mean square of the rest must be larger to tell them apart."""


def with_rotation_ambiguity(
    aligner: Aligner, shape: TargetShape, found: Alignment, others: Array
) -> Alignment:
    """The alignment, told in how many other angles the object fits as well.

    Args:
        aligner: of the image.
        shape: the object.
        found: its alignment.
        others: (H, W) depth of other objects, infinity where there is none.
    """
    if shape.symmetric:
        return found
    window = _around(aligner.view, shape, found.q)
    least, area = aligner.misfit(shape, found.q, others, window)
    slack = SHARE * area + PIXELS * (aligner.view.size[0] / 640) ** 2 * window.scale**2
    search = SilhouetteSearch(
        aligner.view, shape, np.where(np.isfinite(others), 0.0, aligner.evidence)
    )
    fitting = []
    for turn in TURNS:
        q = search.shifted(found.q + np.array([0.0, 0.0, turn]), REACH)
        more = aligner.misfit(shape, q, others, window)[0] - least
        if more > ROUGHLY * slack:
            continue
        exact = aligner.align(shape, q, others, far=False, turn=False)
        if exact is None:
            continue
        more = aligner.misfit(shape, exact.q, others, window)[0] - least
        worse = max(more, 0.0) / slack + _worse(found, exact, aligner.residual_floor)
        if worse < 1.0 and not shape.looks_alike(found.q, exact.q):
            fitting.append(exact.q - found.q)
    if not fitting:
        return found
    off = np.array(fitting)
    spread = off.T @ off / (len(off) + 1)
    return replace(found, covariance=found.covariance + spread, turnable=tuple(off[:, 2]))


def _worse(found: Alignment, other: Alignment, fine: float) -> float:
    """By how much another alignment fits the image worse; 1 where that is no chance any more."""
    missing = max(found.coverage - other.coverage, found.agreement - other.agreement, 0.0)
    rougher = other.residual / max(found.residual, fine) - 1.0
    return missing / MISSING + max(rougher, 0.0) / ROUGHER


def _around(view: PinholeView, shape: TargetShape, q: Array) -> Window:
    """A raster of all that the object may cover while it is turned."""
    reach = float(np.linalg.norm(shape.p_SV[:, :2] - shape.p_SR[:2], axis=1).max()) + REACH / 2
    top = float(shape.p_SV[:, 2].max())
    corner = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
    box = shape.p_SR + (q[0], q[1], 0.0) + corner * (reach, reach, top)
    _, pixels = view.project(box)
    window = view.window_of(pixels, 1.0)
    pitch = max(1.0, float(np.sqrt(window.width * window.height / RAYS)))
    return replace(window, scale=1.0 / pitch)
