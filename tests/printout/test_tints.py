"""Tints: brightness tells the height, whatever the hue."""

from __future__ import annotations

import itertools

import cv2
import numpy as np

from burg_drake.printout import (
    FIXED_TINT_COLOR,
    MIN_LUMA,
    TINT_COLORS,
    height_at,
    luma_at,
    tint_colors,
)


def test_grey_is_the_luma_for_every_hue() -> None:
    luma = np.linspace(MIN_LUMA, 1.0, 50)
    for hue in (*TINT_COLORS, FIXED_TINT_COLOR):
        colors = tint_colors(hue, luma)
        assert colors.min() >= 0.0 and colors.max() <= 1.0
        grey = cv2.cvtColor(colors[None].astype(np.float32), cv2.COLOR_RGB2GRAY)[0]
        np.testing.assert_allclose(grey, luma, atol=1e-5)
        dark = tint_colors(hue, 0.1)
        assert dark.min() >= 0.0 and abs(dark @ [0.299, 0.587, 0.114] - 0.1) < 1e-12


def test_darker_is_closer_to_the_sheet() -> None:
    heights = np.linspace(0.0, 0.1, 100)
    assert (np.diff(luma_at(heights)) > 0.0).all()
    np.testing.assert_allclose(height_at(luma_at(heights)), heights, atol=1e-12)
    assert luma_at(-0.001) == luma_at(0.0) == MIN_LUMA
    assert luma_at(0.5) == luma_at(np.inf) < 1.0


COLOR_VISION = {
    "all cones": np.eye(3),
    "no red cones": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "no green cones": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "no blue cones": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
"""Linear RGB as it is seen: Machado, Oliveira and Fernandes, "A Physiologically-based Model for
Simulation of Color Vision Deficiency" (2009), at severity 1."""


def test_hues_differ_for_every_kind_of_color_vision() -> None:
    """By 5 in CIELAB where tints are light, and 10 where they are dark; 2.3 can be noticed."""
    for luma, least in ((0.72, 10.0), (0.85, 5.0)):
        colors = np.array([tint_colors(hue, luma) for hue in TINT_COLORS])
        linear = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
        for vision, seen in COLOR_VISION.items():
            rgb = np.clip(linear @ seen.T, 0.0, 1.0)
            encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055)
            lab = cv2.cvtColor(encoded[None].astype(np.float32), cv2.COLOR_RGB2LAB)[0]
            for a, b in itertools.combinations(range(len(TINT_COLORS)), 2):
                assert np.linalg.norm(lab[a] - lab[b]) > least, (vision, luma, a, b)
