"""Covers by balls: nothing of the shape is left out, nothing sticks out too far."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw

from burg_drake.core import InvalidInputError
from burg_drake.motion import cover_body
from tests.thorough import thorough

X_BP = RigidTransform(RollPitchYaw(0.3, -0.7, 1.1), [0.1, -0.2, 0.3])


def one_geometry(shape: Shape) -> tuple[SceneGraph, SceneGraphInspector, GeometryId]:
    graph = SceneGraph()
    source = graph.RegisterSource("test")
    instance = GeometryInstance(X_BP, shape, "shape")
    instance.set_proximity_properties(ProximityProperties())
    geometry = graph.RegisterAnchoredGeometry(source, instance)
    return graph, graph.model_inspector(), geometry


def distance(shape: Shape, p: np.ndarray) -> np.ndarray:
    """Signed distance of points (N, 3) in the shape's frame, in closed form."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(p, axis=1) - shape.radius()
    if isinstance(shape, Capsule):
        z = np.clip(p[:, 2], -shape.length() / 2, shape.length() / 2)
        return np.linalg.norm(p - np.outer(z, (0, 0, 1)), axis=1) - shape.radius()
    if isinstance(shape, Box):
        beyond = np.abs(p) - np.asarray(shape.size()) / 2
    else:
        radial = np.hypot(p[:, 0], p[:, 1]) - shape.radius()
        beyond = np.column_stack([radial, np.abs(p[:, 2]) - shape.length() / 2])
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.05),
        Capsule(0.05, 0.09),
        Box(0.06, 0.09, 0.04),
        Box(0.2, 0.02, 0.01),
        Cylinder(0.045, 0.03),
        Cylinder(0.01, 0.1),
    ],
)
@pytest.mark.parametrize("overshoot", [0.006, 0.02])
def test_balls_cover_the_shape_and_stick_out_little(shape: Shape, overshoot: float) -> None:
    _graph, inspector, geometry = one_geometry(shape)
    balls = cover_body(inspector, [geometry], overshoot)
    rng = np.random.default_rng(0)
    p = rng.uniform(-0.16, 0.16, (200_000, 3))
    p = p[distance(shape, p) <= 0.0]
    assert len(p) > 150
    p_B = X_BP.multiply(p.T).T
    gap = np.linalg.norm(p_B[:, None] - balls.center, axis=2) - balls.outer
    assert gap.min(axis=1).max() <= 1e-9
    centers = X_BP.inverse().multiply(balls.center.T).T
    depth = -distance(shape, centers)
    assert np.all(balls.inner <= depth + 1e-9)
    assert np.all(balls.outer <= depth + overshoot + 1e-6)


@pytest.mark.parametrize(
    "shape", [Box(0.5, 0.4, 0.5), Cylinder(0.3, 1.2), thorough(Box(1.6, 3.6, 0.04))]
)
def test_large_shapes_take_few_balls_of_limited_size(shape: Shape) -> None:
    """A mobile base covered as finely as a finger would take tens of gigabytes."""
    _graph, inspector, geometry = one_geometry(shape)
    balls = cover_body(inspector, [geometry], 0.008)
    assert len(balls.outer) <= 2000 and balls.inner.max() <= 0.08 + 1e-9
    p = np.random.default_rng(0).uniform(-1.8, 1.8, (40_000, 3)) * (0.3, 1.0, 0.4)
    p = p[distance(shape, p) <= 0.0]
    assert len(p) > 150
    p_B = X_BP.multiply(p.T).T
    for part in np.array_split(p_B, 20):
        gap = np.linalg.norm(part[:, None] - balls.center, axis=2) - balls.outer
        assert gap.min(axis=1).max() <= 1e-9
    centers = X_BP.inverse().multiply(balls.center.T).T
    assert np.all(balls.inner <= -distance(shape, centers) + 1e-9)


def test_unknown_shapes_are_named() -> None:
    _graph, inspector, geometry = one_geometry(Ellipsoid(0.1, 0.2, 0.3))
    with pytest.raises(InvalidInputError, match="'shape' of the robot is a Ellipsoid"):
        cover_body(inspector, [geometry], 0.01)
