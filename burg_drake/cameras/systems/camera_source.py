"""A source of frames as a Drake system, so that real images flow through the same diagrams."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras.sources import CameraLost, Frame, FrameSource
from burg_drake.core import InvalidInputError

DEFAULT_FPS = 30.0


class CameraSource(LeafSystem):
    """Shows the frames of a source.

    Ports:
        color_image (output, ImageRgba8U): the newest frame.
        depth_image (output, ImageDepth32F): its depth [m], infinite where nothing was measured;
            only if the source has depth.
        valid (output, 1): 1 as long as the source gives frames; 0 when the camera is lost or the
            source has ended, and the images are the last that there were.
        frame_time (output, 1): time of the frame, as the source tells it [s].

    Frames are read at the times of the periodic update and are state, so that all that depends on
    them sees the same. A simulator runs as fast as it can: for a live camera set its target
    real-time rate to 1. While a camera is lost, updates wait for it for a moment each.

    Args:
        source: of frames; it stays the caller's to close.
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
        color = self.DeclareAbstractState(Value(color_image(first)))
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
        period = 1.0 / (fps or source.fps or DEFAULT_FPS)
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
        state.get_mutable_abstract_state(self._color).set_value(color_image(frame))
        if self._depth is not None and frame.depth is not None:
            state.get_mutable_abstract_state(self._depth).set_value(_depth_image(frame))


def _next_frame(source: FrameSource) -> Frame | None:
    """The next frame that can be read."""
    while True:
        try:
            return source.read()
        except InvalidInputError:  # one broken file of several
            continue


def color_image(frame: Frame) -> ImageRgba8U:
    """A frame's image as Drake has them."""
    height, width = frame.image.shape[:2]
    image = ImageRgba8U(width, height)
    image.mutable_data[..., :3] = frame.image
    image.mutable_data[..., 3] = 255
    return image


def _depth_image(frame: Frame) -> ImageDepth32F:
    assert frame.depth is not None
    height, width = frame.depth.shape
    image = ImageDepth32F(width, height)
    image.mutable_data[..., 0] = np.where(np.isnan(frame.depth), np.inf, frame.depth)
    return image
