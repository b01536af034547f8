"""Collision checks against configurations whose contacts are known by construction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.schema import Pose
from burg_drake.motion.collision import ArmCollision
from burg_drake.scene.scene import Instance, Scene, SceneDocument, load_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.station import Obstacle, Station, load_station

HOME = np.array((0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4))
HAND = (0.30689, 0.0, 0.59028)
"""Origin of the hand at home [m]; it points down, its fingers 0.04 m to either side along y."""
FINGERTIP = 0.0584 + 0.04525 + 0.0185 / 2
"""From the origin of the hand to the end of a pad [m]: finger joint, centre of the pad, half of its
height (franka_ros, franka_hand.xacro)."""


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


def collision(station: Station, *instances: Instance, **background: Obstacle) -> ArmCollision:
    library = load_scene("tabletop_six").library
    document = SceneDocument(name="few", library="household", instances=instances)
    scene = Scene(document, library, Path("few.yaml"))
    changed = replace(station, document=replace(station.document, background=background))
    return ArmCollision(build_station_diagram(scene, changed))


def test_home_is_free(station: Station) -> None:
    checked = collision(station)
    assert checked.overlaps(HOME) == []
    assert checked.is_free(HOME)
    assert [joint.name() for joint in checked.joints] == [f"panda_joint{i}" for i in range(1, 8)]


@pytest.mark.parametrize(("gap", "touching"), [(1e-3, False), (-1e-3, True)])
def test_the_open_finger_and_a_post_by_a_millimetre(
    station: Station, gap: float, touching: bool
) -> None:
    """A post stands under the middle of the pad, which is 15.2 mm thick."""
    x, _, z = HAND
    top = z - FINGERTIP - gap
    post = Obstacle(X_WB=Pose((x, 0.04 + 0.0076, top - 0.05)), size=(0.01, 0.01, 0.1))
    checked = collision(station, post=post)
    overlaps = checked.overlaps(HOME)
    assert checked.is_free(HOME) is not touching
    assert bool(overlaps) is touching
    if touching:
        (overlap,) = overlaps
        assert str(overlap) in ("panda_leftfinger vs post", "panda_rightfinger vs post")
        assert overlap.depth == pytest.approx(-gap, abs=1e-4)
        assert overlap.carried


def test_the_arm_itself(station: Station) -> None:
    folded = np.array((0.0, 0.0, 0.0, -3.0, 0.0, 0.1, 0.0))
    checked = collision(station)
    overlaps = checked.overlaps(folded)
    assert overlaps and not checked.is_free(folded)
    assert all(o.link.startswith("panda_") and o.other.startswith("panda_") for o in overlaps)
    assert not any(o.carried for o in overlaps)
    assert [o.depth for o in overlaps] == sorted((o.depth for o in overlaps), reverse=True)


def test_a_link_that_is_not_carried(station: Station) -> None:
    """A post through the upper arm, half way between shoulder and elbow, which leans back."""
    halfway = 0.158 * np.sqrt(0.5)
    post = Obstacle(X_WB=Pose((-halfway, 0.0, 0.333 + halfway)), size=(0.02, 1.0, 0.02))
    overlaps = collision(station, post=post).overlaps(HOME)
    assert {o.other for o in overlaps} == {"post"}
    assert {o.link for o in overlaps} <= {"panda_link2", "panda_link3"}
    assert not any(o.carried for o in overlaps)


def test_objects_among_themselves_do_not_count(station: Station) -> None:
    """Two cans in one place, sunk into the table: what the scene's own checks are for."""
    cans = [
        Instance(name=name, object="can", X_SO=Pose((0.3, 0.2, -0.02))) for name in ("one", "two")
    ]
    checked = collision(station, *cans)
    assert checked.overlaps(HOME) == [] and checked.is_free(HOME)


def test_both_ways_to_ask_agree(station: Station) -> None:
    can = Instance(name="can", object="can", X_SO=Pose((0.3, 0.2, 0.0)))
    checked = collision(station, can)
    limits = [(j.position_lower_limits()[0], j.position_upper_limits()[0]) for j in checked.joints]
    postures = np.random.default_rng(7).uniform(*np.transpose(limits), (400, 7))
    answers = [(checked.is_free(q), not checked.overlaps(q)) for q in postures]
    assert all(a == b for a, b in answers)
    assert 40 < sum(a for a, _ in answers) < 390


def test_an_arm_is_needed(station: Station) -> None:
    hand = build_station_diagram(load_scene("tabletop_six"), station, robot="hand")
    with pytest.raises(InvalidInputError, match="built with robot='hand'; build it with 'arm'"):
        ArmCollision(hand)
