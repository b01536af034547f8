"""The overlay as a Drake system: image and camera pose in, image with the scene's objects out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageRgba8U

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.overlay import Overlay, OverlayStyle
from burg_drake.cameras.placement import PlacementCheck
from burg_drake.cameras.pose import BoardEstimate
from burg_drake.core import InvalidInputError
from burg_drake.scene.document import SceneLike, as_scene

NO_POSE = "no pose of the camera"
"""Written over the image when no reason is known."""


class SceneOverlay(LeafSystem):
    """Draws the objects of a scene, at their places, over images of a camera.

    Input ports:
        color_image: `ImageRgba8U` of the intrinsics' size.
        X_SC: `Value[RigidTransform]`, camera's optical frame in the scene frame.
        valid: (1,), optional: above 0.5 if `X_SC` can be used; always, if not connected.
        estimate: `Value[BoardEstimate]`, optional: its `reason` is written where `X_SC` is not
            valid; where `valid` is not connected, this one's counts.
        placement: `Value[PlacementCheck]`, optional: how far the objects stand from their places;
            None while that is not known.

    Output port:
        overlay_image: `ImageRgba8U`; where the pose is not valid, the plain image with a line that
            says why.

    The output is a function of the current inputs, computed when one of them has changed and
    somebody asks; there is no state, and nothing lags by a frame.
    """

    def __init__(
        self, scene: SceneLike, intrinsics: Intrinsics, style: OverlayStyle | None = None
    ) -> None:
        """Loads the objects' surfaces.

        Args:
            scene: whose objects.
            intrinsics: of the camera.
            style: for good, as part of the system; the default one if None.

        Raises:
            UnknownNameError: a mesh file of the library is missing.
        """
        scene = as_scene(scene)
        super().__init__()
        self.set_name("scene_overlay")
        self._overlay = Overlay(scene, intrinsics, style)
        blank = ImageRgba8U(intrinsics.width, intrinsics.height)
        self._color_image = self.DeclareAbstractInputPort("color_image", Value(blank))
        self._X_SC = self.DeclareAbstractInputPort("X_SC", Value(RigidTransform()))
        self._valid = self.DeclareVectorInputPort("valid", 1)
        self._estimate = self.DeclareAbstractInputPort(
            "estimate", AbstractValue.Make(BoardEstimate())
        )
        self._placement = self.DeclareAbstractInputPort("placement", Value[object]())
        self.DeclareAbstractOutputPort(
            "overlay_image",
            lambda: Value(blank),
            self._draw,
            prerequisites_of_calc={self.all_input_ports_ticket()},
        )

    def _draw(self, context: Context, output: AbstractValue) -> None:
        image = self._required(context, self._color_image).data
        size = self._overlay.intrinsics
        size.require_size(image.shape[1], image.shape[0], "the image at port color_image")
        colors = np.ascontiguousarray(image[..., :3])
        estimate = self._optional(context, self._estimate)
        valid = estimate is None or estimate.valid
        if self._valid.HasValue(context):
            valid = self._valid.Eval(context)[0] > 0.5
        if valid:
            X_SC = self._required(context, self._X_SC).GetAsMatrix4()
            drawn = self._overlay.draw(colors, X_SC, placement=self._checked(context))
        else:
            drawn = self._overlay.notice(colors, (estimate and estimate.reason) or NO_POSE)
        result = ImageRgba8U(size.width, size.height)
        result.mutable_data[:] = _opaque(drawn)
        output.set_value(result)

    def _checked(self, context: Context) -> PlacementCheck | None:
        check = self._optional(context, self._placement)
        if check is None or isinstance(check, PlacementCheck):
            return check
        raise InvalidInputError(f"port placement takes a PlacementCheck, not {check!r}")

    def _required(self, context: Context, port: Any) -> Any:
        if not port.HasValue(context):
            raise InvalidInputError(
                f"{self.get_name()}: input port {port.get_name()} has no value; connect or fix it"
            )
        return port.Eval(context)

    def _optional(self, context: Context, port: Any) -> Any:
        return port.Eval(context) if port.HasValue(context) else None


def _opaque(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 4) with an opacity of 255."""
    return np.concatenate([image, np.full((*image.shape[:2], 1), 255, np.uint8)], axis=2)
