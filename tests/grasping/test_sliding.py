"""Objects that slide in the hand: a neck above shoulders, and wedges that never hold."""

from __future__ import annotations

import itertools
from dataclasses import fields

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, make_pose, rotation_from_rpy, swap_fingers
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    PANDA_JAWS,
    SLIDE_STEPS,
    Contacts,
    Payload,
    friction_needed,
    grasp_contacts,
    grasp_quality,
    slide_to_rest,
)

MU = 0.3
STEP = min(np.ptp(PANDA_JAWS.y), np.ptp(PANDA_JAWS.z)) / SLIDE_STEPS
BITE = 0.0008
"""How deep the edge of a pad may be pressed in before its flat part bears enough [m]."""


def stacked(*levels: tuple[float, float], depth: float = 0.06) -> Surface:
    """A body between levels, each a half width along x and a height z."""
    slabs = []
    for pair in itertools.pairwise(levels):
        corners = [(s * x, y, z) for x, z in pair for s in (-1, 1) for y in (-depth / 2, depth / 2)]
        slabs.append(trimesh.convex.convex_hull(np.array(corners)))
    return Surface.of(trimesh.util.concatenate(slabs))


def bottle() -> Surface:
    """A neck of half width 15 mm above z = 0, and shoulders that fall by 45 degrees below it."""
    return stacked((0.015, 0.05), (0.015, 0.0), (0.035, -0.02), (0.035, -0.08))


def from_above(tips: float) -> Array:
    """A grasp (1, 4, 4) whose approach is straight down, with the tips of the pads at a height."""
    return make_pose(rotation_from_rpy((np.pi, 0.0, 0.0)), (0.0, 0.0, tips + PANDA_JAWS.z[1]))[None]


def rest(surface: Surface, X_OG: Array, friction: float = MU) -> tuple[Contacts, Array]:
    given = grasp_contacts(surface, X_OG)
    return slide_to_rest(surface, X_OG, PANDA_JAWS, friction, given)


@pytest.mark.parametrize("depth", [0.003, 0.006, 0.01])
def test_shoulders_slide_away_until_the_pads_are_on_the_neck(depth: float) -> None:
    contacts, slide = rest(bottle(), from_above(-depth))
    assert friction_needed(grasp_contacts(bottle(), from_above(-depth)))[0] > 0.9
    assert depth - BITE <= slide[0] <= depth + STEP
    np.testing.assert_allclose(np.abs(contacts.p_OC[0, :, 0]), 0.015, atol=0.001)
    assert friction_needed(contacts)[0] < MU


def test_enough_friction_holds_at_the_shoulder() -> None:
    _, slide = rest(bottle(), from_above(-0.006), friction=1.2)
    assert slide[0] == 0.0


def test_what_is_held_stays_as_it_is() -> None:
    given = grasp_contacts(bottle(), from_above(0.005))
    contacts, slide = rest(bottle(), from_above(0.005))
    assert slide[0] == 0.0
    for field in fields(Contacts):
        np.testing.assert_array_equal(getattr(contacts, field.name), getattr(given, field.name))


def test_wedge_is_never_held() -> None:
    """Faces that lean by 0.5 all the way; the contacts stay those of the grasp."""
    wedge = stacked((0.0, 0.0), (0.035, -0.07))
    X = from_above(-0.05)
    given = grasp_contacts(wedge, X)
    contacts, slide = rest(wedge, X)
    assert np.isinf(slide[0])
    np.testing.assert_array_equal(contacts.p_OC, given.p_OC)
    found = grasp_quality(X, wedge, Payload(mass=0.1, center_of_mass=(0, 0, -0.05), friction=MU))
    assert (found.force_closure[0], found.load_margin[0], found.slide[0]) == (False, 0.0, np.inf)
    assert found.friction_needed[0] == pytest.approx(0.5, abs=0.02)


def test_metrics_are_those_of_the_place_of_rest() -> None:
    payload = Payload(mass=0.3, center_of_mass=(0.0, 0.0, -0.03), friction=MU)
    slid = grasp_quality(from_above(-0.006), bottle(), payload, up=(0.0, 0.0, 1.0))
    placed = grasp_quality(
        from_above(-0.006 + slid.slide[0]), bottle(), payload, up=(0.0, 0.0, 1.0)
    )
    assert not slid.force_closure[0] and slid.slide[0] > 0.0
    assert placed.force_closure[0] and placed.slide[0] == 0.0
    for name in ("load_margin", "gravity_margin", "epsilon", "patch_area", "contact_offset"):
        assert getattr(slid, name)[0] == pytest.approx(getattr(placed, name)[0], rel=1e-6), name
    assert slid.friction_needed[0] > 0.9 > MU > placed.friction_needed[0]


def test_batches_fingers_and_grasps_of_nothing() -> None:
    X = np.concatenate([from_above(-0.003), from_above(0.4), from_above(0.01), from_above(-0.008)])
    _, together = rest(bottle(), X)
    alone = [rest(bottle(), X[i : i + 1])[1][0] for i in range(len(X))]
    np.testing.assert_array_equal(together, alone)
    np.testing.assert_allclose(rest(bottle(), swap_fingers(X))[1], together, atol=1e-12)
    assert np.isnan(together[1])
    assert rest(bottle(), X[:0])[1].shape == (0,)
