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
    """What one image says.

    Attributes:
        stamp: the image's time, in the type that its message has it.
        camera_frame: tf frame of the camera, x right, y down, z forward; may be empty.
        estimate: where the camera is over the board; where an image could not be used at all,
            `reason` says why.
        image: (H, W, 3) RGB, or None where it could not be read.
        intrinsics: of the camera that took it, or None where they are not known.
    """

    stamp: Any
    camera_frame: str
    estimate: BoardEstimate
    image: Bytes | None = None
    intrinsics: Intrinsics | None = None

    @property
    def status(self) -> str:
        """One line for people."""
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
    """A scene's board in the images of one camera.

    The camera's resolution may change at any time. Nothing that a message holds ends the node: an
    image that cannot be used is a sighting that says why.
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
            scene: what stands on the board.
            intrinsics: of the camera; from its camera_info if None.
            rectified: the images are free of distortion (`image_rect`).
            print_scale: size of the printed board against the document's, along x and y.
        """
        self._scene = scene
        self._rectified = rectified
        self._given = intrinsics
        self._print_scale = print_scale
        self._board: BoardPose | None = None
        self._overlay: Overlay | None = None

    def locate(self, image: Any, camera_info: Any | None) -> Sighting:
        """Finds the board.

        Args:
            image: `sensor_msgs/Image` or `CompressedImage`.
            camera_info: `sensor_msgs/CameraInfo`, the latest; None if there was none yet.
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
        """(H, W, 3) RGB with the scene's objects in it, or with a line that says why there are
        none; None if there is no image."""
        image, intrinsics = sighting.image, sighting.intrinsics
        if image is None:
            return None
        if not sighting.estimate.valid or intrinsics is None:
            return draw_notice(image, sighting.estimate.reason)
        if self._overlay is None or self._overlay.intrinsics != intrinsics:
            self._overlay = Overlay(self._scene, intrinsics)
        return self._overlay.draw(image, sighting.estimate.X_SC)

    def _intrinsics(self, camera_info: Any | None, image: Bytes) -> Intrinsics:
        if self._given is not None:
            found, source = self._given, "intrinsics are of"
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
