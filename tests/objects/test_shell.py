"""Hollow bodies against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects import solid_of_shell

BOX = (0.1, 0.06, 0.03)


@pytest.mark.parametrize("subdivisions", [0, 3])
def test_a_box_minus_the_box_inside_it(subdivisions: int) -> None:
    t = 0.002
    box = trimesh.creation.box(BOX)
    for _ in range(subdivisions):
        box = box.subdivide()
    solid = solid_of_shell(box.apply_translation([0.3, 0.2, 0.1]), t)
    outer, inner = np.array(BOX), np.array(BOX) - 2.0 * t
    volume = outer.prod() - inner.prod()
    assert solid.volume == pytest.approx(volume, rel=1e-9)
    np.testing.assert_allclose(solid.p_OOcm, [0.3, 0.2, 0.1], atol=1e-12)
    squares = (outer.prod() * outer**2 - inner.prod() * inner**2) / 12.0
    expected = (squares.sum() - squares) / volume
    np.testing.assert_allclose(solid.G_OOcm, np.diag(expected), rtol=1e-8, atol=1e-14)


def test_a_hollow_sphere() -> None:
    r, t = 0.05, 0.003
    solid = solid_of_shell(trimesh.creation.icosphere(subdivisions=5, radius=r), t)
    inner = r - t
    assert solid.volume == pytest.approx(4.0 / 3.0 * np.pi * (r**3 - inner**3), rel=1e-3)
    expected = 0.4 * (r**5 - inner**5) / (r**3 - inner**3)
    np.testing.assert_allclose(np.diag(solid.G_OOcm), expected, rtol=1e-3)


def test_a_can_has_walls_and_lids() -> None:
    r, h, t = 0.03, 0.1, 0.001
    solid = solid_of_shell(trimesh.creation.cylinder(r, h, sections=200), t)
    expected = np.pi * (r**2 * h - (r - t) ** 2 * (h - 2.0 * t))
    assert solid.volume == pytest.approx(expected, rel=2e-3)


def test_a_hollow_thing_with_a_notch() -> None:
    """An L of 20 x 20 mm arms, whose inner corner is concave: its inner side is an L again."""
    outline = np.array([[0, 0], [60, 0], [60, 20], [20, 20], [20, 60], [0, 60]]) * 1e-3
    corners = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    ell = trimesh.creation.extrude_triangulation(outline, corners, 0.03)
    t = 0.002
    area, inner = 60 * 20 + 20 * 40, 56 * 16 + 16 * 40
    expected = area * 1e-6 * 0.03 - inner * 1e-6 * (0.03 - 2.0 * t)
    assert solid_of_shell(ell, t).volume == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("t", [0.0151, 0.02, 0.2])
def test_walls_thicker_than_the_body_allows(t: float) -> None:
    with pytest.raises(InvalidInputError) as caught:
        solid_of_shell(trimesh.creation.box(BOX).subdivide(), t)
    assert str(caught.value) == (
        f"wall_thickness is {1000.0 * t:.3g} mm, which is too much for this body; give"
        " less than 15 mm, or leave it out for a solid body"
    )


def test_a_plate_has_no_room_though_nothing_folds() -> None:
    plate = trimesh.creation.box((0.2, 0.2, 0.001)).subdivide().subdivide()
    with pytest.raises(InvalidInputError, match=r"give less than 0\.5 mm"):
        solid_of_shell(plate, 0.002)


@pytest.mark.parametrize("t", [0.0, -0.001, float("nan"), float("inf")])
def test_walls_that_are_none(t: float) -> None:
    with pytest.raises(InvalidInputError, match=r"wall_thickness is .* m; it must be above 0"):
        solid_of_shell(trimesh.creation.box(BOX), t)
