"""Which corners carry an object, and which keep its shape where it rolls."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array
from burg_drake.objects import (
    ROLLING_TOLERANCE,
    SUPPORT_HEIGHT_TOLERANCE,
    carrying_corners,
    support_feet,
)

UP = np.array((0.0, 0.0, 1.0))
SETTLED = 1e-3
TOP = [[x, y, 0.1] for x in (-0.03, 0.03) for y in (-0.03, 0.03)]


def block(*heights: float) -> Array:
    """(8, 3) corners of a block: below at (-, -), (-, +), (+, -), (+, +), above all at 0.1 [m]."""
    corners = np.array(TOP + TOP)
    corners[:4, 2] = heights
    return corners


@pytest.mark.parametrize(
    ("heights", "x", "expected"),
    [
        ((0.0, 0.0, SUPPORT_HEIGHT_TOLERANCE / 2, SUPPORT_HEIGHT_TOLERANCE / 2), 0.0, [0, 1, 2, 3]),
        ((0.0, 0.0, 6e-4, 6e-4), 0.0, [0, 1, 2, 3]),  # on the left edge alone it would tip
        ((0.0, 0.0, 0.0, 6e-4), -0.01, [0, 1, 2]),  # over these three it stands
        ((0.0, 0.0, 0.0, 6e-4), 0.01, [0, 1, 2, 3]),  # to the right of their diagonal
        ((0.0, 0.0, 2e-3, 2e-3), 0.0, [0, 1]),  # the others are too high to have carried
        ((0.0, 0.0, 0.0, 0.0), 0.05, [0, 1, 2, 3]),  # it does not stand at all
    ],
)
def test_corners_carry_until_the_centre_of_mass_is_over_them(
    heights: tuple[float, ...], x: float, expected: list[int]
) -> None:
    center = np.array((x, 0.0, 0.05))
    found = carrying_corners(block(*heights), UP, center, SETTLED)
    assert sorted(found.tolist()) == expected


def test_what_carries_does_not_depend_on_where_an_object_points() -> None:
    corners, center = block(0.0, 0.0, 0.0, 6e-4), np.array((-0.01, 0.0, 0.05))
    for angle in (0.4, 1.9, 3.1):
        turn = trimesh.transformations.rotation_matrix(angle, (1.0, 2.0, 3.0))[:3, :3]
        found = carrying_corners(corners @ turn.T, turn @ UP, turn @ center, SETTLED)
        assert sorted(found.tolist()) == [0, 1, 2]


@pytest.mark.filterwarnings("error")
def test_what_rolls_on_a_point_keeps_its_shape_about_two_axes() -> None:
    """An egg, which has no line along which it touches the plane, but one corner or a few."""
    for subdivisions in (2, 4):
        egg = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.03)
        corners = np.asarray(egg.apply_scale((1.0, 1.0, 0.9)).vertices)
        feet = corners[support_feet(corners, [UP], [UP])]
        angle = np.linspace(0.0, 2.0 * np.pi, 720)
        headings = np.linspace(0.0, np.pi, 90, endpoint=False)
        worst = []
        for heading in headings:
            across = np.array((np.cos(heading), np.sin(heading), 0.0))
            circle = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * UP
            missing = (corners @ circle.T).max(axis=0) - (feet @ circle.T).max(axis=0)
            worst.append(missing.max() <= 1.5 * ROLLING_TOLERANCE)
        assert (np.array(worst) & np.roll(worst, 45)).any()  # a heading, and the one across it


def test_what_rolls_on_a_line_keeps_its_shape_about_it() -> None:
    can = trimesh.creation.cylinder(radius=0.03, height=0.1, sections=96)
    corners, up = np.asarray(can.vertices), np.array((1.0, 0.0, 0.0))
    feet = corners[support_feet(corners, [up], [up])]
    angle = np.linspace(0.0, 2.0 * np.pi, 720)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(720)], axis=1)
    missing = (corners @ circle.T).max(axis=0) - (feet @ circle.T).max(axis=0)
    assert missing.max() <= 1.5 * ROLLING_TOLERANCE
