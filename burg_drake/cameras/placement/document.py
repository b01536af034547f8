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
    """The scene whose targets the objects were compared with.

    Attributes:
        name: its name.
        path: where its document was; in a file, from the file's folder, or the bare name of a scene
            that comes with the package.
        content: hash of placement and objects, `Scene.content`.
    """

    name: str
    path: str = ""
    content: str


@dataclass(frozen=True, kw_only=True)
class CheckedImage:
    """An image that went into the check.

    Attributes:
        file: its name; empty for one in memory.
        content: SHA-256 of the file's bytes; of the pixels for an image in memory.
    """

    file: str = ""
    content: str


@dataclass(frozen=True, kw_only=True)
class CameraPlace:
    """Where the camera was.

    Attributes:
        X_SC: optical frame in the scene frame.
        reprojection_error: of the markers' corners [pixels]; None where it was not measured.
        covariance: 36 entries, row by row, as in `BoardEstimate.covariance`; empty if unknown.
        markers: number of markers used.
    """

    X_SC: Pose
    reprojection_error: float | None = None
    covariance: tuple[float, ...] = ()
    markers: int = 0


@dataclass(frozen=True, kw_only=True)
class Placement:
    """One object: where it is, against where it should be.

    The displacement is that of the reference point, a point of the object: the middle of its
    outline seen from above, or the axis of an object that looks the same however it is turned about
    the vertical. The mesh's origin may lie far away from the object, and would then move by its
    turn.

    Attributes:
        object: name in the library.
        status: `measured`; `uncertain` (numbers are given where there are any, `reason` says what
            is doubtful); `not_seen` (hidden, out of view, or not there; without numbers).
        reason: one line; empty if measured.
        target: X_SO of the scene document.
        measured: X_SO as it stands; about the vertical the target's own turn where `angle` is None.
        reference: p_OR, the reference point in the object frame [m].
        displacement: x and y of the reference point in S, measured less target [m].
        displacement_sd: standard deviations of both [m], the camera's error included.
        angle: turn about the z axis of S from target to measured [rad], in (-pi, pi]; None where
            the object's symmetry hides it.
        angle_sd: its standard deviation [rad].
        seen: share of the object's silhouette (by colour) or visible surface (by depth) that is in
            view and not hidden by other objects, in [0, 1].
        residual: root mean square of what the fit left: pixels between outline and image, or metres
            between surface and depth.
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
    """Something that stands on the board and is no object of the scene.

    Attributes:
        position: x and y in S of about the middle of where it stands [m].
        width: how wide it looks, across the view [m].
    """

    position: tuple[float, float]
    width: float


@dataclass(frozen=True, kw_only=True)
class PlacementCheck:
    """Schema of a placement file.

    Attributes:
        scene: whose targets.
        taken: date and time of the check, ISO 8601 with time zone.
        method: `silhouette` from colour, `depth` from distances.
        image: the photo.
        more_images: further photos of the same, if several were combined.
        depth: the depth image, where one was used.
        intrinsics: of the camera.
        camera: where it was; None if no board was found, and then nothing was measured.
        reason: why nothing was measured; empty otherwise.
        instances: by name, in the scene's order, those of the background as well.
        extra: what stands on the board and is no object of the scene, the largest first.
        versions: of the software.
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
