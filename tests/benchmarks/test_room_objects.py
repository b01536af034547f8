"""Objects in the room of the benchmarks: image, shadow and light of a sphere are closed forms."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
import trimesh
from room.covers import nothing
from room.exposure import Surface, no_gloss, table
from room.lens import SMALL
from room.light import AROUND, Light, irradiance, map_of
from room.objects import Objects, Thing, arranged, light_left, photographed
from room.placed import KINDS, standing
from room.sheet import flat, texture_of
from room.views import look_at

SIZE = (0.40, 0.30)
RADIUS = 0.03
MIDDLE = np.array([0.2, 0.15, RADIUS])
GREY = 188
"""sRGB level of a reflectance of 0.5."""


@cache
def sphere() -> Objects:
    """One on the board's middle."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=[GREY, GREY, GREY, 255])
    X_SO = np.eye(4)
    X_SO[:3, 3] = MIDDLE
    return Objects([Thing(mesh, X_SO)])


def blank(light: Light) -> Surface:
    """White paper."""
    paper = texture_of(np.full((640, 640, 4), 255, np.uint8), 0.0, SIZE[1], 640 / SIZE[0])
    lit = map_of(irradiance(light, SIZE))
    return Surface(paper, flat(SIZE), table(np.random.default_rng(0)), lit, nothing(), no_gloss())


def rim(apex: np.ndarray) -> np.ndarray:
    """(N, 3) directions from a point along the cone that touches the sphere."""
    axis = MIDDLE - apex
    distance = np.linalg.norm(axis)
    axis /= distance
    half = np.arcsin(RADIUS / distance)
    a, b = np.linalg.svd(axis[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)[:, None]
    return np.cos(half) * axis + np.sin(half) * (np.cos(angle) * a + np.sin(angle) * b)


def area_and_centroid(p: np.ndarray) -> tuple[float, np.ndarray]:
    """Of a polygon (N, 2)."""
    origin = p.mean(axis=0)
    a, b = p - origin, np.roll(p - origin, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return abs(cross.sum()) / 2, origin + ((a + b) * cross[:, None]).sum(axis=0) / 3 / cross.sum()


def test_a_sphere_is_seen_in_the_cone_that_touches_it() -> None:
    X_SC = look_at(np.array([0.25, 0.12]), 0.5, np.radians(40), 0.7, 0.4)
    light = Light()
    seen = photographed(SMALL, X_SC, blank(light), light, sphere(), SIZE, np.random.default_rng(0))
    K = np.eye(3)
    K[[0, 1], [0, 1]], K[:2, 2] = SMALL.focal, SMALL.center
    along = rim(X_SC[:3, 3]) @ X_SC[:3, :3]
    outline, _ = cv2.projectPoints(along, np.zeros(3), np.zeros(3), K, np.array(SMALL.coefficients))
    area, centroid = area_and_centroid(outline.reshape(-1, 2))
    share = seen.share[..., 0]
    v, u = np.indices(share.shape)
    assert share.sum() == pytest.approx(area, rel=2e-3)
    found = np.array([(share * u).sum(), (share * v).sum()]) / share.sum()
    np.testing.assert_allclose(found, centroid, atol=0.02)


def test_its_shadow_is_the_cone_from_the_lamp() -> None:
    light = Light(ambient=0.0, lamp=(0.7, 0.4, 1.2))
    left = light_left(light, sphere(), SIZE, np.random.default_rng(0))
    lamp = np.array(light.lamp)
    along = rim(lamp)
    edge = lamp + along * (-lamp[2] / along[:, 2:])
    area, centroid = area_and_centroid(edge[:, :2])
    dark = left.values == 0.0
    row, column = np.nonzero(dark)
    found = np.stack([column, row], axis=-1).mean(axis=0) / left.per_metre - AROUND
    assert dark.sum() / left.per_metre**2 == pytest.approx(area, rel=0.01)
    np.testing.assert_allclose(found, centroid, atol=1e-4)


def test_a_soft_shadow_has_half_the_light_where_the_hard_one_ends() -> None:
    lamp = np.array([0.8, 0.15, 1.2])
    light = Light(ambient=0.0, lamp=tuple(lamp), radius=0.08)
    left = light_left(light, sphere(), SIZE, np.random.default_rng(0))
    bare = irradiance(Light(ambient=0.0, lamp=tuple(lamp)), SIZE)
    hard = lamp + rim(lamp) * (-lamp[2] / rim(lamp)[:, 2:])
    tip = hard[hard[:, 0].argmin(), 0]  # on the side away from the lamp, y of the sphere's middle
    slope = np.linalg.norm(lamp[:2] - [tip, 0.15]), lamp[2]
    away = np.hypot(tip - MIDDLE[0], MIDDLE[2])
    width = 2 * light.radius * away / np.hypot(*slope) / (slope[1] / np.hypot(*slope))

    def lit(x: float) -> float:
        row, column = round((0.15 + AROUND) * 1e3), round((x + AROUND) * 1e3)
        return left.values[row, column] / bare[2 * row, 2 * column]

    assert lit(tip) == pytest.approx(0.5, abs=0.15)
    assert lit(tip - 0.75 * width) == pytest.approx(1.0, abs=1e-3)
    assert lit(0.2) == 0.0
    values = [lit(x) for x in np.linspace(0.2, tip - width, 20)]
    assert (np.diff(values) > -0.02).all()


def test_its_top_has_the_light_of_lambert_and_of_the_sky() -> None:
    height, ambient = 1.0, 0.4
    light = Light(ambient=ambient, lamp=(0.2, 0.15, height))
    X_SC = look_at(MIDDLE[:2], 0.5, 0.0, 0.0, 0.0)
    seen = photographed(SMALL, X_SC, blank(light), light, sphere(), SIZE, np.random.default_rng(0))
    u, v = np.round(SMALL.center).astype(int)
    top = seen.radiance[v - 3 : v + 4, u - 3 : u + 4].mean()
    lamp = (1 - ambient) * (height / (height - 2 * RADIUS)) ** 2
    assert top == pytest.approx(0.5 * (ambient + lamp), rel=0.01)


def test_built_in_objects_stand_on_the_board() -> None:
    """Read from the documents themselves: nothing sinks in or hovers by more than a millimetre."""
    things = arranged("tabletop_six")
    assert set(things) == {"mug", "bottle", "box", "screwdriver", "bowl", "banana"}
    for thing in things.values():
        z = (thing.mesh.vertices @ thing.X_SO[:3, :3].T + thing.X_SO[:3, 3])[:, 2]
        assert abs(z.min()) < 1e-3


def middle(thing: Thing) -> np.ndarray:
    p = np.asarray(thing.mesh.vertices) @ thing.X_SO[:3, :3].T + thing.X_SO[:3, 3]
    return (p.min(axis=0) + p.max(axis=0))[:2] / 2


@pytest.mark.parametrize("kind", sorted(set(KINDS)))
def test_displaced_objects_are_near_their_places_but_for_the_odd_ones(kind: str) -> None:
    places = arranged("tabletop_six")
    things, odd, extra = standing(kind, np.random.default_rng(3))
    off = {
        name: float(np.linalg.norm(middle(thing) - middle(places[name])))
        for name, thing in things.items()
        if name in places
    }
    assert all(distance < 0.035 for name, distance in off.items() if name not in odd)
    assert max(off.values()) > 0.0
    assert len(odd) == {"missing": 1, "swapped": 2}.get(kind, 0)
    if kind == "missing":
        assert not set(odd) & set(things)
    if kind == "swapped":
        a, b = odd
        assert np.linalg.norm(middle(things[a]) - middle(places[b])) < 0.035
        assert np.linalg.norm(middle(things[b]) - middle(places[a])) < 0.035
    assert (extra is None) == (kind != "extra")
    for thing in things.values():
        p = np.asarray(thing.mesh.vertices) @ thing.X_SO[:3, :3].T + thing.X_SO[:3, 3]
        assert abs(p[:, 2].min()) < 1e-3
