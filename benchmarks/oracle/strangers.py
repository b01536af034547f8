"""Sixty objects of ten kinds that no engine was tuned on, six of each kind, by name.

Every second object is held out: what is fitted, as the calibration of confidence, is fitted on the
others alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .arrays import Array, rotation
from .blocks import Box, blocks
from .lathe import Curve, arc, bent, lathe, line, polyline, stretched
from .solid import FALLEN, LYING, UPRIGHT, Solid

Make = Callable[[float], Solid]

STANDING = rotation((1.0, 0.0, 0.0), -np.pi / 2)
EGG_AT_REST = rotation((1.0, 0.0, 0.0), np.pi / 2 + 0.15)
"""Where the centre of mass of an egg is lowest: its blunt end is heavier."""
UPSIDE_DOWN = rotation((1.0, 0.0, 0.0), np.pi)


def cuboid(spacing: float, size: tuple[float, float, float]) -> Solid:
    """A box of a size [m]."""
    half = tuple(s / 2 for s in size)
    return blocks([((-half[0], -half[1], -half[2]), (half[0], half[1], half[2]))], spacing)


def joined(spacing: float, boxes: tuple[Box, ...]) -> Solid:
    """A union of boxes [m]."""
    return blocks(boxes, spacing)


def turned(spacing: float, points: tuple[tuple[float, float], ...]) -> Solid:
    """A solid of revolution through points (radius, height) [m]."""
    return lathe(polyline(*points), spacing)


def cylinder(spacing: float, radius: float, height: float) -> Solid:
    """A cylinder [m]."""
    h = height / 2
    return turned(spacing, ((0.0, -h), (radius, -h), (radius, h), (0.0, h)))


def tube(spacing: float, inner: float, outer: float, height: float) -> Solid:
    """A tube, or a washer [m]."""
    h = height / 2
    return turned(spacing, ((inner, -h), (outer, -h), (outer, h), (inner, h), (inner, -h)))


def ball(spacing: float, axes: tuple[float, float, float]) -> Solid:
    """A ball or an ellipsoid, by its half axes [m]."""
    unit = 0.03
    factors = (axes[0] / unit, axes[1] / unit, axes[2] / unit)
    # What is stretched gets fewer samples.
    found = lathe([arc((0.0, 0.0), unit, -90.0, 90.0)], spacing / max(1.0, *factors))
    return stretched(found, factors)


def egg(spacing: float, radius: float, pointed: float) -> Solid:
    """An egg: an ellipse along z, narrower where z > 0 [m]."""
    long = 1.35 * radius

    def profile(t: Array) -> tuple[Array, Array]:
        angle = np.pi * (t - 0.5)
        return radius * np.cos(angle) * (1.0 - pointed * np.sin(angle)), long * np.sin(angle)

    return lathe([profile], spacing)


def rounded_cube(spacing: float, half: float, power: float) -> Solid:
    """A cube with round edges: |x|^p + |y|^p + |z|^p = half^p [m]."""

    def mapping(points: Array) -> Array:
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        out: Array = half * unit / ((np.abs(unit) ** power).sum(axis=1) ** (1.0 / power))[:, None]
        return out

    widest = half * 3.0 ** (0.5 - 1.0 / power)
    return lathe([arc((0.0, 0.0), half, -90.0, 90.0)], spacing * half / widest).mapped(mapping)


def torus(spacing: float, ring: float, thickness: float) -> Solid:
    """A ring of a radius, as thick as twice the other [m]."""
    return lathe([arc((ring, 0.0), thickness, -180.0, 180.0)], spacing)


def bowl(spacing: float, outer: float, wall: float) -> Solid:
    """Half a spherical shell, its foot cut flat [m]."""
    inner, foot = outer - wall, outer / 3.0
    angle, z_foot = float(np.rad2deg(np.arccos(foot / outer))), -float(np.sqrt(outer**2 - foot**2))
    floor = z_foot + wall
    profile: list[Curve] = [
        line((0.0, z_foot), (foot, z_foot)),
        arc((0.0, 0.0), outer, -angle, 0.0),
        line((outer, 0.0), (inner, 0.0)),
        arc((0.0, 0.0), inner, 0.0, float(np.rad2deg(np.arcsin(floor / inner)))),
        line((float(np.sqrt(inner**2 - floor**2)), floor), (0.0, floor)),
    ]
    return lathe(profile, spacing)


def cup(spacing: float, radii: tuple[float, float], wall: float, height: float) -> Solid:
    """A cup, wider or narrower at the top than at the bottom [m]."""
    bottom, top = radii
    return turned(
        spacing,
        ((0.0, 0.0), (bottom, 0.0), (top, height), (top - wall, height), (bottom - wall, wall),
         (0.0, wall)),
    )  # fmt: skip


def rod(spacing: float, radius: float, length: float, bend: float) -> Solid:
    """A round rod or wire from z = 0, with round ends, bent by an angle [rad, m]."""
    straight = lathe(
        [
            arc((0.0, 0.0), radius, -90.0, 0.0),
            line((radius, 0.0), (radius, length)),
            arc((0.0, length), radius, 0.0, 90.0),
        ],
        spacing,
    )
    return bent(straight, length / bend, length) if bend else straight


def bail(spacing: float, base: tuple[float, float, float], wire: float, ring: float) -> Solid:
    """A box under half a ring of wire, as a weight with a handle [m]."""
    length, x, y, z = np.pi * ring, *(s / 2 for s in base)
    block = cuboid(spacing, base).turned(UPRIGHT, (ring, 0.0, -z))
    ends = 0.002  # They are in the box.
    straight = ((0.0, -ends), (wire, -ends), (wire, length + ends), (0.0, length + ends))
    arch = bent(turned(spacing, straight), ring, length)

    def in_block(points: Array) -> Array:
        inside: Array = (np.abs(points - (ring, 0.0, -z)) < (x, y, z)).all(axis=1)
        return inside

    def in_arch(points: Array) -> Array:
        px, py, pz = points.T
        from_ring = np.hypot(px - ring, np.maximum(pz, 0.0)) - ring
        inside: Array = (pz > -ends) & (np.hypot(from_ring, py) < wire)
        return inside

    return block.without(in_arch).with_(arch.without(in_block))


def spoon(spacing: float, head: float, length: float) -> Solid:
    """A flat ellipsoid on a rod along z, both of one thickness [m]."""
    handle = 0.35 * head
    axes = (handle, head, 1.4 * head)
    low = axes[2] - 0.01  # The rod begins in the head.
    high = low + length
    stem = cylinder(spacing, handle, length).turned(UPRIGHT, (0.0, 0.0, (low + high) / 2))

    def in_head(points: Array) -> Array:
        inside: Array = ((points / np.array(axes)) ** 2).sum(axis=1) < 1.0
        return inside

    def in_stem(points: Array) -> Array:
        x, y, z = points.T
        inside: Array = (np.hypot(x, y) < handle) & (z > low) & (z < high)
        return inside

    return ball(spacing, axes).without(in_stem).with_(stem.without(in_head))


def hammer(spacing: float, handle: tuple[float, float], head: tuple[float, float, float]) -> Solid:
    """A handle along y, of a width and a length, and a head across it [m]."""
    w, length = handle
    x, y, z = head
    return blocks(
        [
            ((-x / 2, 0.0, -z / 2), (x / 2, y, z / 2)),
            ((-w / 2, -length, -w / 2), (w / 2, 0.0, w / 2)),
        ],
        spacing,
    )


def tee(spacing: float, width: float, height: float, thick: float, deep: float) -> Solid:
    """A T upside down: a foot along x and a wall along z [m]."""
    w, t, d = width / 2, thick / 2, deep / 2
    return blocks([((-w, -d, 0.0), (w, d, thick)), ((-t, -d, 0.0), (t, d, height))], spacing)


KINDS: dict[str, tuple[tuple[str, Make, tuple[Array, ...]], ...]] = {
    "box": (
        ("brick", partial(cuboid, size=(0.05, 0.10, 0.04)), (UPRIGHT, FALLEN)),
        ("carton", partial(cuboid, size=(0.065, 0.04, 0.14)), (UPRIGHT, LYING)),
        ("dice", partial(cuboid, size=(0.022, 0.022, 0.022)), (UPRIGHT,)),
        ("soap", partial(cuboid, size=(0.06, 0.035, 0.025)), (UPRIGHT,)),
        ("slab", partial(cuboid, size=(0.055, 0.12, 0.055)), (UPRIGHT,)),
        ("domino", partial(cuboid, size=(0.024, 0.048, 0.009)), (FALLEN,)),
    ),
    "plate": (
        ("card", partial(cuboid, size=(0.004, 0.086, 0.054)), (UPRIGHT,)),
        ("book", partial(cuboid, size=(0.018, 0.13, 0.10)), (UPRIGHT,)),
        ("disc", partial(cylinder, radius=0.05, height=0.008), (LYING,)),
        ("tile", partial(cuboid, size=(0.008, 0.10, 0.10)), (UPRIGHT,)),
        ("coin", partial(cylinder, radius=0.02, height=0.004), (LYING,)),
        ("ruler", partial(cuboid, size=(0.0035, 0.16, 0.035)), (UPRIGHT,)),
    ),
    "bar": (
        ("beam", partial(cuboid, size=(0.02, 0.20, 0.02)), (UPRIGHT,)),
        ("rod", partial(cylinder, radius=0.014, height=0.18), (LYING,)),
        ("post", partial(cuboid, size=(0.03, 0.03, 0.18)), (UPRIGHT, LYING)),
        ("marker", partial(cylinder, radius=0.013, height=0.15), (LYING,)),
        ("batten", partial(cuboid, size=(0.012, 0.22, 0.035)), (UPRIGHT, FALLEN)),
        ("candle", partial(cylinder, radius=0.015, height=0.12), (UPRIGHT, LYING)),
    ),
    "cylinder": (
        ("jar", partial(cylinder, radius=0.034, height=0.08), (UPRIGHT, LYING)),
        ("tin", partial(cylinder, radius=0.03, height=0.035), (UPRIGHT,)),
        ("drum", partial(cylinder, radius=0.022, height=0.10), (UPRIGHT, LYING)),
        ("puck", partial(cylinder, radius=0.035, height=0.025), (UPRIGHT,)),
        ("cork", partial(cylinder, radius=0.012, height=0.04), (UPRIGHT, LYING)),
        ("roll", partial(cylinder, radius=0.027, height=0.14), (UPRIGHT, LYING)),
    ),
    "ball": (
        ("marble", partial(ball, axes=(0.012, 0.012, 0.012)), (UPRIGHT,)),
        ("plum", partial(ball, axes=(0.024, 0.024, 0.028)), (LYING,)),
        ("egg", partial(egg, radius=0.022, pointed=0.15), (EGG_AT_REST,)),
        ("rounded_cube", partial(rounded_cube, half=0.026, power=6.0), (UPRIGHT,)),
        ("pebble", partial(ball, axes=(0.035, 0.026, 0.016)), (UPRIGHT,)),
        ("melon", partial(ball, axes=(0.032, 0.055, 0.032)), (UPRIGHT,)),
    ),
    "cone": (
        ("pylon", partial(turned, points=((0.0, 0.0), (0.035, 0.0), (0.022, 0.09), (0.0, 0.09))),
         (UPRIGHT,)),
        ("cone", partial(turned, points=((0.0, 0.0), (0.018, 0.0), (0.0, 0.12))), (UPRIGHT,)),
        ("pot", partial(turned, points=((0.0, 0.0), (0.026, 0.0), (0.036, 0.07), (0.0, 0.07))),
         (UPRIGHT, UPSIDE_DOWN)),
        ("spindle", partial(turned, points=((0.0, 0.0), (0.028, 0.0), (0.021, 0.05), (0.028, 0.10),
                                            (0.0, 0.10))), (UPRIGHT,)),
        ("top", partial(turned, points=((0.0, 0.0), (0.018, 0.0), (0.034, 0.03), (0.018, 0.06),
                                        (0.0, 0.06))), (UPRIGHT,)),
        ("wedge", partial(turned, points=((0.0, 0.0), (0.032, 0.0), (0.026, 0.11), (0.0, 0.11))),
         (UPRIGHT,)),
    ),
    "ring": (
        ("donut", partial(torus, ring=0.038, thickness=0.016), (UPRIGHT,)),
        ("bangle", partial(torus, ring=0.045, thickness=0.01), (UPRIGHT,)),
        ("washer", partial(tube, inner=0.012, outer=0.03, height=0.022), (UPRIGHT,)),
        ("pipe", partial(tube, inner=0.026, outer=0.03, height=0.09), (UPRIGHT, LYING)),
        ("collar", partial(tube, inner=0.02, outer=0.034, height=0.04), (UPRIGHT,)),
        ("tyre", partial(torus, ring=0.05, thickness=0.02), (UPRIGHT,)),
    ),
    "vessel": (
        ("thin_bowl", partial(bowl, outer=0.06, wall=0.002), (UPRIGHT,)),
        ("thick_bowl", partial(bowl, outer=0.05, wall=0.008), (UPRIGHT,)),
        ("cup", partial(cup, radii=(0.028, 0.036), wall=0.003, height=0.08),
         (UPRIGHT, UPSIDE_DOWN)),
        ("beaker", partial(cup, radii=(0.034, 0.034), wall=0.0022, height=0.09), (UPRIGHT,)),
        ("flask", partial(turned, points=((0.0, 0.0), (0.034, 0.0), (0.034, 0.02), (0.012, 0.07),
                                          (0.012, 0.10), (0.0, 0.10))), (UPRIGHT,)),
        ("goblet", partial(turned, points=((0.0, 0.0), (0.026, 0.0), (0.026, 0.005), (0.007, 0.012),
                                           (0.007, 0.06), (0.03, 0.085), (0.026, 0.12), (0.0, 0.12))
                           ), (UPRIGHT,)),
    ),
    "bracket": (
        ("angle", partial(joined, boxes=(((0.0, -0.015, 0.0), (0.07, 0.015, 0.012)),
                                         ((0.0, -0.015, 0.0), (0.012, 0.015, 0.09)))),
         (UPRIGHT, LYING)),
        ("tee", partial(tee, width=0.09, height=0.08, thick=0.02, deep=0.03), (UPRIGHT, LYING)),
        ("channel", partial(joined, boxes=(((-0.03, -0.05, 0.0), (0.03, 0.05, 0.008)),
                                           ((-0.03, -0.05, 0.0), (-0.022, 0.05, 0.05)),
                                           ((0.022, -0.05, 0.0), (0.03, 0.05, 0.05)))), (UPRIGHT,)),
        ("mallet", partial(hammer, handle=(0.024, 0.14), head=(0.07, 0.04, 0.024)), (UPRIGHT,)),
        ("gavel", partial(hammer, handle=(0.014, 0.16), head=(0.05, 0.03, 0.03)), (STANDING,)),
        ("plus", partial(joined, boxes=(((-0.05, -0.012, 0.0), (0.05, 0.012, 0.024)),
                                        ((-0.012, -0.05, 0.0), (0.012, 0.05, 0.024)))), (UPRIGHT,)),
    ),
    "bent": (
        ("wire", partial(bail, base=(0.075, 0.04, 0.03), wire=0.002, ring=0.03), (UPRIGHT,)),
        ("handle", partial(bail, base=(0.09, 0.035, 0.04), wire=0.004, ring=0.035), (UPRIGHT,)),
        ("sausage", partial(rod, radius=0.014, length=0.12, bend=1.0), (LYING,)),
        ("spoon", partial(spoon, head=0.034, length=0.11), (FALLEN,)),
        ("ladle", partial(spoon, head=0.04, length=0.15), (FALLEN,)),
        ("hook", partial(rod, radius=0.012, length=0.16, bend=2.6), (LYING,)),
    ),
}  # fmt: skip
"""Names, shapes and resting poses by kind."""

STRANGERS: dict[str, tuple[Make, tuple[Array, ...]]] = {
    name: (make, poses) for rows in KINDS.values() for name, make, poses in rows
}
KIND_OF = {name: kind for kind, rows in KINDS.items() for name, _, _ in rows}
HELD_OUT_STRANGERS = tuple(name for rows in KINDS.values() for name, _, _ in rows[1::2])
