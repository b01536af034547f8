"""The document of a placement check: how far each object of a real scene stands from its target.

Saved beside a real trial, so that it can be compared with one that was simulated later. Numbers
that are not known are None, and left out of the file.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import BurgError, software_versions
from burg_drake.core.documents import Pose, load_document, save_document
from burg_drake.core.files import IMAGE_SIZE, read_bytes
from burg_drake.core.paths import resolve

PlacementStatus = Literal["measured", "uncertain", "not_seen"]
Method = Literal["silhouette", "depth"]

PACKAGES = {"opencv": "opencv-python-headless", "numpy": "numpy", "scipy": "scipy"}
"""As they are called in files, and installed."""


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
    """Reads a placement file; see `core.documents.schema.load_document`."""
    return load_document(path, PlacementCheck)


def save_placement(check: PlacementCheck, path: str | Path) -> None:
    """Writes a placement file; see `core.documents.schema.save_document`.

    The scene's path in it starts at the file's folder, so that both can move together.
    """
    scene = check.scene
    if scene.path and Path(scene.path).is_absolute():
        scene = replace(scene, path=_reference(Path(scene.path), Path(path).absolute().parent))
    check = replace(check, scene=scene)
    save_document(check, path, "Placement check: lengths in m, angles in rad, frame S of the board")


def _reference(path: Path, folder: Path) -> str:
    """What a file in a folder calls a scene: a bare name for those that come along, else a path."""
    try:
        if resolve(path.stem, "scenes").samefile(path):
            return path.stem
    except (BurgError, OSError):
        pass
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


def image_of_file(path: str | Path) -> CheckedImage:
    """The entry of an image file.

    Raises:
        InvalidInputError: it cannot be read.
    """
    path = Path(path)
    data = read_bytes(path, IMAGE_SIZE)
    return CheckedImage(file=path.name, content=hashlib.sha256(data).hexdigest())


def camera_versions() -> dict[str, str]:
    """Versions of what decides about a placement check."""
    return software_versions(PACKAGES, with_platform=False)
