"""The placement check: from an image of the finished scene, how far each object stands from its
target. The board is seen, so that the camera's place is known; objects stand as the scene lets
them, and are displaced in the plane of the board and turned about the vertical.
"""

from __future__ import annotations

from datetime import datetime
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics, Undistortion
from burg_drake.cameras.placement.alignment import (
    Aligner,
    DepthAligner,
    PinholeView,
    SilhouetteAligner,
    check_depth,
    empty_board,
    target_shapes,
)
from burg_drake.cameras.placement.assessment import placement_of, typical_likeness, unseen
from burg_drake.cameras.placement.document import (
    CameraPlace,
    CheckedImage,
    CheckedScene,
    ExtraObject,
    Placement,
    PlacementCheck,
    camera_versions,
)
from burg_drake.cameras.placement.exchanged import exchanged_objects
from burg_drake.cameras.placement.extras import extra_objects
from burg_drake.cameras.placement.localization import locate_objects
from burg_drake.cameras.pose import BoardEstimate, BoardPose
from burg_drake.core import InvalidInputError, content_hash
from burg_drake.core.documents import Pose
from burg_drake.printout import height_map
from burg_drake.scene.document import Scene, SceneLike, as_scene

TINTS = 1e-3
"""Side of a pixel of the height map that may be printed on the sheet [m]."""
NO_CONTRAST = "the board's paper and ink look alike in the photo; give it more light"


def check_placement(
    scene: SceneLike,
    image: NDArray[np.uint8],
    intrinsics: Intrinsics,
    *,
    depth: NDArray[np.float32] | None = None,
    estimate: BoardEstimate | None = None,
    scale: tuple[float, float] = (1.0, 1.0),
    image_source: CheckedImage | None = None,
    depth_source: CheckedImage | None = None,
) -> PlacementCheck:
    """Measures how far the objects of a real scene stand from their targets.

    Example::

        camera = burg.cameras.load_intrinsics("K.yaml")
        check = burg.cameras.check_placement("breakfast.yaml", photo, camera)  # (H, W, 3) RGB
        for name, placed in check.instances.items():
            print(name, placed.status, placed.displacement)

    Args:
        scene: the targets.
        image: (H, W, 3) RGB photo of the scene on its board.
        intrinsics: of the camera.
        depth: (H, W) distances along the optical axis [m] of the same camera, 0 or NaN where there
            is none. Objects are then aligned with these, and the photo only serves to find the
            board.
        estimate: where the camera is; from the photo's markers if None.
        scale: size of the printed board against the document along x and y, if it was measured; as
            in `BoardPose`, whose estimate has to be of the same.
        image_source, depth_source: what the document calls the images; their pixels' hash if None.

    Raises:
        InvalidInputError: an image of another size than the intrinsics', or not an image; depth
            that is not in metres; markers that do not fit on the board.
    """
    scene = as_scene(scene)
    scene.require_markers()
    color = _checked_image(image, intrinsics)
    if depth is not None:
        depth = check_depth(depth, intrinsics)
    if estimate is None:
        estimate = BoardPose(scene.board, intrinsics, scale).estimate(color)
    instances, extra, reason = _measured(scene, color, depth, intrinsics, estimate, scale)
    return PlacementCheck(
        scene=_scene(scene),
        taken=datetime.now().astimezone().isoformat(timespec="seconds"),
        method="silhouette" if depth is None else "depth",
        image=image_source or CheckedImage(content=content_hash(color)),
        depth=None if depth is None else depth_source or CheckedImage(content=content_hash(depth)),
        intrinsics=intrinsics,
        camera=_camera(estimate),
        reason=reason,
        instances=instances,
        extra=extra,
        versions=camera_versions(),
    )


def _scene(scene: Scene) -> CheckedScene:
    path = Path(scene.path).absolute()
    return CheckedScene(name=scene.name, path=str(path), content=scene.content)


def _measured(
    scene: Scene,
    color: NDArray[np.uint8],
    depth: NDArray[np.float32] | None,
    intrinsics: Intrinsics,
    estimate: BoardEstimate,
    scale: tuple[float, float],
) -> tuple[dict[str, Placement], tuple[ExtraObject, ...], str]:
    """Placements by name; what else stands there; and why nothing was measured, if so."""
    aligner = _aligner(scene, color, depth, intrinsics, estimate, scale)
    if isinstance(aligner, str):
        names = (*scene.instances, *scene.background)
        return {name: unseen(scene, name, aligner) for name in names}, (), aligner
    shapes = target_shapes(scene)
    located = locate_objects(aligner, shapes)
    typical = typical_likeness(located.values())
    placements = {
        name: placement_of(
            scene, name, shapes[name], found, estimate.covariance, aligner.rough, typical
        )
        for name, found in located.items()
    }
    doubtful = [name for name, placed in placements.items() if placed.status != "measured"]
    stands, empty = exchanged_objects(aligner, shapes, located, doubtful)
    elsewhere = {name: place for place, (name, _) in stands.items()}
    placed = [
        (shapes[name], found.alignment.q)
        for name, found in located.items()
        if found.alignment is not None and name not in stands and name not in elsewhere
    ]
    placed += [where for _, where in stands.values()]
    extra = extra_objects(aligner, placed, [shapes[name].p_SR for name in empty])
    for name in {*stands, *elsewhere}:
        reason = _exchange(name, stands[name][0] if name in stands else "", elsewhere.get(name, ""))
        placements[name] = unseen(scene, name, reason, located[name].seen)
    return placements, extra, ""


def _exchange(name: str, instead: str, place: str) -> str:
    """Why an object is not where it belongs, when others' places are mixed up with it.

    Args:
        name: of the object.
        instead: what stands in its place; empty if that is not known.
        place: in whose place it stands; empty if that is not known.
    """
    if instead and place:
        return f"{instead} stands in its place, and {name} where {place} belongs"
    return f"{instead} stands in its place" if instead else f"it stands where {place} belongs"


def _aligner(
    scene: Scene,
    color: NDArray[np.uint8],
    depth: NDArray[np.float32] | None,
    intrinsics: Intrinsics,
    estimate: BoardEstimate,
    scale: tuple[float, float],
) -> Aligner | str:
    """What objects are aligned by; or why nothing can be measured."""
    if not estimate.valid:
        return f"the board was not found: {estimate.reason}" if estimate.reason else "no board"
    size = intrinsics.width, intrinsics.height
    straight = Undistortion(intrinsics)
    view = PinholeView(intrinsics.K, size, estimate.X_SC, _blind(straight, size))
    if depth is not None:
        return DepthAligner(view, straight.depth(depth))
    image = straight.color(color)
    picture = empty_board(scene.board, image, intrinsics.K, estimate.X_SC, scale, _tints(scene))
    return NO_CONTRAST if picture is None else SilhouetteAligner(view, image, picture)


@lru_cache(maxsize=4)
def _tints(scene: Scene) -> NDArray[np.uint8]:
    """(R, C, 3) the height map that may be printed on the sheet."""
    return height_map(scene, TINTS).image


def _blind(straight: Undistortion, size: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) pixels of a straight image that are beyond the given one, or next to these."""
    beyond = straight.depth(np.ones(size[::-1], np.float32)) == 0.0
    return np.asarray(cv2.dilate(beyond.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)


def _checked_image(image: NDArray[np.uint8], intrinsics: Intrinsics) -> NDArray[np.uint8]:
    """(H, W, 3) RGB."""
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] not in (3, 4):
        raise InvalidInputError(
            f"the photo has shape {image.shape} and type {image.dtype}; expected RGB, (H, W, 3)"
            " uint8"
        )
    intrinsics.require_size(image.shape[1], image.shape[0], "the photo")
    return np.ascontiguousarray(image[..., :3])


def _camera(estimate: BoardEstimate) -> CameraPlace | None:
    if not estimate.valid:
        return None
    error, covariance = estimate.reprojection_error, np.asarray(estimate.covariance)
    return CameraPlace(
        X_SC=Pose.from_matrix(estimate.X_SC, quaternion=True),
        reprojection_error=float(error) if np.isfinite(error) else None,
        covariance=tuple(covariance.ravel().tolist()) if np.isfinite(covariance).all() else (),
        markers=len(estimate.ids),
    )
