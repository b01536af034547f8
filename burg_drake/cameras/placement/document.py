"""The document of a placement check, and checks of several photos combined into one."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.core import (
    Array,
    BurgError,
    FileLimits,
    InvalidInputError,
    Pose,
    load_document,
    make_pose,
    read_bytes,
    resolve_reference,
    rot_z,
    save_document,
    software_versions,
    wrap_to_pi,
)

PlacementStatus = Literal["measured", "uncertain", "not_seen"]
Method = Literal["silhouette", "depth"]

PLACEMENT_PACKAGES = {"opencv": "opencv-python-headless", "numpy": "numpy", "scipy": "scipy"}
"""Packages that affect a placement check: name in the document and on PyPI."""


@dataclass(frozen=True, kw_only=True)
class CheckedScene:
    """The scene that was compared or overlaid.

    Attributes:
        name: name of the scene.
        path: file of the scene, relative to this file, or the name of a built-in one.
        content: hash of placement and objects.
    """

    name: str
    path: str = ""
    content: str


@dataclass(frozen=True, kw_only=True)
class CheckedImage:
    """An image that was used.

    Attributes:
        file: name of the image file; empty for an image from memory.
        content: SHA-256 of the file, or of the pixels of an image from memory.
    """

    file: str = ""
    content: str


@dataclass(frozen=True, kw_only=True)
class CameraPlace:
    """Where the camera was.

    Attributes:
        X_SC: pose of the optical frame in the scene frame.
        reprojection_error: root mean square reprojection error of the markers' corners [pixels];
            left out if it was not measured.
        covariance: covariance of the camera's pose, 6 x 6 row by row: rotation [rad], then position
            [m], in the scene frame; empty if unknown.
        markers: number of markers that were used.
    """

    X_SC: Pose
    reprojection_error: float | None = None
    covariance: tuple[float, ...] = ()
    markers: int = 0


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where one object is, compared with where it should be.

    The displacement is that of a reference point on the object: the middle of its outline from
    above, or its axis of symmetry.

    Attributes:
        object: name of the object in the library.
        status: whether the object was `measured`, measured with doubt (`uncertain`), or `not_seen`.
        reason: what is doubtful, in one line; empty if measured.
        target: planned pose of the object in the scene frame.
        measured: measured pose of the object in the scene frame.
        reference: reference point in the object's frame [m].
        displacement: x and y of the measured minus the planned reference point, in the scene frame
            [m].
        displacement_sd: standard deviations of `displacement` [m].
        angle: measured minus planned turn about the vertical [rad], -pi to pi; left out if the
            object's symmetry hides it.
        angle_sd: standard deviation of `angle` [rad].
        seen: share of the object that is in view and not hidden by others, 0 to 1.
        residual: root mean square residual of the fit: between outline and image [pixels], or
            between surface and depth [m].
    """

    object: str
    status: PlacementStatus
    reason: str = ""
    target: Pose
    measured: Pose | None = None
    reference: tuple[float, float, float] | None = None
    displacement: tuple[float, float] | None = None
    displacement_sd: tuple[float, float] | None = None
    angle: float | None = None
    angle_sd: float | None = None
    seen: float = 0.0
    residual: float | None = None


@dataclass(frozen=True, kw_only=True)
class ExtraObject:
    """A thing on the board that is not in the scene.

    Attributes:
        position: x and y of its middle in the scene frame, roughly [m].
        width: width across the view [m].
    """

    position: tuple[float, float]
    width: float


@dataclass(frozen=True, kw_only=True)
class PlacementCheck:
    """A placement check: where the objects of a real scene stand, compared with the scene file.

    Attributes:
        scene: the scene with the planned poses.
        taken: date and time of the check, ISO 8601 with time zone.
        method: how it was measured: `silhouette` from colour, `depth` from distances.
        image: the photo.
        more_images: further photos of the same scene, if several were combined.
        depth: the depth image, if one was used.
        intrinsics: intrinsics of the camera.
        camera: where the camera was; left out if the board was not found.
        reason: why nothing was measured; empty otherwise.
        instances: the objects by instance, in the scene's order, with those of the background.
        extra: things on the board that are not in the scene, the largest first.
        versions: versions of the software.
    """

    version: int = 1
    scene: CheckedScene
    taken: str = ""
    method: Method
    image: CheckedImage
    more_images: tuple[CheckedImage, ...] = ()
    depth: CheckedImage | None = None
    intrinsics: Intrinsics
    camera: CameraPlace | None = None
    reason: str = ""
    instances: dict[str, Placement] = field(default_factory=dict)
    extra: tuple[ExtraObject, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)


def load_placement(path: str | Path) -> PlacementCheck:
    """Reads a placement file; see `load_document`."""
    return load_document(path, PlacementCheck)


def save_placement(check: PlacementCheck, path: str | Path) -> None:
    """Writes a placement file; see `save_document`.

    The scene's path in it starts at the file's folder, so that both can move together.
    """
    scene = check.scene
    if scene.path and Path(scene.path).is_absolute():
        reference = _scene_reference(Path(scene.path), Path(path).absolute().parent)
        scene = replace(scene, path=reference)
    check = replace(check, scene=scene)
    save_document(check, path, "Placement check: lengths in m, angles in rad, frame S of the board")


def _scene_reference(path: Path, folder: Path) -> str:
    """Reference to a scene from a file in a folder: the name of a built-in scene, else a path."""
    try:
        if resolve_reference(path.stem, "scenes").samefile(path):
            return path.stem
    except (BurgError, OSError):
        pass
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


def describe_image_file(path: str | Path) -> CheckedImage:
    """The entry of an image file.

    Raises:
        InvalidInputError: it cannot be read.
    """
    path = Path(path)
    data = read_bytes(path, FileLimits.image_bytes)
    return CheckedImage(file=path.name, content=hashlib.sha256(data).hexdigest())


def camera_versions() -> dict[str, str]:
    """Versions of the packages that affect a placement check."""
    return software_versions(PLACEMENT_PACKAGES, with_platform=False)


def combine_checks(checks: Sequence[PlacementCheck]) -> PlacementCheck:
    """Combines checks of several photos of the same objects at the same places.

    An object's displacement is the mean over the photos that measured it, weighted by variance per
    coordinate. It is `uncertain` if photos contradict each other or one shows the object's absence.
    For an object that no photo measured, the most informative photo counts. Extra objects are those
    that half of the photos show. Camera and first image are those of the first check.

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
            name: _combine_placements([c.instances[name] for c in checks])
            for name in first.instances
        },
        extra=_merge_extra_objects([extra for c in checks for extra in c.extra], len(checks)),
    )


def _combine_placements(placements: list[Placement]) -> Placement:
    found = _mean_placement(placements)
    # Visible fraction for which an object's absence counts.
    absent = [p for p in placements if p.status == "not_seen" and p.seen >= 0.5]
    if found.status != "measured" or not absent:
        return found
    shown = f"{len(absent)} of {len(placements)} photos show"
    return replace(
        found, status="uncertain", reason=f"{shown} that it is not there: {absent[0].reason}"
    )


def _mean_placement(placements: list[Placement]) -> Placement:
    measured = [p for p in placements if p.status == "measured"]
    if len(measured) < 2:
        return max(placements, key=_information_rank)
    values = np.array([_displacement_and_sd(p)[0] for p in measured])
    values[:, 2] = values[0, 2] + (values[:, 2] - values[0, 2] + np.pi) % (2.0 * np.pi) - np.pi
    sd = np.array([_displacement_and_sd(p)[1] for p in measured])
    weight = sd**-2.0
    mean = (weight * values).sum(axis=0) / weight.sum(axis=0)
    mean_sd = weight.sum(axis=0) ** -0.5
    deviation = np.abs(values - mean)
    # A photo farther from the mean of all contradicts it.
    contradicts = bool((deviation > 4.0 * np.sqrt(np.maximum(sd**2 - mean_sd**2, 1e-18))).any())
    if contradicts:
        mean_sd = np.maximum(mean_sd, deviation.max(axis=0))
    best = max(measured, key=_information_rank)
    turned = best.angle is not None
    reason = f"the photos disagree by {1e3 * deviation[:, :2].max():.1f} mm" if contradicts else ""
    if contradicts and turned:
        reason += f" and {np.rad2deg(deviation[:, 2].max()):.1f} deg"
    angle = float(wrap_to_pi(mean[2]))
    return replace(
        best,
        status="uncertain" if contradicts else "measured",
        reason=reason,
        measured=_displaced_pose(best, mean),
        displacement=(float(mean[0]), float(mean[1])),
        displacement_sd=(float(mean_sd[0]), float(mean_sd[1])),
        angle=angle if turned else None,
        angle_sd=float(mean_sd[2]) if turned else None,
        seen=max(p.seen for p in measured),
    )


def _information_rank(placement: Placement) -> tuple[int, float]:
    """Rank of a placement's information: its status, then its accuracy, or visible share."""
    rank = {"measured": 2, "uncertain": 1, "not_seen": 0}[placement.status]
    if placement.displacement_sd is None:
        return rank, placement.seen
    return rank, -max(placement.displacement_sd)


def _displacement_and_sd(placement: Placement) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """x, y [m] and angle [rad], and their standard deviations; angle 0 ± 1 if there is none."""
    assert placement.displacement is not None
    assert placement.displacement_sd is not None
    sd = 1.0 if placement.angle_sd is None else placement.angle_sd
    return (*placement.displacement, placement.angle or 0.0), (*placement.displacement_sd, sd)


def _displaced_pose(placement: Placement, q: Array) -> Pose:
    """X_SO with the reference point displaced, and the object turned about the vertical."""
    target = placement.target.matrix()
    R = rot_z(float(q[2]) if placement.angle is not None else 0.0) @ target[:3, :3]
    p_OR = np.array(placement.reference)
    p_SR = target[:3, :3] @ p_OR + target[:3, 3] + (q[0], q[1], 0.0)
    return Pose.from_matrix(make_pose(R, p_SR - R @ p_OR), quaternion=True)


def _merge_extra_objects(extra: list[ExtraObject], photos: int) -> tuple[ExtraObject, ...]:
    """Extra objects that half of the photos show, each once."""
    groups: list[list[ExtraObject]] = []
    for one in extra:
        # Metres within which extra objects are the same.
        near = (g for g in groups if np.hypot(*np.subtract(one.position, g[0].position)) < 0.05)
        group = next(near, None)
        if group is None:
            groups.append([one])
        else:
            group.append(one)
    merged = []
    for group in groups:
        if 2 * len(group) >= photos:
            x, y = np.mean([e.position for e in group], axis=0)
            position = round(float(x), 4), round(float(y), 4)
            merged.append(ExtraObject(position=position, width=max(e.width for e in group)))
    return tuple(merged)
