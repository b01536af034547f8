"""Metrics against statics, and what must not change them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    make_pose,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    METRICS,
    PANDA_JAWS,
    STANDARD_GRAVITY,
    AntipodalSettings,
    Payload,
    Quality,
    check_metric,
    grasp_quality,
    sample_antipodal,
    score_of,
)

BOX = Surface.of(trimesh.creation.box((0.04, 0.1, 0.1)))
MIDDLE = float(np.mean(PANDA_JAWS.z))
"""Height of the middle of the pads in G [m]."""
HELD = make_pose(None, (0.0, 0.0, -MIDDLE))[None]
"""Holds the box at its centre."""
PAYLOAD = Payload(mass=0.5, center_of_mass=(0.0, 0.0, 0.0), friction=0.4)
SQUEEZE = 2.0 * PANDA_JAWS.force / (PAYLOAD.mass * STANDARD_GRAVITY)
"""Both pad forces over the weight."""


def potato() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    mesh.apply_scale([1.0, 0.7, 1.3])
    return mesh


def sampled(mesh: trimesh.Trimesh, n: int = 40) -> Array:
    return sample_antipodal(mesh, n, np.random.default_rng(1), AntipodalSettings(friction=0.3)).X_OG


def assert_alike(one: Quality, other: Quality, rtol: float) -> None:
    np.testing.assert_array_equal(one.force_closure, other.force_closure)
    for name in ("epsilon", "volume", "load_margin", "patch_area", "contact_offset"):
        np.testing.assert_allclose(
            getattr(one, name), getattr(other, name), rtol=rtol, atol=1e-5, err_msg=name
        )


def test_box_across_parallel_faces() -> None:
    """Two pads with equal forces carry 2 mu F across the closing line. Along a direction that has a
    part a along it, one pad bears more than the other and the weaker one decides: 1 / (a + t / mu),
    at worst mu / sqrt(1 + mu^2)."""
    found = grasp_quality(HELD, BOX, PAYLOAD, up=(0, 0.6, 0.8))
    mu = PAYLOAD.friction
    assert found.force_closure.all()
    assert found.friction_needed[0] == pytest.approx(0.0, abs=1e-9)
    assert found.antipodal_angle[0] == pytest.approx(0.0, abs=1e-9)
    assert found.contact_offset[0] == pytest.approx(0.0, abs=1e-9)
    assert found.patch_area[0] == pytest.approx(PANDA_JAWS.pad_area)
    assert found.gravity_margin[0] == pytest.approx(SQUEEZE * mu, rel=1e-5)
    assert found.load_margin[0] == pytest.approx(SQUEEZE * mu / np.hypot(1.0, mu), rel=1e-5)


def test_torsion_limits_an_off_centre_grip() -> None:
    """Each patch bears f and torque f d, with (f / mu F)^2 + (f d / mu F r)^2 = 1."""
    lever, radius = 0.02, 0.00697
    X = make_pose(None, (0.0, 0.0, lever - MIDDLE))[None]
    found = grasp_quality(X, BOX, PAYLOAD, up=(0.0, 1.0, 0.0))
    expected = SQUEEZE * PAYLOAD.friction / np.hypot(1.0, lever / radius)
    assert found.gravity_margin[0] == pytest.approx(expected, rel=0.01)
    assert found.contact_offset[0] == pytest.approx(lever, rel=1e-4)
    in_line = grasp_quality(X, BOX, PAYLOAD, up=(0.0, 0.0, 1.0))
    assert in_line.gravity_margin[0] == pytest.approx(SQUEEZE * PAYLOAD.friction, rel=1e-3)


def test_wedge_needs_the_friction_of_its_angle() -> None:
    """Faces that are 2 t apart from parallel, held so that it cannot come to lie flat."""
    t = np.arctan(0.25)
    profile = [(-0.04, -0.08), (0.04, -0.08), (0.0, 0.04 / np.tan(t) - 0.08)]
    corners = [(x, y, z) for x, y in profile for z in (-0.03, 0.03)]
    wedge = trimesh.convex.convex_hull(np.array(corners))
    found = grasp_quality(HELD, Surface.of(wedge), PAYLOAD)
    assert found.friction_needed[0] == pytest.approx(0.25, abs=0.01)
    assert found.force_closure.all()
    slippery = grasp_quality(HELD, Surface.of(wedge), replace(PAYLOAD, friction=0.24))
    assert not slippery.force_closure.any()
    assert (slippery.epsilon, slippery.volume, slippery.load_margin) == (0.0, 0.0, 0.0)


def test_ball_off_its_centre() -> None:
    """Parallel pads meet a ball at the ends of a diameter, wherever the hand is."""
    ball = Surface.of(trimesh.creation.icosphere(subdivisions=5, radius=0.02))
    X = make_pose(None, (0.0, 0.003, 0.002))[None]
    found = grasp_quality(X, ball, PAYLOAD)
    assert found.friction_needed[0] < 0.03
    assert found.contact_offset[0] < 0.0005


def test_more_friction_is_never_worse() -> None:
    surface, X = Surface.of(potato()), sampled(potato())
    last = grasp_quality(X, surface, replace(PAYLOAD, friction=0.1), up=(0, 0, 1))
    for mu in (0.2, 0.4, 0.8):
        now = grasp_quality(X, surface, replace(PAYLOAD, friction=mu), up=(0, 0, 1))
        for name in ("force_closure", "epsilon", "volume", "load_margin", "gravity_margin"):
            grown = getattr(now, name).astype(float) - getattr(last, name).astype(float)
            assert (grown > -1e-3 * getattr(last, name).max()).all(), (name, mu)
        last = now
    assert last.force_closure.all()


def test_turning_the_object_with_its_grasps_changes_nothing() -> None:
    mesh, X = potato(), sampled(potato())
    payload = replace(PAYLOAD, center_of_mass=(0.002, -0.003, 0.01))
    X_WO = make_pose(rotation_from_rpy((0.4, -1.1, 2.0)), (0.1, -0.2, 0.3))
    turned = mesh.copy().apply_transform(X_WO)
    com = X_WO[:3, :3] @ payload.center_of_mass + X_WO[:3, 3]
    assert_alike(
        grasp_quality(X, Surface.of(mesh), payload),
        grasp_quality(X_WO @ X, Surface.of(turned), replace(payload, center_of_mass=tuple(com))),
        rtol=0.02,
    )


def test_fingers_are_exchangeable() -> None:
    surface, X = Surface.of(potato()), sampled(potato())
    up = X[:, :3, 0] + (0.1, 0.2, 0.3)
    one = grasp_quality(X, surface, PAYLOAD, up=up)
    other = grasp_quality(swap_fingers(X), surface, PAYLOAD, up=up)
    for name in METRICS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_finer_triangles_change_little() -> None:
    mesh = trimesh.creation.cylinder(radius=0.02, height=0.1, sections=64)
    X = sampled(mesh)
    finer = mesh.subdivide().subdivide()
    assert_alike(
        grasp_quality(X, Surface.of(mesh), PAYLOAD),
        grasp_quality(X, Surface.of(finer), PAYLOAD),
        rtol=0.02,
    )


def test_epsilon_and_volume_have_no_scale() -> None:
    mesh, X = potato(), sampled(potato())
    s = 1.2
    jaws = replace(
        PANDA_JAWS,
        opening=(0.0, 0.08 * s),
        y=(PANDA_JAWS.y[0] * s, PANDA_JAWS.y[1] * s),
        z=(PANDA_JAWS.z[0] * s, PANDA_JAWS.z[1] * s),
        foundation=PANDA_JAWS.foundation / s**3,
    )
    larger, X_larger = mesh.copy().apply_scale(s), X.copy()
    X_larger[:, :3, 3] *= s
    one = grasp_quality(X, Surface.of(mesh), PAYLOAD)
    other = grasp_quality(X_larger, Surface.of(larger), PAYLOAD, jaws)
    for name in ("epsilon", "volume", "load_margin", "friction_needed"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=5e-3, atol=1e-6)


def test_heavier_objects_and_weaker_hands() -> None:
    X = np.concatenate([HELD, make_pose(None, (0.0, 0.02, 0.01))[None]])
    one = grasp_quality(X, BOX, PAYLOAD)
    heavy = grasp_quality(X, BOX, replace(PAYLOAD, mass=1.5))
    np.testing.assert_allclose(heavy.load_margin, one.load_margin / 3.0, rtol=1e-9)
    np.testing.assert_allclose(heavy.epsilon, one.epsilon, rtol=1e-9)
    weak = grasp_quality(X, BOX, PAYLOAD, replace(PANDA_JAWS, force=10.0))
    np.testing.assert_allclose(weak.load_margin, one.load_margin / 4.0, rtol=1e-3)


def test_what_touches_nothing_has_no_quality() -> None:
    beside = make_pose(None, (0.0, 0.5, 0.0))[None]
    quality = grasp_quality(np.concatenate([HELD, beside]), BOX, PAYLOAD)
    np.testing.assert_array_equal(quality.force_closure, [True, False])
    for name in set(METRICS) - {"force_closure"}:
        assert np.isnan(getattr(quality, name)[1]), name
    assert np.isnan(quality.gravity_margin).all()
    assert len(grasp_quality(HELD[:0], BOX, PAYLOAD, up=(0, 0, 1)).epsilon) == 0


def test_scores_are_higher_where_grasps_are_better() -> None:
    values = np.array([0.1, 0.3])
    np.testing.assert_array_equal(score_of(values, "load_margin"), values)
    np.testing.assert_array_equal(score_of(values, "contact_offset"), -values)


def test_bad_input() -> None:
    with pytest.raises(UnknownNameError, match=r"there is no metric 'epsilom'.*epsilon"):
        check_metric("epsilom")
    with pytest.raises(
        InvalidInputError, match=r"up has shape \(2,\); expected \(3,\) or \(1, 3\)"
    ):
        grasp_quality(HELD, BOX, PAYLOAD, up=(0, 1))
    with pytest.raises(InvalidInputError, match="mass is 0 kg; give more than 0"):
        replace(PAYLOAD, mass=0.0)
