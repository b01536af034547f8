"""Balls in a row, among which bodies come and go: overlaps by closed form."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform

from burg_drake.station import CollisionWorld, PosedShapes

RADII = {"pea": 0.01, "egg": 0.02}
FLOOR = {"floor": ((RigidTransform([0.0, 0.0, -0.5]), Box(4.0, 4.0, 1.0)),)}


@pytest.fixture
def asked() -> list[str]:
    """Kinds whose shapes were asked for."""
    return []


@pytest.fixture
def world(asked: list[str]) -> CollisionWorld:
    """With room for three bodies."""

    def shapes(kind: str) -> PosedShapes:
        asked.append(kind)
        return ((RigidTransform(), Sphere(RADII[kind])),)

    return CollisionWorld(FLOOR, shapes, slots=3)


def put(world: CollisionWorld, **bodies: tuple[str, float, float]) -> None:
    """Kind, x and z of each."""
    world.place({n: (kind, RigidTransform([x, 0.0, z])) for n, (kind, x, z) in bodies.items()})


def test_bodies_come_go_and_change(world: CollisionWorld, asked: list[str]) -> None:
    put(world, a=("pea", 0.0, 0.1), b=("egg", 0.025, 0.1))
    assert world.overlaps() == ({("a", "b"): pytest.approx(0.005)}, {})
    put(world, b=("egg", 0.025, 0.1), a=("pea", 0.0, 0.1))
    assert world.overlaps() == ({("b", "a"): pytest.approx(0.005)}, {})
    put(world, b=("egg", 0.025, 0.015))
    assert world.overlaps() == ({}, {("b", "floor"): pytest.approx(0.005)})
    put(world, a=("egg", 0.0, 0.1), b=("pea", 0.025, 0.1))
    assert world.overlaps() == ({("a", "b"): pytest.approx(0.005)}, {})
    put(world)
    assert world.overlaps() == ({}, {})
    assert asked == ["pea", "egg"]


def test_there_is_room_for_any_number(world: CollisionWorld, asked: list[str]) -> None:
    rng = np.random.default_rng(2)
    for count in (2, 5, 1, 20, 3, 60, 0, 4):
        kinds = rng.choice(list(RADII), count)
        xs = 0.031 * np.arange(count)
        put(world, **{f"b{i}": (str(kinds[i]), xs[i], 0.1) for i in range(count)})
        expected = {
            (f"b{i}", f"b{i + 1}"): pytest.approx(0.009)
            for i in range(count - 1)
            if kinds[i] == kinds[i + 1] == "egg"
        }
        assert world.overlaps() == (expected, {})
    assert sorted(asked) == ["egg", "pea"]
