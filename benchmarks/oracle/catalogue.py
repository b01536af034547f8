"""The objects, by name: shapes, resting poses, and which of them are held out.

Contact geometry of the engine may be tuned on the objects of TUNED; those of HELD_OUT are for the
question of whether it was tuned on these alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .arrays import Array, pose, rotation
from .blocks import blocks
from .lathe import arc, bent, hexagonal, lathe, line, polyline, stretched
from .solid import FALLEN, LYING, UPRIGHT, MassProperties, Solid, mass_properties
from .strangers import STRANGERS

SPACING = 5e-4
"""Of samples that pads may touch [m]."""
FEET = 1.5e-3
"""Of samples that the table may touch [m]."""

TUNED = ("box", "bar", "can", "ball", "dumbbell", "bowl", "mug", "u", "torus")
HELD_OUT = (
    "ellipsoid", "frustum", "capsule", "banana", "l_bracket", "hammer", "wine_glass", "nut",
    "bottle",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Thing:
    """An object.

    Attributes:
        solid: with samples for pads.
        feet: with coarser ones.
        mass_properties: of unit mass.
        poses: rotations (3, 3) in which it rests on a plane.
    """

    solid: Solid
    feet: Solid
    mass_properties: MassProperties
    poses: tuple[Array, ...]

    def X_WO(self, number: int) -> Array:
        """(4, 4) where it rests in one of its poses; the table is the plane z = 0."""
        R = self.poses[number]
        return pose(R, np.array((0.0, 0.0, -self.solid.turned(R).lowest)))


@lru_cache(maxsize=8)
def thing(name: str, spacing: float = SPACING) -> Thing:
    """An object by its name.

    Args:
        name: of TUNED, HELD_OUT or STRANGERS.
        spacing: of the samples for pads [m].
    """
    make, poses = (SHAPES | STRANGERS)[name]
    solid = make(spacing)
    return Thing(solid, make(FEET), mass_properties(solid), poses)


def box(spacing: float) -> Solid:
    """A carton."""
    return blocks([((-0.03, -0.045, -0.04), (0.03, 0.045, 0.04))], spacing)


def bar(spacing: float) -> Solid:
    """A long bar along y."""
    return blocks([((-0.015, -0.12, -0.02), (0.015, 0.12, 0.02))], spacing)


def can(spacing: float) -> Solid:
    """A cylinder."""
    return lathe(polyline((0.0, -0.05), (0.032, -0.05), (0.032, 0.05), (0.0, 0.05)), spacing)


def ball(spacing: float) -> Solid:
    """A ball."""
    return lathe([arc((0.0, 0.0), 0.033, -90.0, 90.0)], spacing)


def dumbbell(spacing: float) -> Solid:
    """Two discs on a thinner rod."""
    return lathe(
        polyline(
            (0.0, -0.07), (0.03, -0.07), (0.03, -0.045), (0.012, -0.045),
            (0.012, 0.045), (0.03, 0.045), (0.03, 0.07), (0.0, 0.07),
        ),
        spacing,
    )  # fmt: skip


def bowl(spacing: float) -> Solid:
    """A thick spherical shell, open at the top, with its foot cut flat."""
    outer, inner = 0.06, 0.054
    foot = float(np.rad2deg(np.arccos(0.02 / outer)))
    z_foot = -float(np.sqrt(outer**2 - 0.02**2))
    return lathe(
        [
            line((0.0, z_foot), (0.02, z_foot)),
            arc((0.0, 0.0), outer, -foot, 0.0),
            line((outer, 0.0), (inner, 0.0)),
            arc((0.0, 0.0), inner, 0.0, -90.0),
        ],
        spacing,
    )


def mug(spacing: float) -> Solid:
    """A hollow cylinder with half a ring as its handle."""
    radius, wall, height, ring, thickness = 0.036, 0.004, 0.09, 0.026, 0.006
    cup = lathe(
        polyline(
            (0.0, 0.0), (radius, 0.0), (radius, height), (radius - wall, height),
            (radius - wall, wall), (0.0, wall),
        ),
        spacing,
    )  # fmt: skip
    length = np.pi * ring
    # Bent towards -x and turned over, the rod begins at its lower end; its ends are in the wall.
    rod = lathe(
        polyline(
            (0.0, -0.002), (thickness, -0.002), (thickness, length + 0.002), (0.0, length + 0.002)
        ),
        spacing,
    )
    R = rotation((0.0, 1.0, 0.0), np.pi / 2)
    start = (radius - wall / 2, 0.0, height / 2 + ring)
    handle = bent(rod, ring, length).turned(R, start)

    def in_cup(points: Array) -> Array:
        r = np.hypot(points[:, 0], points[:, 1])
        return (r < radius) & (points[:, 2] > 0.0) & (points[:, 2] < height)

    def in_handle(points: Array) -> Array:
        x, y, z = (points - (radius - wall / 2, 0.0, height / 2)).T
        return (x > -0.002) & (np.hypot(np.hypot(np.maximum(x, 0.0), z) - ring, y) < thickness)

    return cup.without(in_handle).with_(handle.without(in_cup))


def u(spacing: float) -> Solid:
    """A U, open upwards."""
    return blocks(
        [
            ((-0.05, -0.02, -0.04), (0.05, 0.02, -0.015)),
            ((-0.05, -0.02, -0.04), (-0.025, 0.02, 0.04)),
            ((0.025, -0.02, -0.04), (0.05, 0.02, 0.04)),
        ],
        spacing,
    )


def torus(spacing: float) -> Solid:
    """A ring."""
    return lathe([arc((0.045, 0.0), 0.015, -180.0, 180.0)], spacing)


def ellipsoid(spacing: float) -> Solid:
    """A pebble: three different axes."""
    return stretched(lathe([arc((0.0, 0.0), 0.03, -90.0, 90.0)], spacing), (1.0, 1.5, 0.8))


def frustum(spacing: float) -> Solid:
    """A cone without its tip: flanks at 8.5 degrees."""
    return lathe(polyline((0.0, -0.05), (0.036, -0.05), (0.021, 0.05), (0.0, 0.05)), spacing)


def capsule(spacing: float) -> Solid:
    """A rod with round ends."""
    return lathe(
        [
            arc((0.0, -0.05), 0.02, -90.0, 0.0),
            line((0.02, -0.05), (0.02, 0.05)),
            arc((0.0, 0.05), 0.02, 0.0, 90.0),
        ],
        spacing,
    )


def banana(spacing: float) -> Solid:
    """A capsule bent by 90 degrees in the plane of x and z."""
    length, radius = 0.13, 0.016
    rod = lathe(
        [
            arc((0.0, 0.0), radius, -90.0, 0.0),
            line((radius, 0.0), (radius, length)),
            arc((0.0, length), radius, 0.0, 90.0),
        ],
        spacing,
    )
    return bent(rod, length / (np.pi / 2), length)


def l_bracket(spacing: float) -> Solid:
    """An L: a foot along +x and a wall along +z."""
    return blocks(
        [((0.0, -0.02, 0.0), (0.09, 0.02, 0.02)), ((0.0, -0.02, 0.0), (0.02, 0.02, 0.07))], spacing
    )


def hammer(spacing: float) -> Solid:
    """A handle along y and a head across, as thick as the handle."""
    return blocks(
        [
            ((-0.045, 0.0, -0.015), (0.045, 0.03, 0.015)),
            ((-0.01, -0.15, -0.015), (0.01, 0.0, 0.015)),
        ],
        spacing,
    )


def wine_glass(spacing: float) -> Solid:
    """A solid goblet: foot, stem and an egg-shaped head."""
    return lathe(
        [
            *polyline((0.0, -0.07), (0.03, -0.07), (0.03, -0.064), (0.008, -0.056), (0.008, 0.0)),
            line((0.008, 0.0), (0.026, 0.025)),
            arc((0.0, 0.04), float(np.hypot(0.026, 0.015)), -29.98, 50.0),
            line(_top(50.0), (0.0, _top(50.0)[1])),
        ],
        spacing,
    )


def _top(angle: float) -> tuple[float, float]:
    radius = float(np.hypot(0.026, 0.015))
    return radius * float(np.cos(np.deg2rad(angle))), 0.04 + radius * float(
        np.sin(np.deg2rad(angle))
    )


def nut(spacing: float) -> Solid:
    """A hexagonal nut: 60 mm across flats."""
    ring = lathe(
        polyline(
            (0.015, -0.0125), (0.03, -0.0125), (0.03, 0.0125), (0.015, 0.0125), (0.015, -0.0125)
        ),
        spacing,
    )
    return hexagonal(ring, 0.015, 0.03)


def bottle(spacing: float) -> Solid:
    """A bottle: a body, a sloping shoulder and a neck."""
    return lathe(
        polyline(
            (0.0, -0.08), (0.033, -0.08), (0.033, 0.015), (0.013, 0.05), (0.013, 0.08), (0.0, 0.08)
        ),
        spacing,
    )


SHAPES: dict[str, tuple[Callable[[float], Solid], tuple[Array, ...]]] = {
    "box": (box, (UPRIGHT, FALLEN)),
    "bar": (bar, (UPRIGHT, FALLEN)),
    "can": (can, (UPRIGHT, LYING)),
    "ball": (ball, (UPRIGHT,)),
    "dumbbell": (dumbbell, (UPRIGHT, LYING)),
    "bowl": (bowl, (UPRIGHT,)),
    "mug": (mug, (UPRIGHT,)),
    "u": (u, (UPRIGHT, LYING)),
    "torus": (torus, (UPRIGHT,)),
    "ellipsoid": (ellipsoid, (UPRIGHT,)),
    "frustum": (frustum, (UPRIGHT,)),
    "capsule": (capsule, (LYING,)),
    "banana": (banana, (LYING,)),
    "l_bracket": (l_bracket, (UPRIGHT, LYING)),
    "hammer": (hammer, (UPRIGHT,)),
    "wine_glass": (wine_glass, (UPRIGHT,)),
    "nut": (nut, (UPRIGHT,)),
    "bottle": (bottle, (UPRIGHT, LYING)),
}
