"""Confirms the resting poses of an object: dropped on a table with small tilts, it comes to rest
near the pose, or the pose is not kept.

The quasi-static poses (see `objects.physics.stability`) know neither momentum nor what of the
object touches in simulation. Each is dropped from just above the table, tilted to several sides;
the first tilt is to the side on which it topples most easily. All drops use one compiled diagram
with one instance of the object, one after the other through the Context: a drop can neither touch
another object nor wait for it, and the result of each is that of the drop alone.

The figures of the world in which objects are dropped are constants, and so are the object's density
and friction there: whether it stands does not depend on its mass, and a new mass or friction
coefficient needs no new confirmation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, BurgError
from burg_drake.objects.collision import primitive_mesh
from burg_drake.objects.library import ObjectLibrary, StablePose
from burg_drake.objects.physics import PoseClasses, PotentialLandscape, SymmetrySearch
from burg_drake.simulation.settling.drop_test import DropTest

TILTS = 4
"""Number of drops of each pose, tilted to sides that are evenly spread."""

RESUMED = 2
"""How many times what topples gets more time to come to rest."""

SIDES = 72
"""Sides among which the weakest is looked for."""

RESIDUAL_DIGITS = 4
"""Residuals are rounded to 1e-4 rad."""


@dataclass(frozen=True)
class Confirmation:
    """What came of it.

    Attributes:
        poses: confirmed poses with their residuals, most probable first; probabilities sum to one.
            Without simulation: the poses as they were.
        notes: sentences for the user.
    """

    poses: tuple[StablePose, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Outcome:
    """Where the drops of a pose ended.

    Attributes:
        residual: largest angle from the pose [rad].
        ended: number of the pose that the first drop that toppled ended in; None if it is none of
            the known, or nothing toppled.
        confirmed: nothing toppled.
    """

    residual: float
    ended: int | None
    confirmed: bool


def confirm_poses(
    library: ObjectLibrary, name: str, search: SymmetrySearch | None = None
) -> Confirmation:
    """Drops an object on each of its stable poses, and keeps those that it stays in.

    Args:
        library: the library; its folder holds the object's SDF, pieces and surface mesh.
        name: the object, with its quasi-static poses.
        search: for the symmetries of its surface about its centre of mass, if there is one already;
            else it is made where needed.

    Returns:
        The confirmed poses. The probability of a pose that topples goes to the one it ends in; if
        that is not among the known, the others are scaled to a sum of one. If nothing is confirmed
        the most probable is kept. A failure of the simulator is a note.

    Raises:
        UnknownNameError: no such object.
    """
    poses = library.entry(name).stable_poses
    try:
        return _judge(poses, _outcomes(library, name, search))
    except (BurgError, RuntimeError, SystemExit) as error:  # some of Drake's checks end so
        reason = " ".join(str(error).split())
        return Confirmation(poses, (f"stable poses are not confirmed by simulation: {reason}",))


def _outcomes(library: ObjectLibrary, name: str, search: SymmetrySearch | None) -> list[_Outcome]:
    """Drops the object on all its poses."""
    entry = library.entry(name)
    p_OOcm = np.array(entry.mass_properties.center_of_mass)
    landscape = PotentialLandscape(support_points(library, name), p_OOcm)
    classes = PoseClasses(
        entry.stable_poses,
        landscape,
        lambda: search or SymmetrySearch(library.surface(name), p_OOcm),
    )
    drop = DropTest(library, name, landscape.points + p_OOcm)
    return [_outcome(drop, classes, k) for k in range(len(entry.stable_poses))]


def _outcome(drop: DropTest, classes: PoseClasses, k: int) -> _Outcome:
    X_SO, residual = classes.poses[k].X_SO.matrix(), 0.0
    weakest = weakest_side(classes.landscape, X_SO[:3, :3], drop.tilt)
    for side in weakest + 2.0 * np.pi * np.arange(TILTS) / TILTS:
        dropped = drop.run(X_SO, float(side))
        found = classes.find(dropped.down)
        for _ in range(RESUMED):
            if dropped.at_rest or (found is not None and found[0] == k):
                break
            dropped = drop.resume()
            found = classes.find(dropped.down)
        if found is None or found[0] != k:
            angle = max(residual, classes.angle(k, dropped.down))
            return _Outcome(angle, None if found is None else found[0], False)
        residual = max(residual, found[1])
    return _Outcome(residual, None, True)


def weakest_side(landscape: PotentialLandscape, R_SO: Array, tilt: float) -> float:
    """Azimuth in S towards which a tilt lifts the centre of mass least, or lowers it [rad]."""
    azimuth = 2.0 * np.pi * np.arange(SIDES) / SIDES
    # what points down in O after the tilt is this in the S that is not tilted
    down_S = np.stack(
        [
            np.sin(tilt) * np.cos(azimuth),
            np.sin(tilt) * np.sin(azimuth),
            np.full(SIDES, -np.cos(tilt)),
        ],
        axis=1,
    )
    return float(azimuth[landscape.height(down_S @ R_SO).argmin()])


def support_points(library: ObjectLibrary, name: str) -> Array:
    """Points (N, 3) of O whose hull rests on the table [m]: of the primitive, or of the pieces, or
    else of the surface."""
    entry = library.entry(name)
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    if not entry.pieces:
        return np.asarray(library.surface(name).vertices)
    return np.vstack([library.mesh(piece).vertices for piece in entry.pieces])


def _judge(poses: Sequence[StablePose], outcomes: Sequence[_Outcome]) -> Confirmation:
    """Moves the probabilities of what toppled to where it ended."""
    confirmed = [k for k, outcome in enumerate(outcomes) if outcome.confirmed]
    if not confirmed:
        kept = replace(poses[0], probability=1.0, residual=_rounded(outcomes[0].residual))
        note = (
            "simulation confirms no stable pose; the most probable one is kept, though the object"
            f" tilts by {np.rad2deg(outcomes[0].residual):.0f} degrees from it"
        )
        return Confirmation((kept,), (note,))
    share = {k: 0.0 for k in confirmed}
    lost = 0.0
    for k, pose in enumerate(poses):
        end: int | None = k
        seen: set[int] = set()
        while end is not None and end not in share and end not in seen:
            seen.add(end)
            end = outcomes[end].ended
        if end in share:
            share[end] += pose.probability
        else:
            lost += pose.probability
    total = sum(share.values())
    order = sorted(confirmed, key=lambda k: -share[k])
    found = tuple(
        replace(
            poses[k],
            probability=round(share[k] / total, 6),
            residual=_rounded(outcomes[k].residual),
        )
        for k in order
    )
    notes = (_note([poses[k] for k in range(len(poses)) if k not in share], lost),)
    return Confirmation(found, notes if len(found) < len(poses) else ())


def _note(toppled: Sequence[StablePose], lost: float) -> str:
    share = 100.0 * sum(pose.probability for pose in toppled)
    which = f"a stable pose ({share:.1f} %) topples in simulation and is left out"
    if len(toppled) > 1:
        which = f"{len(toppled)} stable poses ({share:.1f} %) topple in simulation and are left out"
    if lost == 0.0:
        return f"{which}; its probability goes to the poses in which the object ends up"
    return (
        f"{which}; {100.0 * lost:.1f} % are shared by all others, because the object ends up in no"
        " known pose"
    )


def _rounded(residual: float) -> float:
    return round(residual, RESIDUAL_DIGITS)
