"""Placement check: measure how far each object of a real scene stands from its target.

The pose of the camera comes from the board. An object is assumed to rest as in the scene,
displaced in the plane of the board and rotated about the vertical.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.placement.alignment import Aligner
from burg_drake.cameras.placement.board_background import empty_board
from burg_drake.cameras.placement.depth_aligner import DepthAligner, check_depth
from burg_drake.cameras.placement.document import (
    CameraPlace,
    CheckedImage,
    CheckedScene,
    ExtraObject,
    Placement,
    PlacementCheck,
    PlacementStatus,
    camera_versions,
)
from burg_drake.cameras.placement.localization import (
    MIN_OBJECT_SUPPORT,
    ObjectLocation,
    locate_objects,
)
from burg_drake.cameras.placement.misplaced_objects import (
    find_exchanged_objects,
    find_extra_objects,
)
from burg_drake.cameras.placement.object_search import SEARCH_RANGE
from burg_drake.cameras.placement.object_shape import TargetShape, target_shapes
from burg_drake.cameras.placement.pinhole_view import PinholeView
from burg_drake.cameras.placement.silhouette_aligner import SilhouetteAligner
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.cameras.pose.board_pose import BoardPose
from burg_drake.core import (
    Array,
    Booleans,
    Bytes,
    InvalidInputError,
    Pose,
    Single,
    Vector3,
    content_hash,
    wrap_to_pi,
)
from burg_drake.printout import height_map
from burg_drake.scene import Scene, SceneLike, as_scene

MIN_ABSENCE_VISIBILITY = 0.2  # Visible fraction of the silhouette needed to call an object absent.
MIN_VISIBILITY = 0.4  # Visible fraction needed for a certain measurement.


class Undistortion:
    """Removes lens distortion from the images of one camera; pinhole images stay unchanged.

    Args:
        intrinsics: of the camera; the undistorted images have the same `K`. A wide lens loses its
            outer part, as the width over the focal length limits the field of view below 180
            degrees. A fisheye of 1280 pixels, 430 per radian, sees 170 degrees across and keeps the
            middle 112.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self._map = None
        if not intrinsics.is_pinhole:
            u, v = np.arange(intrinsics.width), np.arange(intrinsics.height)
            grid = np.stack(np.meshgrid(u, v), axis=-1)
            flat = (grid - intrinsics.center) / intrinsics.focal
            rays = np.concatenate([flat, np.ones((*flat.shape[:2], 1))], axis=-1)
            at = intrinsics.project(rays).astype(np.float32)
            self._map = at[..., 0].copy(), at[..., 1].copy()

    def color(self, image: Bytes) -> Bytes:
        """Undistorts a colour image (H, W, 3); black outside the given image."""
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, *self._map, cv2.INTER_CUBIC))

    def depth(self, depth: Single) -> Single:
        """Undistorts a depth image (H, W) by nearest pixels, as depths across an edge cannot be
        averaged; 0 outside.
        """
        if self._map is None:
            return depth
        return np.asarray(cv2.remap(depth, *self._map, cv2.INTER_NEAREST))


def assess_placement(
    scene: Scene,
    name: str,
    shape: TargetShape,
    found: ObjectLocation,
    camera: Array,
    max_residual: float,
    typical: float,
) -> Placement:
    """Builds the document's entry of an object.

    Args:
        scene: scene with the objects' targets.
        name: of the instance.
        shape: of the object.
        found: location of the object.
        camera: (6, 6) covariance of the camera's pose, NaN if unknown.
        max_residual: largest residual of a correct alignment.
        typical: colour similarity that is usual in the photo, see `typical_color_similarity`.
    """
    missing = _missing_reason(found)
    if missing or found.alignment is None:
        return unseen_placement(scene, name, missing, found.seen)
    alignment = found.alignment
    q = alignment.q
    deviation = np.sqrt(np.maximum(np.diag(alignment.total_covariance(camera)), 0.0))
    reason = _doubt_reason(shape, found, deviation, max_residual, typical)
    status: PlacementStatus = "uncertain" if reason else "measured"
    residual = alignment.residual
    return Placement(
        object=scene.instance(name).object,
        status=status,
        reason=reason,
        target=scene.instance(name).X_SO,
        measured=Pose.from_matrix(shape.placed(q), quaternion=True),
        reference=cast(Vector3, tuple(np.round(shape.p_OR, 9).tolist())),
        displacement=(float(q[0]), float(q[1])),
        displacement_sd=(float(deviation[0]), float(deviation[1])),
        angle=None if shape.symmetric else float(wrap_to_pi(q[2])),
        angle_sd=None if shape.symmetric else float(deviation[2]),
        seen=round(found.seen, 4),
        residual=float(residual) if np.isfinite(residual) else None,
    )


def typical_color_similarity(located: Iterable[ObjectLocation]) -> float:
    """Median colour similarity of the objects that were found; 0 for fewer than three."""
    similarities = [
        f.color_similarity for f in located if f.alignment is not None and f.seen > MIN_VISIBILITY
    ]
    return float(np.median(similarities)) if len(similarities) > 2 else 0.0


def unseen_placement(scene: Scene, name: str, reason: str, seen: float = 0.0) -> Placement:
    """Builds the document's entry of an object that was not measured."""
    instance = scene.instance(name)
    return Placement(
        object=instance.object,
        status="not_seen",
        reason=reason,
        target=instance.X_SO,
        seen=round(seen, 4),
    )


def _missing_reason(found: ObjectLocation) -> str:
    """Reason why an object is not seen; empty if it is."""
    if found.in_image < MIN_ABSENCE_VISIBILITY:
        return "it is out of view"
    if found.seen < MIN_ABSENCE_VISIBILITY:
        return "other objects hide it"
    if found.alignment is None or found.support < MIN_OBJECT_SUPPORT:
        return f"nothing like it was found within {1e3 * SEARCH_RANGE:.0f} mm of its target"
    return ""


def _doubt_reason(
    shape: TargetShape, found: ObjectLocation, deviation: Array, max_residual: float, typical: float
) -> str:
    """Reasons to doubt a measurement; empty if there are none."""
    alignment = found.alignment
    assert alignment is not None
    if alignment.agreement < 0.6:  # Fraction of the outline, or of the depth points, that must fit.
        return (
            f"only {100 * alignment.agreement:.0f} % of its outline match the image: is it another"
            " object, or in another pose?"
        )
    # Objects as dark as ink or as bright as paper have little support, but an outline that agrees.
    if found.support < 0.45 and alignment.agreement < 0.85:
        return (
            "the board is visible where the object should cover it: is it another object, or in"
            " another pose?"
        )
    if alignment.residual > max_residual:
        return (
            "its outline does not quite match the image: is it another object, or in another pose?"
        )
    # Mesh colours are reliable if most objects of the scene match theirs.
    if shape.colors is not None and found.color_similarity < 0.4 * typical and typical > 0.6:
        return "it does not have the colors of its mesh: is it another object?"
    if found.spill > 0.35:  # Fraction around the silhouette with evidence of something else.
        return "something sticks out next to it: is it another object, or in another pose?"
    if alignment.ambiguous:
        return "another pose fits almost as well"
    if alignment.equivalent_turns:
        turn = np.rad2deg(max(alignment.equivalent_turns, key=abs))
        return f"it fits as well when rotated by another {turn:+.0f} deg"
    if found.seen < MIN_VISIBILITY:
        return f"only {100 * found.seen:.0f} % of it can be seen"
    if deviation[:2].max() > 0.003:  # Metres.
        return f"its position is only known to {1e3 * deviation[:2].max():.1f} mm"
    if not shape.symmetric and deviation[2] > np.deg2rad(3.0):  # Radians.
        return f"its rotation is only known to {np.rad2deg(deviation[2]):.0f} deg"
    return ""


def check_placement(
    scene: SceneLike,
    image: Bytes,
    intrinsics: Intrinsics,
    *,
    depth: Single | None = None,
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
        scene: scene with the objects' targets.
        image: (H, W, 3) RGB photo of the scene on its board.
        intrinsics: of the camera.
        depth: (H, W) distances along the optical axis [m] of the same camera, 0 or NaN where there
            is none. Objects are then aligned with these, and the photo only serves to find the
            board.
        estimate: pose of the camera; estimated from the photo's markers if None.
        scale: size of the print relative to the document along x and y, if measured; an `estimate`
            must be of a `BoardPose` with the same scale.
        image_source, depth_source: entries of the images in the document; hashes of the images'
            pixels if None.

    Raises:
        InvalidInputError: the photo is no image, or has another size than the intrinsics; the depth
            is not in metres; or the markers do not fit on the board.
    """
    scene = as_scene(scene)
    scene.require_markers()
    color = _checked_image(image, intrinsics)
    if depth is not None:
        depth = check_depth(depth, intrinsics)
    if estimate is None:
        estimate = BoardPose(scene.board, intrinsics, scale).estimate(color)
    instances, extra, reason = _measure_objects(scene, color, depth, intrinsics, estimate, scale)
    return PlacementCheck(
        scene=CheckedScene(
            name=scene.name, path=str(Path(scene.path).absolute()), content=scene.content
        ),
        taken=datetime.now().astimezone().isoformat(timespec="seconds"),
        method="silhouette" if depth is None else "depth",
        image=image_source or CheckedImage(content=content_hash(color)),
        depth=None if depth is None else depth_source or CheckedImage(content=content_hash(depth)),
        intrinsics=intrinsics,
        camera=_camera_place(estimate),
        reason=reason,
        instances=instances,
        extra=extra,
        versions=camera_versions(),
    )


def _measure_objects(
    scene: Scene,
    color: Bytes,
    depth: Single | None,
    intrinsics: Intrinsics,
    estimate: BoardEstimate,
    scale: tuple[float, float],
) -> tuple[dict[str, Placement], tuple[ExtraObject, ...], str]:
    """Placements by name, extra objects, and the reason if nothing was measured."""
    aligner = _build_aligner(scene, color, depth, intrinsics, estimate, scale)
    if isinstance(aligner, str):
        names = (*scene.instances, *scene.background)
        return {name: unseen_placement(scene, name, aligner) for name in names}, (), aligner
    shapes = target_shapes(scene)
    located = locate_objects(aligner, shapes)
    typical = typical_color_similarity(located.values())
    placements = {
        name: assess_placement(
            scene, name, shapes[name], found, estimate.covariance, aligner.max_residual, typical
        )
        for name, found in located.items()
    }
    doubtful = [name for name, placed in placements.items() if placed.status != "measured"]
    occupants, empty = find_exchanged_objects(aligner, shapes, located, doubtful)
    place_of = {name: place for place, (name, _) in occupants.items()}
    placed = [
        (shapes[name], found.alignment.q)
        for name, found in located.items()
        if found.alignment is not None and name not in occupants and name not in place_of
    ]
    placed += [occupant for _, occupant in occupants.values()]
    extra = find_extra_objects(aligner, placed, [shapes[name].p_SR for name in empty])
    for name in {*occupants, *place_of}:
        occupant, place = occupants[name][0] if name in occupants else "", place_of.get(name, "")
        if occupant and place:
            reason = f"{occupant} stands in its place, and {name} where {place} belongs"
        elif occupant:
            reason = f"{occupant} stands in its place"
        else:
            reason = f"it stands where {place} belongs"
        placements[name] = unseen_placement(scene, name, reason, located[name].seen)
    return placements, extra, ""


def _build_aligner(
    scene: Scene,
    color: Bytes,
    depth: Single | None,
    intrinsics: Intrinsics,
    estimate: BoardEstimate,
    scale: tuple[float, float],
) -> Aligner | str:
    """The aligner, or the reason why nothing can be measured."""
    if not estimate.valid:
        return f"the board was not found: {estimate.reason}" if estimate.reason else "no board"
    size = intrinsics.width, intrinsics.height
    straight = Undistortion(intrinsics)
    view = PinholeView(intrinsics.K, size, estimate.X_SC, _blind_pixels(straight, size))
    if depth is not None:
        return DepthAligner(view, straight.depth(depth))
    image = straight.color(color)
    tints = _height_map_tints(scene)
    picture = empty_board(scene.board, image, intrinsics.K, estimate.X_SC, scale, tints)
    if picture is None:
        return "the board's paper and ink look alike in the photo; give it more light"
    return SilhouetteAligner(view, image, picture)


@lru_cache(maxsize=4)
def _height_map_tints(scene: Scene) -> Bytes:
    """(R, C, 3) the height map that may be printed on the sheet."""
    return height_map(scene, 1e-3).image  # Metres. Resolution of the printed height map.


def _blind_pixels(straight: Undistortion, size: tuple[int, int]) -> Booleans:
    """(H, W) pixels of an undistorted image outside the given one, or next to such pixels."""
    beyond = straight.depth(np.ones(size[::-1], np.float32)) == 0.0
    return np.asarray(cv2.dilate(beyond.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)


def _checked_image(image: Bytes, intrinsics: Intrinsics) -> Bytes:
    """(H, W, 3) RGB."""
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] not in (3, 4):
        raise InvalidInputError(
            f"the photo has shape {image.shape} and type {image.dtype}; expected RGB, (H, W, 3)"
            " uint8"
        )
    intrinsics.require_size(image.shape[1], image.shape[0], "the photo")
    return np.ascontiguousarray(image[..., :3])


def _camera_place(estimate: BoardEstimate) -> CameraPlace | None:
    if not estimate.valid:
        return None
    error, covariance = estimate.reprojection_error, np.asarray(estimate.covariance)
    return CameraPlace(
        X_SC=Pose.from_matrix(estimate.X_SC, quaternion=True),
        reprojection_error=float(error) if np.isfinite(error) else None,
        covariance=tuple(covariance.ravel().tolist()) if np.isfinite(covariance).all() else (),
        markers=len(estimate.ids),
    )
