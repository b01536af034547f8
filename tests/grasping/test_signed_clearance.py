"""Signed clearance of the open hand in a scene: Drake, symmetry, touching, margins and modes."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    UnknownNameError,
    make_pose,
    rotation_from_rpy,
    swap_fingers,
)
from burg_drake.grasping import HandClearance, hand_clearance_alone
from burg_drake.objects import load_library
from burg_drake.scene import Scene, load_scene
from burg_drake.station import build_station_diagram, load_station

DOWN = np.diag([1.0, -1.0, -1.0])
"""Grasp frame with its approach along -z of the world."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_close")


@pytest.fixture(scope="module")
def clearance(scene: Scene) -> HandClearance:
    return HandClearance(build_station_diagram(scene, load_station("panda_tabletop"), robot="hand"))


@pytest.fixture(scope="module")
def alone() -> HandClearance:
    return hand_clearance_alone(load_library("household"), "box", load_station("panda_tabletop"))


@pytest.fixture(scope="module")
def grasps() -> np.ndarray:
    """In the world, over and between the objects, many of them clear."""
    X_WS = load_station("panda_tabletop").document.X_WS.matrix()
    rng = np.random.default_rng(4)
    n = 1500
    p = np.column_stack([rng.uniform(0.1, 0.5, (n, 2)), rng.uniform(0.03, 0.25, n)])
    tilt = np.column_stack([rng.uniform(-0.7, 0.7, (n, 2)), rng.uniform(-3, 3, n)])
    return X_WS @ make_pose(DOWN @ rotation_from_rpy(tilt), p)


def test_agrees_with_drake(clearance: HandClearance, grasps: np.ndarray) -> None:
    found = clearance.measure("bowl", grasps)
    clear = np.flatnonzero(found.clear)
    assert 200 < len(clear) < 1300
    for k in clear[:25]:
        distances = clearance.signed_distances(grasps[k])
        assert found.clearance[k] == pytest.approx(min(distances.values()), abs=1e-6)
        assert distances[found.nearest[k]] == pytest.approx(found.clearance[k], abs=1e-6)
    for k in np.flatnonzero(~found.clear)[:25]:
        assert found.clearance[k] == -found.overlap[k] < 0.0
        assert found.nearest[k] == found.blocker[k] in clearance.touched(grasps[k])
    assert len(set(found.nearest[clear])) >= 5


def test_objects_and_arrays_tell_the_same(clearance: HandClearance, grasps: np.ndarray) -> None:
    """And each grasp alone has the same bits."""
    found = clearance.measure("mug", grasps)
    listed = clearance.check_all("mug", grasps)
    assert len(found) == len(listed) == len(grasps)
    for k, one in enumerate(listed[:40]):
        assert one == clearance.check("mug", grasps[k])
        outcome = None if found.outcome[k] == "" else Outcome(found.outcome[k])
        assert (one.outcome, one.blocker, one.nearest) == (
            *(outcome, found.blocker[k], found.nearest[k]),
        )
        assert (one.overlap, one.clearance) == (found.overlap[k], found.clearance[k])
        assert (one.outcome is None) == found.clear[k] == (one.clearance >= 0.0)


def test_swapped_fingers_are_as_clear(clearance: HandClearance, grasps: np.ndarray) -> None:
    one, other = (clearance.measure("mug", X) for X in (grasps, swap_fingers(grasps)))
    assert one.outcome.tolist() == other.outcome.tolist()
    np.testing.assert_allclose(one.clearance, other.clearance, atol=1e-9)


def test_clearance_falls_linearly_through_touching(alone: HandClearance) -> None:
    """One finger over the top of a box, lowered in steps of 0.1 mm, and another hand that comes
    from the side with the back of a finger."""
    box = load_library("household").surface("box").bounds
    middle = box.mean(axis=0)
    steps = 1e-4 * np.arange(-30, 31)
    for start, way, R in (
        ((middle[0] + 0.045, middle[1], box[1, 2]), (0, 0, 1), DOWN),
        ((middle[0], box[1, 1] + 0.06, middle[2]), (0, 1, 0), rotation_from_rpy((0, 0, np.pi / 2))),
    ):
        X_OG = make_pose(R, np.array(start))
        touching = alone.check("box", X_OG).clearance
        towards = make_pose(R, np.array(start) + (steps - touching)[:, None] * np.array(way))
        found = alone.measure("box", towards)
        np.testing.assert_allclose(found.clearance, steps, atol=1e-9)
        assert set(found.nearest) == {"box"}
        apart = steps > 1e-9
        assert found.clear[apart].all() and not found.clear[steps < -1e-9].any()
        assert (found.overlap[apart] == 0.0).all()


def test_a_margin_rejects_what_is_too_near(clearance: HandClearance, grasps: np.ndarray) -> None:
    bare = clearance.measure("bowl", grasps)
    for margin in (0.002, 0.02):
        found = clearance.measure("bowl", grasps, margin=margin)
        assert found.clearance.tobytes() == bare.clearance.tobytes()
        assert found.overlap.tobytes() == bare.overlap.tobytes()
        assert found.clear.tolist() == (bare.clear & (bare.clearance >= margin)).tolist()
        near = bare.clear & ~found.clear
        assert near.sum() > 10
        assert found.blocker[near].tolist() == bare.nearest[near].tolist()
        outcomes = clearance.outcomes("bowl")
        pairs = zip(found.blocker[near], found.outcome[near], strict=True)
        assert all(outcomes[b] == o for b, o in pairs)
        same = ~near
        assert found.blocker[same].tolist() == bare.blocker[same].tolist()
    exactly = bare.clearance[bare.clear].min()
    assert clearance.measure("bowl", grasps, margin=exactly).clear.sum() == bare.clear.sum()


def test_conservative_never_calls_clear_what_is_not(scene: Scene, grasps: np.ndarray) -> None:
    station = load_station("wsg_tabletop")
    clearance = HandClearance(build_station_diagram(scene, station, robot="hand"))
    for instance in ("mug", "bottle"):
        exact = clearance.measure(instance, grasps)
        careful = clearance.measure(instance, grasps, mode="conservative")
        assert not (careful.clear & ~exact.clear).any()
        assert 0 < (exact.clear & ~careful.clear).sum() < 0.2 * exact.clear.sum()
        compared = exact.clear | (careful.blocker == exact.blocker)
        assert (careful.clearance <= exact.clearance + 1e-12)[compared].all()


def test_the_object_alone(alone: HandClearance, grasps: np.ndarray) -> None:
    """In the object's frame, and as in a scene where nothing else is near."""
    scene = load_scene("tabletop_six")
    diagram = build_station_diagram(scene, load_station("panda_tabletop"), robot="hand")
    whole = HandClearance(diagram)
    X_WO = diagram.X_WO("box")
    bottom, top = load_library("household").surface("box").bounds[:, 2]
    tilt = np.random.default_rng(0).uniform(-0.4, 0.4, (200, 3))
    X_OG = make_pose(DOWN, (0.0, 0.0, top + 0.005)) @ make_pose(rotation_from_rpy(tilt))
    one, other = alone.measure("box", X_OG), whole.measure("box", X_WO @ X_OG)
    own = other.nearest == "box"
    assert own.sum() > 100 and 20 < one.clear.sum() < 200
    np.testing.assert_allclose(one.clearance[own], other.clearance[own], atol=1e-9)
    assert (one.clearance >= other.clearance - 1e-9)[one.clear].all()
    below = make_pose(p_AB=(0.0, 0.0, bottom - 0.05))
    assert alone.check("box", below).outcome is None
    assert whole.check("box", X_WO @ below).outcome is Outcome.COLLISION_TABLE
    assert alone.touched(below) == {} and set(alone.signed_distances(below)) == {"box"}


def test_bad_arguments_are_named(clearance: HandClearance, grasps: np.ndarray) -> None:
    with pytest.raises(InvalidInputError, match=r"margin is -0\.001 m; give .* 0 or more"):
        clearance.measure("mug", grasps, margin=-0.001)
    with pytest.raises(InvalidInputError, match="margin is nan"):
        clearance.measure("mug", grasps, margin=np.nan)
    with pytest.raises(UnknownNameError, match=r"mode 'exakt' does not exist; .*exact"):
        clearance.measure("mug", grasps, mode="exakt")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="'cup'"):
        hand_clearance_alone(load_library("household"), "cup", load_station("panda_tabletop"))
    with pytest.raises(UnknownNameError, match=r"there is no body 'tabel'; .*table"):
        HandClearance(clearance._station_diagram, bodies=["tabel"])
    assert len(clearance.measure("mug", np.empty((0, 4, 4)))) == 0
