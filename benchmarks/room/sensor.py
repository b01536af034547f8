"""From light to an image: blur, vignetting, noise, gamma, JPEG."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from .paper import Array, Image


@dataclass(frozen=True)
class Sensor:
    """Lens and sensor but for their geometry.

    Attributes:
        exposure: level of a white page in the middle of the board over full scale, linear; from 1
            on it is clipped.
        blur: standard deviation of a Gaussian point spread [pixels].
        disk: radius of a disk, out of focus [pixels]; after the other.
        vignetting: what the image's corners lack of the light.
        electrons: at full scale; shot noise is the root of those that came. None without noise.
        read_noise: [electrons].
        quality: of JPEG; None without.
    """

    exposure: float = 0.75
    blur: float = 0.0
    disk: float = 0.0
    vignetting: float = 0.0
    electrons: float | None = None
    read_noise: float = 5.0
    quality: int | None = None


def image_of(radiance: Array, white: float, sensor: Sensor, rng: np.random.Generator) -> Image:
    """(H, W, 3) RGB.

    Args:
        radiance: (H, W, 3) that reaches the pixels.
        white: radiance of a white page.
        sensor: that receives it.
        rng: of the noise.
    """
    light = (sensor.exposure / white) * radiance
    if sensor.blur > 0.0:
        light = cv2.GaussianBlur(light, None, sensor.blur, borderType=cv2.BORDER_REPLICATE)
    if sensor.disk > 0.0:
        light = cv2.filter2D(light, -1, disk(sensor.disk), borderType=cv2.BORDER_REPLICATE)
    if sensor.vignetting > 0.0:
        light = light * _vignette(light.shape[:2], sensor.vignetting)[..., None]
    if sensor.electrons is not None:
        variance = np.maximum(light, 0.0) / sensor.electrons
        variance += (sensor.read_noise / sensor.electrons) ** 2
        light = light + np.sqrt(variance) * rng.standard_normal(light.shape)
    image = np.round(255.0 * encoded(np.clip(light, 0.0, 1.0))).astype(np.uint8)
    if sensor.quality is None:
        return image
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, sensor.quality])
    return np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1])


def encoded(light: Array) -> Array:
    """Linear light in the gamma of sRGB (IEC 61966-2-1), both 0 to 1."""
    low = 12.92 * light
    return np.where(light <= 0.0031308, low, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def disk(radius: float) -> Array:
    """(K, K) weights of a disk, its edge by 16 by 16 samples a pixel."""
    reach = int(np.ceil(radius + 0.5))
    fine = (np.arange((2 * reach + 1) * 16) + 0.5) / 16 - 0.5 - reach
    inside = (fine[:, None] ** 2 + fine**2 <= radius * radius).astype(float)
    kernel = inside.reshape(2 * reach + 1, 16, 2 * reach + 1, 16).mean(axis=(1, 3))
    return kernel / kernel.sum()


def _vignette(shape: tuple[int, int], lost: float) -> Array:
    v, u = np.indices(shape)
    middle = (np.array(shape) - 1) / 2
    r2 = ((v - middle[0]) ** 2 + (u - middle[1]) ** 2) / (middle**2).sum()
    return 1.0 - lost * r2
