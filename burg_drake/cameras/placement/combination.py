"""Placement checks of several photos of one scene as one: what a photo hides another one shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from burg_drake.cameras.placement.document import ExtraObject, Placement, PlacementCheck
from burg_drake.core import Array, InvalidInputError, make_pose, rot_z
from burg_drake.core.documents import Pose

APART = 4.0
"""Standard deviations from the mean of all photos beyond which one of them contradicts."""
IN_SIGHT = 0.5
"""Share of an object that a photo would show for its absence to count."""
SAME = 0.05
"""Extra objects nearer to each other than this are one [m]."""


def combine_checks(checks: Sequence[PlacementCheck]) -> PlacementCheck:
    """One check of several, of photos that show the same objects on the same places.

    An object is where the photos that measured it say, weighted by their variances per coordinate;
    if these contradict each other, or one shows that it is not there, it is `uncertain`. One that
    no photo measured is as the photo says that knows most. Extra objects are those that half of the
    photos show. The camera, and the first image, are those of the first check.

    Args:
        checks: at least one.

    Raises:
        InvalidInputError: none, or of different scenes or methods.
    """
    if not checks:
        raise InvalidInputError("no placement checks are given to combine; give at least one")
    first, *others = checks
    if any((c.scene.content, c.method) != (first.scene.content, first.method) for c in others):
        raise InvalidInputError(
            "placement checks of different scenes or methods cannot be combined"
        )
    return replace(
        first,
        more_images=tuple(c.image for c in others),
        reason="" if any(not c.reason for c in checks) else first.reason,
        instances={
            name: _combined([c.instances[name] for c in checks]) for name in first.instances
        },
        extra=_merged([extra for c in checks for extra in c.extra], len(checks)),
    )


def _combined(placements: list[Placement]) -> Placement:
    found = _mean(placements)
    gone = [p for p in placements if p.status == "not_seen" and p.seen >= IN_SIGHT]
    if found.status != "measured" or not gone:
        return found
    shown = f"{len(gone)} of {len(placements)} photos show"
    return replace(
        found, status="uncertain", reason=f"{shown} that it is not there: {gone[0].reason}"
    )


def _mean(placements: list[Placement]) -> Placement:
    measured = [p for p in placements if p.status == "measured"]
    if len(measured) < 2:
        return max(placements, key=_worth)
    values = np.array([_numbers(p)[0] for p in measured])
    values[:, 2] = values[0, 2] + (values[:, 2] - values[0, 2] + np.pi) % (2.0 * np.pi) - np.pi
    sd = np.array([_numbers(p)[1] for p in measured])
    weight = sd**-2.0
    mean = (weight * values).sum(axis=0) / weight.sum(axis=0)
    mean_sd = weight.sum(axis=0) ** -0.5
    off = np.abs(values - mean)
    contradicts = bool((off > APART * np.sqrt(np.maximum(sd**2 - mean_sd**2, 1e-18))).any())
    if contradicts:
        mean_sd = np.maximum(mean_sd, off.max(axis=0))
    best = max(measured, key=_worth)
    turned = best.angle is not None
    reason = f"the photos disagree by {1e3 * off[:, :2].max():.1f} mm" if contradicts else ""
    if contradicts and turned:
        reason += f" and {np.rad2deg(off[:, 2].max()):.1f} deg"
    angle = float((mean[2] + np.pi) % (2.0 * np.pi) - np.pi)
    return replace(
        best,
        status="uncertain" if contradicts else "measured",
        reason=reason,
        measured=_placed(best, mean),
        displacement=(float(mean[0]), float(mean[1])),
        displacement_sd=(float(mean_sd[0]), float(mean_sd[1])),
        angle=angle if turned else None,
        angle_sd=float(mean_sd[2]) if turned else None,
        seen=max(p.seen for p in measured),
    )


def _worth(placement: Placement) -> tuple[int, float]:
    """How much a placement tells: its status, then how exact it is, or how much was seen."""
    rank = {"measured": 2, "uncertain": 1, "not_seen": 0}[placement.status]
    if placement.displacement_sd is None:
        return rank, placement.seen
    return rank, -max(placement.displacement_sd)


def _numbers(placement: Placement) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """x, y [m] and angle [rad], and their standard deviations; angle 0 ± 1 where there is none."""
    assert placement.displacement is not None
    assert placement.displacement_sd is not None
    angle, sd = placement.angle, placement.angle_sd
    return (
        (*placement.displacement, angle or 0.0),
        (*placement.displacement_sd, 1.0 if sd is None else sd),
    )


def _placed(placement: Placement, q: Array) -> Pose:
    """X_SO with the reference point displaced, and the object turned about the vertical."""
    target = placement.target.matrix()
    R = rot_z(float(q[2]) if placement.angle is not None else 0.0) @ target[:3, :3]
    p_OR = np.array(placement.reference)
    p_SR = target[:3, :3] @ p_OR + target[:3, 3] + (q[0], q[1], 0.0)
    return Pose.from_matrix(make_pose(R, p_SR - R @ p_OR), quaternion=True)


def _merged(extra: list[ExtraObject], photos: int) -> tuple[ExtraObject, ...]:
    """Extra objects that half of the photos show, each once."""
    groups: list[list[ExtraObject]] = []
    for one in extra:
        near = (g for g in groups if np.hypot(*np.subtract(one.position, g[0].position)) < SAME)
        group = next(near, None)
        if group is None:
            groups.append([one])
        else:
            group.append(one)
    return tuple(_middle(group) for group in groups if 2 * len(group) >= photos)


def _middle(group: list[ExtraObject]) -> ExtraObject:
    x, y = np.mean([e.position for e in group], axis=0)
    position = round(float(x), 4), round(float(y), 4)
    return ExtraObject(position=position, width=max(e.width for e in group))
