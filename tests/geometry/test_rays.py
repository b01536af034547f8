from __future__ import annotations

import numpy as np
import pytest

from burg_drake.geometry import MAX_HITS, RayCaster


def plates(heights: np.ndarray) -> np.ndarray:
    """(2 n, 3, 3) unit squares at the given heights, two triangles each."""
    a, b, c, d = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    flat = np.array([[a, b, c], [a, c, d]])
    with_height = [np.concatenate([flat, np.full((2, 3, 1), z)], axis=-1) for z in heights]
    return np.concatenate(with_height)


def caster(triangles: np.ndarray) -> RayCaster:
    return RayCaster(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def moeller_trumbore(triangles, origin, direction):
    """Sorted distances of all hits of one ray, in double precision."""
    a, e1, e2 = triangles[:, 0], *(triangles[:, k] - triangles[:, 0] for k in (1, 2))
    p = np.cross(direction, e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("ij,ij->i", e1, p)
        u = np.einsum("ij,ij->i", origin - a, p) * inverse
        q = np.cross(origin - a, e1)
        v = q @ direction * inverse
        t = np.einsum("ij,ij->i", e2, q) * inverse
        return np.sort(t[(u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4)])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_all_hits_agree_with_brute_force_at_any_scale(scale):
    rng = np.random.default_rng(0)
    triangles = (rng.random((60, 1, 3)) + 0.3 * rng.normal(size=(60, 3, 3)) + 5.0) * scale
    origins = (rng.random((400, 3)) + 5.0) * scale
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ray, face, distance = caster(triangles).all_hits(origins, directions, 0.7 * scale)
    assert len(ray) > 400
    for i in range(len(origins)):
        expected = moeller_trumbore(triangles / scale, origins[i] / scale, directions[i])
        expected = expected[expected <= 0.7]
        np.testing.assert_allclose(distance[ray == i] / scale, expected, atol=2e-5)
    point = origins[ray] + distance[:, None] * directions[ray]
    a, b, c = np.swapaxes(triangles[face], 0, 1)
    height = np.einsum("ij,ij->i", point - a, np.cross(b - a, c - a))
    height /= np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert np.abs(height).max() < 1e-6 * scale


def test_first_hits_are_the_first_of_all_hits_and_reach_counts():
    rays = caster(plates(np.array([0.1, 0.4, 0.9])))
    origins = np.tile([0.3, 0.4, 0.0], (3, 1))
    up, tilted, down = [0, 0, 1], [0.6, 0, 0.8], [0, 0, -1]
    directions = np.array([up, tilted, down], float)
    face, distance = rays.first_hits(origins, directions)
    np.testing.assert_allclose(distance, [0.1, 0.125, np.inf], atol=1e-6)
    assert set(face[:2]) <= {0, 1} and face[2] == -1
    ray, face, distance = rays.all_hits(origins, directions, 0.6)
    assert ray.tolist() == [0, 0, 1, 1]
    np.testing.assert_allclose(distance, [0.1, 0.4, 0.125, 0.5], atol=1e-6)
    assert (face // 2).tolist() == [0, 1, 0, 1]
    assert rays.first_hits(origins[:1], directions[:1], 0.0999)[0].tolist() == [-1]


def test_a_ray_from_a_face_does_not_meet_that_face():
    rays = caster(plates(np.array([0.0, 0.5])))
    rng = np.random.default_rng(1)
    origins = np.concatenate([rng.random((20000, 2)), np.zeros((20000, 1))], axis=1)
    directions = rng.normal(size=(20000, 3))
    directions[:, 2] = np.abs(directions[:, 2]) + np.linalg.norm(directions[:, :2], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    face, _ = rays.first_hits(origins, directions)
    assert (face != 0).all() and (face != 1).all()
    assert (face >= 2).mean() > 0.3


def test_coincident_faces_are_one_hit_and_stacks_end():
    doubled = np.concatenate([plates(np.array([0.5])), plates(np.array([0.5]))[:, ::-1]])
    ray, _, _ = caster(doubled).all_hits(np.array([[0.3, 0.4, 0.0]]), np.array([[0.0, 0, 1]]), 9.0)
    assert len(ray) == 1
    stack = caster(plates(np.linspace(0.1, 1.0, 3 * MAX_HITS)))
    ray, _, _ = stack.all_hits(np.array([[0.3, 0.4, 0.0]]), np.array([[0.0, 0, 1]]), 9.0)
    assert len(ray) == MAX_HITS


def test_no_rays_and_no_hits():
    rays = caster(plates(np.array([0.5])))
    assert [len(a) for a in rays.all_hits(np.empty((0, 3)), np.empty((0, 3)), 1.0)] == [0, 0, 0]
    away = rays.all_hits(np.zeros((5, 3)), np.tile([0.0, 0, -1], (5, 1)), 1.0)
    assert [len(a) for a in away] == [0, 0, 0]
