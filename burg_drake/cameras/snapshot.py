"""Snapshots of a live view: a folder with the image, the overlay, the depth and a document.

The image is stored without loss so that it can be analysed again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from burg_drake.cameras.image_files import read_image, write_image
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.placement.document import CheckedScene, PlacementCheck, camera_versions
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.core import (
    Array,
    Bytes,
    DocumentError,
    InvalidInputError,
    Pose,
    atomic_folder,
    load_document,
    open_npy,
    require_writable,
    save_document,
)

if TYPE_CHECKING:
    from burg_drake.scene import Scene


T = TypeVar("T")
IMAGE_FILE = "image.png"
OVERLAY_FILE = "overlay.png"
DEPTH_FILE = "depth.npy"
DOCUMENT_FILE = "snapshot.yaml"


@dataclass(frozen=True, kw_only=True)
class SeenBoard:
    """Where the board was seen.

    Attributes:
        X_SC: pose of the camera's optical frame in the scene frame; left out if it was not found.
        reason: why there is no pose, or what is doubtful; empty if all is well.
        reprojection_error: root mean square reprojection error of the markers' corners [pixels].
        covariance: covariance of the camera's pose, six rows: rotation [rad], then position [m], in
            the scene frame; empty if unknown.
        markers: ids of the markers that were used.
        scale: size of the printed board divided by that in the scene file, if it was measured.
    """

    X_SC: Pose | None = None
    reason: str = ""
    reprojection_error: float | None = None
    covariance: tuple[tuple[float, ...], ...] = ()
    markers: tuple[int, ...] = ()
    scale: float | None = None


@dataclass(frozen=True, kw_only=True)
class SnapshotDocument:
    """A snapshot of the live overlay (`snapshot.yaml`).

    Attributes:
        scene: the scene that was overlaid.
        library: object library of the scene.
        source: camera or file that gave the picture.
        taken: date and time of the snapshot, ISO 8601 with time zone.
        time: time of the picture since the source was opened [s].
        intrinsics: intrinsics of the camera.
        board: where the board was seen in this picture.
        X_SC_drawn: camera pose that the overlay was drawn with, if it is the mean of several
            pictures.
        placement: where the objects stand, if that was measured.
        versions: versions of the software.
    """

    version: int = 1
    scene: CheckedScene
    library: str
    source: str
    taken: str = ""
    time: float = 0.0
    intrinsics: Intrinsics
    board: SeenBoard = SeenBoard()
    X_SC_drawn: Pose | None = None
    placement: PlacementCheck | None = None
    versions: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshot:
    """A picture with its overlay and document.

    Attributes:
        document: pose and origin of the picture.
        image: (H, W, 3) uint8 RGB as the camera gave it.
        overlay: (H, W, 3) uint8 RGB.
        depth: (H, W) float32 distances along the optical axis [m], from cameras that have them.
    """

    document: SnapshotDocument
    image: Bytes
    overlay: Bytes
    depth: Array | None = None


def describe_board(estimate: BoardEstimate) -> SeenBoard:
    """Converts an estimate to a document; unknown numbers are left out."""
    known = bool(np.isfinite(estimate.covariance).all())
    return SeenBoard(
        X_SC=Pose.from_matrix(estimate.X_SC, quaternion=True) if estimate.valid else None,
        reason=estimate.reason,
        reprojection_error=_finite_or_none(estimate.reprojection_error),
        covariance=tuple(map(tuple, estimate.covariance.tolist())) if known else (),
        markers=tuple(int(id) for id in estimate.ids),
        scale=_finite_or_none(estimate.scale),
    )


def describe_scene(scene: Scene) -> CheckedScene:
    """Entry of a document about its scene."""
    return CheckedScene(name=scene.name, path=str(scene.path), content=scene.content)


def save_snapshot(snapshot: Snapshot, folder: str | Path) -> None:
    """Writes a new folder atomically.

    Raises:
        InvalidInputError: the folder exists, or cannot be written.
    """
    with atomic_folder(require_new_folder(folder)) as fresh:
        write_image(fresh / IMAGE_FILE, snapshot.image)
        write_image(fresh / OVERLAY_FILE, snapshot.overlay)
        if snapshot.depth is not None:
            np.save(fresh / DEPTH_FILE, snapshot.depth.astype(np.float32))
        save_document(snapshot.document, fresh / DOCUMENT_FILE)
        save_document(snapshot.document.intrinsics, fresh / "intrinsics.yaml")


def require_new_folder(folder: str | Path) -> Path:
    """Checks that a snapshot can be saved to a folder.

    Raises:
        InvalidInputError: something of that name exists, or nothing can be written there.
    """
    folder = Path(folder)
    if folder.exists():
        raise InvalidInputError(f"{folder} exists already; choose another name for the snapshot")
    require_writable(folder)
    return folder


def load_snapshot(folder: str | Path) -> Snapshot:
    """Reads a snapshot that `save_snapshot` wrote.

    Raises:
        DocumentError: no snapshot there, or it does not fit the schema.
        InvalidInputError: a picture or the depth is missing, damaged, or of another size than the
            intrinsics.
    """
    folder = Path(folder)
    if not (folder / DOCUMENT_FILE).is_file():
        raise DocumentError(f"{folder} is not the folder of a snapshot: {DOCUMENT_FILE} is missing")
    document = load_document(folder / DOCUMENT_FILE, SnapshotDocument)
    image, overlay = (_read(read_image, folder / name) for name in (IMAGE_FILE, OVERLAY_FILE))
    height, width = image.shape[:2]
    document.intrinsics.require_size(width, height, str(folder / IMAGE_FILE))
    depth = None
    if (folder / DEPTH_FILE).exists():
        depth = _read(lambda path: _read_depth(path, (height, width)), folder / DEPTH_FILE)
    return Snapshot(document=document, image=image, overlay=overlay, depth=depth)


def next_free_path(
    folder: str | Path,
    prefix: str,
    suffix: str = "",
    *,
    taken: Callable[[Path], bool] = Path.exists,
) -> Path:
    """The first unused path of `prefix_001`, `prefix_002`, ... in a folder."""
    number = 1
    while taken(path := Path(folder) / f"{prefix}_{number:03d}{suffix}"):
        number += 1
    return path


def describe_snapshot(
    scene: Scene,
    intrinsics: Intrinsics,
    estimate: BoardEstimate,
    *,
    source: str,
    taken: str,
    time: float,
    X_SC_drawn: Array | None = None,
    placement: PlacementCheck | None = None,
) -> SnapshotDocument:
    """Builds the document of a snapshot."""
    if X_SC_drawn is None or not estimate.valid or np.array_equal(X_SC_drawn, estimate.X_SC):
        drawn = None
    else:
        drawn = Pose.from_matrix(X_SC_drawn, quaternion=True)
    return SnapshotDocument(
        scene=describe_scene(scene),
        library=scene.library.name,
        source=source,
        taken=taken,
        time=time,
        intrinsics=intrinsics,
        board=describe_board(estimate),
        X_SC_drawn=drawn,
        placement=placement,
        versions=camera_versions(),
    )


def _finite_or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _read(read: Callable[[Path], T], path: Path) -> T:
    """Reads a file of a snapshot; errors for missing or damaged files say what to do."""
    try:
        return read(path)
    except InvalidInputError as error:
        raise InvalidInputError(f"{error}; take the snapshot again") from error


def _read_depth(path: Path, shape: tuple[int, int]) -> Array:
    with open_npy(path) as stored:
        return stored.read("f", shape)
