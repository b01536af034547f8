"""Locate the board in images and draw the overlay. Needs no ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from burg_drake.cameras import BoardEstimate, BoardPose, Intrinsics, Overlay, draw_notice
from burg_drake.core import Bytes, InvalidInputError
from burg_drake.ros.camera_messages import decode_image_message, intrinsics_from_camera_info
from burg_drake.scene import Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class Sighting:
    """The board in one image.

    Attributes:
        stamp: time of the image, in the type of its message.
        camera_frame: tf frame of the camera, x right, y down, z forward; may be empty.
        estimate: pose of the camera over the board; `reason` says why an image could not be used.
        image: (H, W, 3) RGB; None if it could not be read.
        intrinsics: of the camera; None if unknown.
    """

    stamp: Any
    camera_frame: str
    estimate: BoardEstimate
    image: Bytes | None = None
    intrinsics: Intrinsics | None = None

    @property
    def status(self) -> str:
        """Status as one line of text."""
        estimate = self.estimate
        if not estimate.valid:
            return f"no pose: {estimate.reason}"
        remarks = [f"{len(estimate.ids)} markers, {estimate.reprojection_error:.2f} px"]
        if estimate.reason:
            remarks.append(estimate.reason)
        if not self.camera_frame:
            remarks.append("not sent to tf, as the images have no frame_id")
        return "; ".join(remarks)


class BoardNode:
    """Locates a scene's board in the images of one camera.

    The camera's resolution may change at any time. Invalid messages never raise: the sighting says
    why an image could not be used.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        intrinsics: Intrinsics | None = None,
        rectified: bool = False,
        print_scale: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """
        Args:
            scene: objects on the board.
            intrinsics: of the camera; from its camera_info if None.
            rectified: whether the images are free of distortion (`image_rect`).
            print_scale: size of the printed board relative to the document, along x and y.
        """
        self._scene = scene
        self._rectified = rectified
        self._fixed_intrinsics = intrinsics
        self._print_scale = print_scale
        self._board: BoardPose | None = None
        self._overlay: Overlay | None = None

    def locate(self, image: Any, camera_info: Any | None) -> Sighting:
        """Locates the board in an image.

        Args:
            image: `sensor_msgs/Image` or `CompressedImage`.
            camera_info: `sensor_msgs/CameraInfo`, the latest; None before the first.
        """
        rgb = intrinsics = None
        try:
            rgb = decode_image_message(image)
            intrinsics = self._intrinsics(camera_info, rgb)
            if self._board is None or self._board.intrinsics != intrinsics:
                self._board = BoardPose(self._scene.board, intrinsics, self._print_scale)
            estimate = self._board.estimate(rgb)
        except InvalidInputError as error:
            estimate = BoardEstimate(reason=str(error))
        return Sighting(
            stamp=image.header.stamp,
            camera_frame=image.header.frame_id,
            estimate=estimate,
            image=rgb,
            intrinsics=intrinsics,
        )

    def draw(self, sighting: Sighting) -> Bytes | None:
        """Draws the scene's objects over the image (H, W, 3), or a line that says why there are
        none; None without an image.
        """
        image, intrinsics = sighting.image, sighting.intrinsics
        if image is None:
            return None
        if not sighting.estimate.valid or intrinsics is None:
            return draw_notice(image, sighting.estimate.reason)
        if self._overlay is None or self._overlay.intrinsics != intrinsics:
            self._overlay = Overlay(self._scene, intrinsics)
        return self._overlay.draw(image, sighting.estimate.X_SC)

    def _intrinsics(self, camera_info: Any | None, image: Bytes) -> Intrinsics:
        if self._fixed_intrinsics is not None:
            found, source = self._fixed_intrinsics, "intrinsics are of"
        elif camera_info is not None:
            found = intrinsics_from_camera_info(camera_info, rectified=self._rectified)
            source = "camera_info says"
        else:
            raise InvalidInputError(
                "no camera_info message has arrived yet; if the camera publishes none, give its"
                " intrinsics as a file"
            ).about("intrinsics")
        height, width = image.shape[:2]
        if (width, height) != (found.width, found.height):
            raise InvalidInputError(
                f"the image has {width} x {height} pixels, but its {source} {found.width}"
                f" x {found.height}"
            )
        return found
