"""Tints: brightness tells the height, whatever the hue."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.printout.tints import DARKEST, FIXED_HUE, HUES, height_at, luma_at, tint


def test_grey_is_the_luma_for_every_hue() -> None:
    luma = np.linspace(DARKEST, 1.0, 50)
    for hue in (*HUES, FIXED_HUE):
        colors = tint(hue, luma)
        assert colors.min() >= 0.0 and colors.max() <= 1.0
        grey = cv2.cvtColor(colors[None].astype(np.float32), cv2.COLOR_RGB2GRAY)[0]
        np.testing.assert_allclose(grey, luma, atol=1e-5)
        dark = tint(hue, 0.1)
        assert dark.min() >= 0.0 and abs(dark @ [0.299, 0.587, 0.114] - 0.1) < 1e-12


def test_darker_is_closer_to_the_sheet() -> None:
    heights = np.linspace(0.0, 0.1, 100)
    assert (np.diff(luma_at(heights)) > 0.0).all()
    np.testing.assert_allclose(height_at(luma_at(heights)), heights, atol=1e-12)
    assert luma_at(-0.001) == luma_at(0.0) == DARKEST
    assert luma_at(0.5) == luma_at(np.inf) < 1.0
