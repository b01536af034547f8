"""The map rises evenly in lightness, for colour-blind eyes too, and is what was published."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.visualization import VIRIDIS_COLORS, hex_color, linear_light, map_colors

# Linear RGB to what dichromats see: Machado, Oliveira, Fernandes, "A Physiologically-based Model
# for Simulation of Color Vision Deficiency" (2009), severity 1.0.
VISION = {
    "normal": np.eye(3),
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanope": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(srgb: np.ndarray, vision: str = "normal") -> np.ndarray:
    """CIE L*a*b* (D65, CIE 15) of sRGB colours (N, 3), by its own way to linear light."""
    light = np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)
    light = np.clip(light @ np.array(VISION[vision]).T, 0.0, 1.0)
    xyz = (
        light
        @ np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]).T
        / (0.9505, 1.0, 1.089)
    )
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=-1
    )


def test_lightness_of_known_colors() -> None:
    """The oracle itself: black, white, and middle grey of L* 53.585."""
    grey = np.array([[0.0] * 3, [1.0] * 3, [128 / 255] * 3])
    assert lab(grey)[:, 0] == pytest.approx([0.0, 100.0, 53.585], abs=0.02)


def test_lightness_rises_evenly() -> None:
    lightness = lab(map_colors(np.linspace(0.0, 1.0, 257)))[:, 0]
    step = np.diff(lightness)
    assert (step > 0.0).all()
    assert lightness[-1] - lightness[0] > 70.0
    straight = np.linspace(lightness[0], lightness[-1], 257)
    assert np.abs(lightness - straight).max() < 3.0


@pytest.mark.parametrize("vision", VISION)
def test_steps_are_seen_by_all(vision: str) -> None:
    """Sixteen values stay apart, each pair the more the farther they are from each other."""
    seen = lab(map_colors(np.linspace(0.0, 1.0, 16)), vision)
    assert (np.diff(seen[:, 0]) > 2.3).all()  # just noticeable: Mahy et al. (1994)
    apart = np.linalg.norm(seen[:, None] - seen[None, :], axis=-1)
    k = np.arange(16)
    assert apart[np.abs(k[:, None] - k) >= 4].min() > 15.0


def test_ends_are_those_of_viridis() -> None:
    assert hex_color(map_colors(0.0)) == "#440154"
    assert hex_color(map_colors(1.0)) == "#fde725"
    assert hex_color(map_colors(1 / 3)) == "#31688e"  # entry 85 of 255
    middle = np.array([0.127568, 0.566949, 0.550556])  # entry 128
    assert map_colors(128 / 255) == pytest.approx(middle, abs=0.03)


def test_control_points_are_met_and_what_is_beyond_is_cut() -> None:
    n = len(VIRIDIS_COLORS)
    assert [hex_color(c) for c in map_colors(np.arange(n) / (n - 1))] == list(VIRIDIS_COLORS)
    assert map_colors([-5.0, np.inf]) == pytest.approx(map_colors([0.0, 1.0]))
    assert map_colors(np.zeros((2, 5))).shape == (2, 5, 3)


def test_linear_light() -> None:
    """Values of IEC 61966-2-1: its ends, its knee, and middle grey of 21.6 % light."""
    assert linear_light([0.0, 0.04045, 128 / 255, 1.0]) == pytest.approx(
        [0.0, 0.0031308, 0.21586, 1.0], abs=1e-5
    )
