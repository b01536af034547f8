"""Heights, passes and level paths of the landscape against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array
from burg_drake.objects import PotentialLandscape

X, Y, Z = np.eye(3)
SIZE = np.array([0.1, 0.08, 0.06])


def around(axis: Array, start: Array, angle: float) -> Array:
    """`start` (3,) turned about a perpendicular `axis` (3,)."""
    return np.cos(angle) * start + np.sin(angle) * np.cross(axis, start)


def test_height_is_the_support_function() -> None:
    box = PotentialLandscape(
        np.asarray(trimesh.creation.box(SIZE).vertices), np.array([0.0, 0.0, 0.01])
    )
    assert box.height(Z) == pytest.approx(0.02)
    np.testing.assert_allclose(box.height(np.stack([-Z, X])), [0.04, 0.05])
    tilted = around(X, -Z, 0.2)  # over the lower edge at y = +-0.04
    assert box.height(tilted) == pytest.approx(0.04 * np.cos(0.2) + 0.04 * np.sin(0.2))


def test_every_direction_leads_to_the_face_below() -> None:
    box = PotentialLandscape(np.asarray(trimesh.creation.box(SIZE).vertices), np.zeros(3))
    np.testing.assert_allclose(box.minimum_below(around(X, -Z, 0.3)), -Z, atol=1e-12)
    np.testing.assert_allclose(box.minimum_below(around(X, -Y, 0.1)), -Y, atol=1e-12)


def test_a_cylinder_rolls_on_its_side_only() -> None:
    points = np.asarray(trimesh.creation.cylinder(0.03, 0.1, sections=48).vertices)
    cylinder = PotentialLandscape(points, np.zeros(3))
    lying = cylinder.neutral_equilibrium(X)
    assert lying.max_angle == pytest.approx(np.pi, abs=0.2)
    for turn in np.linspace(0.0, 6.0, 13):
        rolled = np.array([np.cos(turn), np.sin(turn), 0.0])
        assert lying.angle(rolled) == pytest.approx(0.0, abs=1e-6)
        lifted = np.cos(0.1) * rolled + np.sin(0.1) * Z
        assert lying.angle(lifted) == pytest.approx(0.1, abs=1e-3)
    assert cylinder.neutral_equilibrium(Z).max_angle < np.deg2rad(1.0)


def test_a_sphere_is_level_everywhere() -> None:
    sphere = PotentialLandscape(
        np.asarray(trimesh.creation.icosphere(3, 0.02).vertices), np.zeros(3)
    )
    level = sphere.neutral_equilibrium(Z)
    rng = np.random.default_rng(0)
    for down in rng.normal(size=(20, 3)):
        assert level.angle(down / np.linalg.norm(down)) == 0.0


def test_a_prism_of_few_sides_does_not_roll() -> None:
    """Between the sides of a prism with n of them the centre rises by 1 / cos(pi / n)."""
    for sections, rolls in ((6, False), (12, False), (17, False), (19, True), (48, True)):
        points = np.asarray(trimesh.creation.cylinder(0.03, 0.1, sections=sections).vertices)
        side = np.array([np.cos(np.pi / sections), np.sin(np.pi / sections), 0.0])
        assert PotentialLandscape(points, np.zeros(3)).rolls(side) is rolls, sections


def test_a_half_ball_rocks_but_does_not_roll() -> None:
    ball = trimesh.creation.icosphere(4, 0.04)
    half = np.asarray(ball.vertices[ball.vertices[:, 2] < 1e-9])
    assert not PotentialLandscape(half, np.array([0.0, 0.0, -0.015])).rolls(-Z)
