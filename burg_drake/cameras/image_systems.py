"""Drake systems for images: frames of a source, depth noise and the overlay."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, InputPort, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras.depth_camera_noise import noisy_depth
from burg_drake.cameras.depth_camera_presets import DepthNoise
from burg_drake.cameras.frame_source import CameraLost, Frame, FrameSource
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.overlay import Overlay, OverlayStyle
from burg_drake.cameras.placement.document import PlacementCheck
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.cameras.pose_systems import evaluate_optional
from burg_drake.core import MAX_DOCUMENT_SEED, Bytes, InvalidInputError, rng_from
from burg_drake.scene import SceneLike, as_scene


class CameraSource(LeafSystem):
    """Outputs the frames of a source.

    Ports:
        color_image (output, ImageRgba8U): the newest frame.
        depth_image (output, ImageDepth32F): the frame's depth [m], infinite where none was
        measured; only if the source has depth.
        valid (output, 1): 1 as long as the source gives frames; 0 when the camera is lost or the
        source has ended, and the images are the last ones.
        frame_time (output, 1): time of the frame by the source's clock [s].

    Frames are read by a periodic update and stored as state, so that all outputs are of the same
    frame. A simulator runs as fast as it can: for a live camera set its target real-time rate to 1.
    While a camera is lost, updates wait for it for a moment each.

    Args:
        source: source of frames; the caller closes it.
        fps: updates a second; the source's own, or 30, if not given.

    Raises:
        InvalidInputError: the source has no frame at all.
    """

    def __init__(self, source: FrameSource, fps: float | None = None) -> None:
        super().__init__()
        first = _next_frame(source)
        if first is None:
            raise InvalidInputError(f"{source.name} has no frames")
        self._source = source
        color = self.DeclareAbstractState(Value(rgba_image(first.image)))
        self.DeclareStateOutputPort("color_image", color)
        self._depth = None
        if first.depth is not None:
            self._depth = self.DeclareAbstractState(Value(_depth_image(first)))
            self.DeclareStateOutputPort("depth_image", self._depth)
        self._color = color
        numbers = self.DeclareDiscreteState(np.array([1.0, first.time]))
        for k, name in enumerate(("valid", "frame_time")):
            self.DeclareVectorOutputPort(
                name,
                1,
                lambda context, output, k=k: output.SetAtIndex(
                    0, context.get_discrete_state(numbers).GetAtIndex(k)
                ),
                {self.discrete_state_ticket(numbers)},
            )
        # Frames per second of sources that do not state them.
        period = 1.0 / (fps or source.fps or 30.0)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, period, self._update)

    def _update(self, context: Any, state: Any) -> None:
        numbers = state.get_mutable_discrete_state().get_mutable_vector(0)
        try:
            frame = _next_frame(self._source)
        except CameraLost:
            frame = None
        if frame is None:
            numbers.SetAtIndex(0, 0.0)
            return
        numbers.SetFromVector([1.0, frame.time])
        state.get_mutable_abstract_state(self._color).set_value(rgba_image(frame.image))
        if self._depth is not None and frame.depth is not None:
            state.get_mutable_abstract_state(self._depth).set_value(_depth_image(frame))


def _next_frame(source: FrameSource) -> Frame | None:
    """Reads the next readable frame."""
    while True:
        try:
            return source.read()
        except InvalidInputError:  # skip a broken file among several
            continue


def rgba_image(pixels: Bytes) -> ImageRgba8U:
    """Converts pixels (H, W, 3) to an opaque Drake image."""
    image = ImageRgba8U(pixels.shape[1], pixels.shape[0])
    image.mutable_data[..., :3] = pixels
    image.mutable_data[..., 3] = 255
    return image


def _depth_image(frame: Frame) -> ImageDepth32F:
    assert frame.depth is not None
    height, width = frame.depth.shape
    image = ImageDepth32F(width, height)
    image.mutable_data[..., 0] = np.where(np.isnan(frame.depth), np.inf, frame.depth)
    return image


class DepthNoiseSystem(LeafSystem):
    """Adds the noise of a depth camera to a perfect depth image.

    Input ports:
        depth_image: `ImageDepth32F` of the intrinsics' size [m]; 0, infinite or NaN without depth,
            as of `RgbdSensor`.
        color_image: `ImageRgba8U` of the same pixels, optional: dark surfaces have holes.
        normals: `Value[object]`, optional: (H, W, 3) unit normals in the camera's frame; computed
            from the depth image if not connected.

    Output port:
        depth_image: `ImageDepth32F` [m], infinite where none is measured.

    The output is a function of the inputs and of the time; there is no state. Noise is drawn from
    the seed and the context's time: it does not depend on how often and in which order the output
    is evaluated, and differs between times and seeds.

    Args:
        noise: noise of the camera.
        intrinsics: of the image.
        seed: of the noise; cameras with the same seed have the same noise.
        period: between images [s]: noise changes with each image and stays in between, as needed
            behind a held image (`RgbdSensorDiscrete`). If None, it changes with every evaluated
            time.

    Raises:
        InvalidInputError: the seed is below 0 or has more than 64 bits, or the period is not above
            0; while it runs: an image does not fit, or none is connected.
    """

    def __init__(
        self,
        noise: DepthNoise,
        intrinsics: Intrinsics,
        *,
        seed: int = 0,
        period: float | None = None,
    ) -> None:
        if not 0 <= seed <= MAX_DOCUMENT_SEED:
            raise InvalidInputError(f"seed of depth noise is {seed}; give 0 to {MAX_DOCUMENT_SEED}")
        if period is not None and not 0.0 < period < math.inf:
            raise InvalidInputError(f"period of depth noise is {period:g} s; give more than 0")
        super().__init__()
        self.set_name("depth_noise")
        self.noise, self.intrinsics = noise, intrinsics
        self._seed, self._period = seed, period
        blank = ImageDepth32F(intrinsics.width, intrinsics.height)
        self._depth = self.DeclareAbstractInputPort("depth_image", Value(blank))
        self._color = self.DeclareAbstractInputPort(
            "color_image", Value(ImageRgba8U(intrinsics.width, intrinsics.height))
        )
        self._normals = self.DeclareAbstractInputPort("normals", Value[object]())
        self.DeclareAbstractOutputPort(
            "depth_image",
            lambda: Value(blank),
            self._measure,
            prerequisites_of_calc={self.all_input_ports_ticket(), self.time_ticket()},
        )

    def _measure(self, context: Context, output: AbstractValue) -> None:
        perfect = _require_value(self, self._depth, context).data[..., 0]
        color = None
        if self.noise.dark_probability:  # else it makes no difference, and may have to be rendered
            color = evaluate_optional(self._color, context)
        measured = noisy_depth(
            np.where(np.isfinite(perfect), perfect, np.float32(0.0)),
            self.noise,
            self.intrinsics,
            rng_from("depth noise", self._seed, self._noise_key(context)),
            normals=evaluate_optional(self._normals, context),
            color=None if color is None else color.data[..., :3],
        )
        result = ImageDepth32F(self.intrinsics.width, self.intrinsics.height)
        result.mutable_data[..., 0] = np.where(measured > 0.0, measured, np.float32(np.inf))
        output.set_value(result)

    def _noise_key(self, context: Context) -> float | int:
        """Key of the noise: the number of the image, or the time [s]."""
        time = float(context.get_time())
        # A time less than a millionth of a period before an image belongs to the image.
        return time if self._period is None else math.floor(time / self._period + 1e-6)


class SceneOverlay(LeafSystem):
    """Draws a scene's objects at their target poses over camera images.

    Input ports:
        color_image: `ImageRgba8U` of the intrinsics' size.
        X_SC: `Value[RigidTransform]`, camera's optical frame in the scene frame.
        valid: (1,), optional: above 0.5 if `X_SC` can be used; always, if not connected.
        estimate: `Value[BoardEstimate]`, optional: its `reason` is written where `X_SC` is not
            valid; if `valid` is not connected, the estimate's `valid` is used.
        placement: `Value[PlacementCheck]`, optional: deviations of the objects from their targets;
            None while unknown.

    Output port:
        overlay_image: `ImageRgba8U`; without a valid pose, the plain image with a line that says
            why.

    The output is a function of the current inputs, evaluated on demand; there is no state and no
    lag.
    """

    def __init__(
        self, scene: SceneLike, intrinsics: Intrinsics, style: OverlayStyle | None = None
    ) -> None:
        """Loads the objects' surfaces.

        Args:
            scene: scene to draw.
            intrinsics: of the camera.
            style: fixed style of the system; the default one if None.

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
        image = _require_value(self, self._color_image, context).data
        size = self._overlay.intrinsics
        size.require_size(image.shape[1], image.shape[0], "the image at port color_image")
        colors = np.ascontiguousarray(image[..., :3])
        estimate = evaluate_optional(self._estimate, context)
        valid = estimate is None or estimate.valid
        if self._valid.HasValue(context):
            valid = self._valid.Eval(context)[0] > 0.5
        if valid:
            X_SC = _require_value(self, self._X_SC, context).GetAsMatrix4()
            drawn = self._overlay.draw(colors, X_SC, placement=self._checked(context))
        else:
            reason = (estimate and estimate.reason) or "no pose of the camera"
            drawn = self._overlay.notice(colors, reason)
        output.set_value(rgba_image(drawn))

    def _checked(self, context: Context) -> PlacementCheck | None:
        check = evaluate_optional(self._placement, context)
        if check is None or isinstance(check, PlacementCheck):
            return check
        raise InvalidInputError(f"port placement takes a PlacementCheck, not {check!r}")


def _require_value(system: LeafSystem, port: InputPort, context: Context) -> Any:
    """The value at an input port.

    Raises:
        InvalidInputError: there is none.
    """
    if not port.HasValue(context):
        raise InvalidInputError(
            f"{system.get_name()}: input port {port.get_name()} has no value; connect or fix it"
        )
    return port.Eval(context)
