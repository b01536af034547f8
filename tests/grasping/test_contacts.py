"""Contacts against closed forms, an optimiser, and symmetry."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import trimesh
from scipy.integrate import dblquad
from scipy.optimize import minimize

from burg_drake.core import InvalidInputError, make_pose, rotation_from_rpy, swap_fingers
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    PANDA_JAWS,
    TURN_RESISTANCE,
    Contacts,
    grasp_contacts,
    jaws_of,
    press_pads,
)
from burg_drake.station import locate_hand

JAWS = PANDA_JAWS
CENTER = np.eye(4)[None]


def box(*extents: float) -> Surface:
    return Surface.of(trimesh.creation.box(extents))


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, rpy: tuple[float, ...] = (0, 0, 0)):
    return make_pose(rotation_from_rpy(rpy), (x, y, z))[None]


def test_flat_faces_fill_the_pads() -> None:
    contacts = grasp_contacts(box(0.04, 0.1, 0.1), CENTER)
    assert contacts.touching.all()
    np.testing.assert_allclose(
        contacts.p_OC[0], [[0.02, 0, 0.00025], [-0.02, 0, 0.00025]], atol=1e-7
    )
    np.testing.assert_allclose(contacts.normal[0], [[-1, 0, 0], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(contacts.area, JAWS.pad_area)
    np.testing.assert_allclose(
        contacts.indentation, JAWS.force / (JAWS.foundation * JAWS.pad_area), rtol=1e-3
    )
    half_y, half_z = 0.5 * np.ptp(JAWS.y), 0.5 * np.ptp(JAWS.z)
    mean = dblquad(np.hypot, -half_y, half_y, -half_z, half_z)[0] / JAWS.pad_area
    np.testing.assert_allclose(contacts.torsion_radius, mean, rtol=0.02)


def test_ball_is_met_in_a_disc_of_hertzian_proportion() -> None:
    """On springs of stiffness k an area, F = k pi R d^2, a^2 = 2 R d, pressure 1 - (r / a)^2."""
    R = 0.025
    surface = Surface.of(trimesh.creation.icosphere(subdivisions=5, radius=R))
    shift = np.random.default_rng(0).uniform(-0.002, 0.002, (20, 3))
    contacts = grasp_contacts(surface, make_pose(None, shift))
    d = np.sqrt(JAWS.force / (JAWS.foundation * np.pi * R))
    a = np.sqrt(2.0 * R * d)
    assert contacts.indentation.mean() == pytest.approx(d, rel=0.03)
    assert contacts.radius.mean() == pytest.approx(a, rel=0.05)
    assert contacts.torsion_radius.mean() == pytest.approx(8.0 / 15.0 * a, rel=0.06)
    outward = contacts.p_OC / np.linalg.norm(contacts.p_OC, axis=-1, keepdims=True)
    assert np.degrees(np.arccos((-outward * contacts.normal).sum(axis=-1))).max() < 1.5


def test_rim_of_a_coin_is_met_in_a_strip() -> None:
    """A cylinder between flat springs: F = k h (4 / 3) a d, a^2 = 2 R d."""
    R, h = 0.012, 0.004
    coin = Surface.of(trimesh.creation.cylinder(radius=R, height=h, sections=256))
    shift = np.random.default_rng(0).uniform(-0.002, 0.002, (20, 3)) * (1, 1, 2)
    contacts = grasp_contacts(coin, make_pose(None, shift))
    a = (JAWS.force * 1.5 * R / (JAWS.foundation * h)) ** (1.0 / 3.0)
    assert contacts.touching.all()
    assert contacts.area.mean() == pytest.approx(2.0 * a * h, rel=0.1)
    np.testing.assert_allclose(np.abs(contacts.p_OC[:, :, 0]), R, atol=0.0005)


def test_two_coins_are_held_by_their_outer_faces() -> None:
    one = trimesh.creation.cylinder(radius=0.012, height=0.002, sections=64)
    two = one.copy()
    one.apply_translation([0, 0, 0.004])
    two.apply_translation([0, 0, -0.004])
    closing_along_z = make_pose(rotation_from_rpy((0, -np.pi / 2, 0)))[None]
    surface = Surface.of(trimesh.util.concatenate([one, two]))
    contacts = grasp_contacts(surface, closing_along_z)
    np.testing.assert_allclose(np.abs(contacts.p_OC[0, :, 2]), 0.005, atol=1e-6)
    np.testing.assert_allclose(np.abs(contacts.normal[0, :, 2]), 1.0, atol=1e-9)


def test_grasp_frame_need_not_be_midway() -> None:
    surface = box(0.04, 0.1, 0.1)
    moved = grasp_contacts(surface, at(x=0.011))
    np.testing.assert_allclose(moved.p_OC, grasp_contacts(surface, CENTER).p_OC, atol=1e-6)


@pytest.mark.parametrize("rpy", [(0, 0, 0.2), (0, 0.15, 0), (0, 0.1, -0.2), (0, 0, -0.3)])
def test_askew_box_comes_to_lie_flat(rpy: tuple[float, ...]) -> None:
    contacts = grasp_contacts(box(0.06, 0.1, 0.1), at(rpy=rpy))
    np.testing.assert_allclose(contacts.area, JAWS.pad_area)
    across = contacts.p_OC[0, 0] - contacts.p_OC[0, 1]
    assert np.hypot(across[1], across[2]) < 0.01 * across[0]


@pytest.mark.parametrize(
    ("surface", "X_OG"),
    [
        (box(0.04, 0.1, 0.1), at(y=0.2)),  # beside the object
        (box(0.1, 0.1, 0.1), CENTER),  # wider than the hand opens
        (box(0.04, 0.1, 0.1), at(x=0.07)),  # one pad only
    ],
)
def test_pads_that_meet_nothing_give_nan(surface: Surface, X_OG: np.ndarray) -> None:
    contacts = grasp_contacts(surface, X_OG)
    assert not contacts.touching.any()
    for field in fields(Contacts):
        if field.name != "touching":
            assert np.isnan(getattr(contacts, field.name)).all(), field.name


def test_batches_and_swapped_fingers_change_nothing() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    mesh.apply_scale([1.0, 0.7, 1.2])
    surface = Surface.of(mesh)
    rng = np.random.default_rng(0)
    X = make_pose(rotation_from_rpy(rng.uniform(-3, 3, (30, 3))), rng.uniform(-0.01, 0.01, (30, 3)))
    together = grasp_contacts(surface, X)
    alone = [grasp_contacts(surface, X[i : i + 1]) for i in range(30)]
    swapped = grasp_contacts(surface, swap_fingers(X))
    for field in fields(Contacts):
        joined = np.concatenate([getattr(one, field.name) for one in alone])
        np.testing.assert_array_equal(getattr(together, field.name), joined, field.name)
    assert together.touching.sum() > 20
    np.testing.assert_allclose(swapped.p_OC[:, ::-1], together.p_OC, atol=2e-6)
    np.testing.assert_allclose(swapped.normal[:, ::-1], together.normal, atol=1e-3)


def test_indentation_has_the_least_energy() -> None:
    rng = np.random.default_rng(3)
    yz = rng.uniform(-0.009, 0.009, (2, 12, 2))
    gap = rng.uniform(0.0, 0.002, (5, 2, 12))
    gap -= gap.min(axis=2, keepdims=True)
    total = 0.004
    resistance = TURN_RESISTANCE * (yz[0] ** 2).sum()

    def energy(v: np.ndarray, own: np.ndarray) -> float:
        lift = np.stack([yz[0] @ v[2:], -yz[1] @ v[2:]])
        pressed = np.maximum(1e-3 * v[:2, None] + lift - own, 0.0)
        return 1e6 * (
            0.5 * (pressed**2).sum() - total * 1e-3 * v[:2].sum() + 0.5 * resistance * v[2:] @ v[2:]
        )

    pressed, slope = press_pads(gap, yz, total)
    np.testing.assert_allclose(pressed.sum(axis=2), total, rtol=1e-9)
    exact = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 6000, "maxfev": 6000}
    for i in range(5):
        best = minimize(energy, [1, 1, 0, 0], (gap[i],), "Nelder-Mead", options=exact)
        np.testing.assert_allclose(slope[i], best.x[2:], atol=2e-4)


def test_jaws_are_those_of_the_model() -> None:
    hand, model, _ = locate_hand("panda_hand")
    read = jaws_of(hand, model)
    for field in fields(read):
        np.testing.assert_allclose(
            getattr(read, field.name), getattr(PANDA_JAWS, field.name), atol=1e-9
        )


def test_jaws_that_make_no_sense() -> None:
    with pytest.raises(
        InvalidInputError,
        match=r"Jaws.y .* 0.01 to 0 m",
    ):
        replace(PANDA_JAWS, y=(0.01, 0.0))
    with pytest.raises(InvalidInputError, match=r"Jaws.force is 0; give more than 0"):
        replace(PANDA_JAWS, force=0.0)
