"""Looks of the hand and of the left finger."""

from __future__ import annotations

from manifold3d import Manifold

from tools.robot_model.obj import Part
from tools.robot_model.solids import plate, rod, rounded_hull
from tools.robot_model.surface import part

FRONT = (
    (0.0935, -0.0085),
    (0.0990, 0.004),
    (0.1015, 0.030),
    (0.1015, 0.058),
    (0.0960, 0.066),
)
"""Outline of the hand (y, z) [m], right half."""


def hand_parts() -> list[Part]:
    """The hand: white shell, dark recess on both sides, rail for the fingers, flange."""
    window = [(-0.078, 0.012), (0.078, 0.012), (0.084, 0.047), (-0.084, 0.047)]
    recess = _shell(0.0004) ^ plate(window, (1, 2), -0.04, 0.04, corner=0.006)
    rail = [(-0.086, -0.0095), (0.086, -0.0095), (0.086, 0.0095), (-0.086, 0.0095)]
    mount = rod((0, 0, 0), (0, 0, 1), 0.0315, 0.007, bevel=0.001)
    return [
        part(_shell(0.0), "shell", tolerance=1e-5),
        part(recess, "dark"),
        part(plate(rail, (1, 0), 0.050, 0.0664, corner=0.004), "rubber"),
        part(mount, "metal"),
        part(rod((0, 0, -0.0015), (0, 0, 1), 0.0300, 0.002), "dark"),
    ]


def _shell(swell: float) -> Manifold:
    """The body, its sides moved outwards by `swell` [m]."""
    radius = 0.005
    corners = []
    for y, z in FRONT:
        inner_y = y - radius
        inner_z = min(max(z, -0.0085 + radius), 0.066 - radius)
        half = 0.0252 - 0.122 * inner_z - radius + swell
        corners += [(sx * half, sy * inner_y, inner_z) for sx in (1, -1) for sy in (1, -1)]
    return rounded_hull(corners, radius)


def finger_parts() -> list[Part]:
    """The left finger: sledge, bent finger, rubber tip with its face at y = 0."""
    sledge = [(0.0024, 0.0003), (0.026, 0.0003), (0.026, 0.0041), (0.0024, 0.0041)]
    bent = [(0.0108, 0.002), (0.0258, 0.002), (0.0258, 0.0195), (0.0160, 0.0365)]
    bent += [(0.0150, 0.0520), (0.0130, 0.0540), (0.0070, 0.0540), (0.0070, 0.0362)]
    bent += [(0.0088, 0.0362), (0.0175, 0.0200), (0.0108, 0.0200)]
    bar = plate(bent, (1, 2), -0.0102, 0.0102)
    for side in (1.0, -1.0):
        bar = bar.trim_by_plane((-side, 0.0, -0.045), -0.0109)
    tip = [(0.0, 0.0362), (0.0084, 0.0362), (0.0084, 0.0543), (0.0016, 0.0543), (0.0, 0.0527)]
    tip += [(0.0, 0.0470), (0.0013, 0.0452), (0.0, 0.0434)]
    return [
        part(plate(sledge, (1, 2), -0.0108, 0.0108, bevel=0.0005), "dark", tolerance=1e-5),
        part(bar, "metal", tolerance=1e-5),
        part(plate(tip, (1, 2), -0.00875, 0.00875), "rubber", tolerance=1e-5),
    ]
