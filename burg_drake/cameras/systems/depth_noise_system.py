"""Noise of a depth camera as a Drake system, between a sensor that has none and who uses it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import Context, InputPort, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras.noise import DepthNoise, noisy_depth
from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import LARGEST_SEED, Bytes, InvalidInputError, rng_from

ROUNDING = 1e-6
"""Of a period: a time this little before an image belongs to it."""


class DepthNoiseSystem(LeafSystem):
    """Makes of a perfect depth image one as a camera measures it.

    Input ports:
        depth_image: `ImageDepth32F` of the intrinsics' size [m]; 0, infinite or NaN where nothing
            is, as `RgbdSensor` has it.
        color_image: `ImageRgba8U` of the same pixels, optional: dark surfaces have holes.
        normals: `Value[object]`, optional: (H, W, 3) unit normals in the camera's frame; those of
            the depth image are taken, if not connected.

    Output port:
        depth_image: `ImageDepth32F` [m], infinite where nothing is measured.

    The output is a function of the inputs and of the time; there is no state. Noise is drawn from
    the seed and the context's time: it is the same however often and in whatever order the output
    is evaluated, and another one at another time or with another seed.

    Args:
        noise: what the camera does to the image.
        intrinsics: of the image.
        seed: of the noise; cameras with the same seed have the same noise.
        period: between images [s]: noise changes with each, and stays in between, as it must
            behind an image that is held (`RgbdSensorDiscrete`). It changes with every time at
            which the output is evaluated if None.

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
        if not 0 <= seed <= LARGEST_SEED:
            raise InvalidInputError(f"seed of depth noise is {seed}; give 0 to {LARGEST_SEED}")
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
        if not self._depth.HasValue(context):
            raise InvalidInputError(
                f"{self.get_name()}: input port depth_image has no value; connect or fix it"
            )
        perfect = self._depth.Eval(context).data[..., 0]
        measured = noisy_depth(
            np.where(np.isfinite(perfect), perfect, np.float32(0.0)),
            self.noise,
            self.intrinsics,
            rng_from("depth noise", self._seed, self._moment(context)),
            normals=self._optional(context, self._normals),
            color=self._dark(context),
        )
        result = ImageDepth32F(self.intrinsics.width, self.intrinsics.height)
        result.mutable_data[..., 0] = np.where(measured > 0.0, measured, np.float32(np.inf))
        output.set_value(result)

    def _dark(self, context: Context) -> Bytes | None:
        """The colour image, if it makes a difference: it may have to be rendered first."""
        image = self._optional(context, self._color) if self.noise.dark_probability else None
        return None if image is None else image.data[..., :3]

    def _moment(self, context: Context) -> float | int:
        """What the noise is drawn for: the number of the image, or the time [s]."""
        time = float(context.get_time())
        return time if self._period is None else math.floor(time / self._period + ROUNDING)

    def _optional(self, context: Context, port: InputPort) -> Any:
        return port.Eval(context) if port.HasValue(context) else None
