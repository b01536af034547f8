"""Camera response: exposure, white balance, blur and noise, applied to a rendered image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Bytes, InvalidInputError, Single, linear_to_srgb, srgb_to_linear
from burg_drake.dataset.appearance import Appearance

LINEAR_LEVELS = 1 << 14
"""Levels of linear light in the encoding table; the first sRGB steps span 5 of them."""


def apply_photometry(
    color: Bytes,
    labels: NDArray[np.integer] | None,
    appearance: Appearance,
    rng: np.random.Generator,
) -> Bytes:
    """Applies a camera's response to a rendered image.

    Multiplies the light by object gains, exposure and white balance, blurs it, and adds noise: shot
    noise, the square root of the number of electrons, and the sensor's read noise.

    Args:
        color: (H, W, 3) rendered image.
        labels: (H, W) numbers of instances, from 1; needed only with object gains.
        appearance: appearance with the camera response.
        rng: random numbers for the noise.

    Returns:
        (H, W, 3) sRGB.

    Raises:
        InvalidInputError: the labels are missing, of another size, or have more instances than
            there are gains.
    """
    read_noise = 3.0  # Electrons; standard deviation of an unlit pixel of a typical CMOS sensor.
    light = srgb_to_linear(color)
    if appearance.object_gains:
        light *= _pixel_gains(labels, color.shape[:2], appearance)
    response = appearance.photometry
    light *= np.float32(2.0**response.exposure) * np.array(response.white_balance, np.float32)
    if response.blur > 0.0:
        light = cv2.GaussianBlur(light, (0, 0), response.blur, borderType=cv2.BORDER_REPLICATE)
    if response.electrons is not None:
        spread = np.sqrt(light / response.electrons + (read_noise / response.electrons) ** 2)
        light += spread * rng.standard_normal(light.shape, dtype=np.float32)
    steps = np.clip(light * np.float32(LINEAR_LEVELS - 1) + np.float32(0.5), 0, LINEAR_LEVELS - 1)
    return np.asarray(_srgb_encoding_table(response.gamma)[steps.astype(np.uint16)])


def _pixel_gains(
    labels: NDArray[np.integer] | None, shape: tuple[int, ...], appearance: Appearance
) -> Single:
    """(H, W, 3) gain of each pixel."""
    if labels is None or labels.shape != shape:
        given = "none" if labels is None else f"{labels.shape[1]} x {labels.shape[0]}"
        raise InvalidInputError(
            f"gains of objects need the label image, with {shape[1]} x {shape[0]} pixels; given:"
            f" {given}"
        )
    gains = np.array([(1.0, 1.0, 1.0), *appearance.object_gains], np.float32)
    if (top_label := int(labels.max(initial=0))) >= len(gains):
        raise InvalidInputError(
            f"label {top_label} has no gain; the appearance is for a scene of {len(gains) - 1}"
            " objects"
        )
    return np.asarray(gains[labels])


def _srgb_encoding_table(gamma: float) -> Bytes:
    """(LINEAR_LEVELS,) sRGB values of levels of linear light."""
    light = np.linspace(0.0, 1.0, LINEAR_LEVELS) ** (1.0 / gamma)
    return linear_to_srgb(light)
