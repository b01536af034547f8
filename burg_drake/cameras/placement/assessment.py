"""From what was found of an object to its entry: measured, uncertain or not seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import numpy as np

from burg_drake.cameras.placement.alignment import TargetShape
from burg_drake.cameras.placement.document import Placement, PlacementStatus
from burg_drake.cameras.placement.localization import SUPPORTED, Located
from burg_drake.cameras.placement.search import RANGE
from burg_drake.core import Array
from burg_drake.core.documents import Pose, Vector3
from burg_drake.scene.document import Scene

MIN_ABSENCE_VISIBILITY = 0.2
"""Share of the silhouette that must be seen for a verdict that something is not there."""
MIN_MEASUREMENT_VISIBILITY = 0.4
"""Share that must be seen to be sure of a measurement."""
AGREEMENT = 0.6
"""Share of the outline, or of the points before the board, that must fit."""
MIN_INK_AGREEMENT = 0.85
"""Agreement at which an object as dark as ink, or as bright as paper, may stand on it."""
SUPPORT = 0.45
"""Mean evidence in the silhouette from which on it is filled."""
MAX_SPILL_SHARE = 0.35
"""Share around the silhouette that may be something else: a shadow, a hand, a cable."""
MIN_MEDIAN_LIKENESS, MIN_LIKENESS_RATIO = 0.6, 0.4
"""Likeness that objects have in the middle where their meshes' colors are the real ones, and the
share of it below which one of them is doubtful."""
MAX_ANGLE_SD = np.deg2rad(3.0)
"""Standard deviation of the angle above which an angle is not worth much [rad]."""
MAX_DISPLACEMENT_SD = 0.003
"""The same of the displacement [m]."""


def placement_of(
    scene: Scene,
    name: str,
    shape: TargetShape,
    found: Located,
    camera: Array,
    rough: float,
    typical: float,
) -> Placement:
    """The entry of an object.

    Args:
        scene: the targets.
        name: of the instance.
        shape: of the object.
        found: what was found.
        camera: (6, 6) covariance of the camera's pose, NaN if unknown.
        rough: residual of the alignment from which on it is another object's.
        typical: likeness of the scene's objects in the photo, see `typical_likeness`.
    """
    missing = _missing(found)
    if missing or found.alignment is None:
        return unseen(scene, name, missing, found.seen)
    alignment = found.alignment
    q, spread = alignment.q, alignment.spread(camera)
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0))
    reason = _doubt(shape, found, deviation, rough, typical)
    status: PlacementStatus = "uncertain" if reason else "measured"
    residual = alignment.residual
    angle = float((q[2] + np.pi) % (2.0 * np.pi) - np.pi)
    return Placement(
        object=scene.instance(name).object,
        status=status,
        reason=reason,
        target=scene.instance(name).X_SO,
        measured=Pose.from_matrix(shape.placed(q), quaternion=True),
        reference=cast(Vector3, tuple(np.round(shape.p_OR, 9).tolist())),
        displacement=(float(q[0]), float(q[1])),
        displacement_sd=(float(deviation[0]), float(deviation[1])),
        angle=None if shape.symmetric else angle,
        angle_sd=None if shape.symmetric else float(deviation[2]),
        seen=round(found.seen, 4),
        residual=float(residual) if np.isfinite(residual) else None,
    )


def typical_likeness(located: Iterable[Located]) -> float:
    """Median likeness of the objects that were found; 0 of fewer than three."""
    likeness = [
        f.likeness
        for f in located
        if f.alignment is not None and f.seen > MIN_MEASUREMENT_VISIBILITY
    ]
    return float(np.median(likeness)) if len(likeness) > 2 else 0.0


def unseen(scene: Scene, name: str, reason: str, seen: float = 0.0) -> Placement:
    """The entry of an object of which nothing can be said."""
    instance = scene.instance(name)
    return Placement(
        object=instance.object,
        status="not_seen",
        reason=reason,
        target=instance.X_SO,
        seen=round(seen, 4),
    )


def _missing(found: Located) -> str:
    """Why an object is not seen; empty if it is."""
    if found.in_image < MIN_ABSENCE_VISIBILITY:
        return "it is out of view"
    if found.seen < MIN_ABSENCE_VISIBILITY:
        return "other objects hide it"
    if found.alignment is None or found.support < SUPPORTED:
        return f"nothing like it was found within {1e3 * RANGE:.0f} mm of its target"
    return ""


def _doubt(
    shape: TargetShape, found: Located, deviation: Array, rough: float, typical: float
) -> str:
    """What is doubtful about a measurement; empty if nothing is."""
    alignment = found.alignment
    assert alignment is not None
    if alignment.agreement < AGREEMENT:
        return (
            f"only {100 * alignment.agreement:.0f} % of its outline match the image: is it another"
            " object, or in another pose?"
        )
    if found.support < SUPPORT and alignment.agreement < MIN_INK_AGREEMENT:
        return (
            "the board is visible where the object should cover it: is it another object, or in"
            " another pose?"
        )
    if alignment.residual > rough:
        return (
            "its outline does not quite match the image: is it another object, or in another pose?"
        )
    if (
        shape.colors is not None
        and found.likeness < MIN_LIKENESS_RATIO * typical
        and typical > MIN_MEDIAN_LIKENESS
    ):
        return "it does not have the colors of its mesh: is it another object?"
    if found.spill > MAX_SPILL_SHARE:
        return "something sticks out next to it: is it another object, or in another pose?"
    if alignment.ambiguous:
        return "another pose fits almost as well"
    if alignment.turnable:
        turn = np.rad2deg(max(alignment.turnable, key=abs))
        return f"it fits as well when rotated by another {turn:+.0f} deg"
    if found.seen < MIN_MEASUREMENT_VISIBILITY:
        return f"only {100 * found.seen:.0f} % of it can be seen"
    if deviation[:2].max() > MAX_DISPLACEMENT_SD:
        return f"its position is only known to {1e3 * deviation[:2].max():.1f} mm"
    if not shape.symmetric and deviation[2] > MAX_ANGLE_SD:
        return f"its rotation is only known to {np.rad2deg(deviation[2]):.0f} deg"
    return ""
