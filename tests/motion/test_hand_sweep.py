"""The hand's straight segments against dense samples in Drake, and in scenes with known
clearances."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    UnknownNameError,
    grasp_from_axes,
    pregrasp,
    swap_fingers,
)
from burg_drake.grasping import HandClearance
from burg_drake.motion import HandSweep, SweepResult
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene
from burg_drake.station import GraspMotion, Obstacle, Station, build_station_diagram, load_station

MOTION = GraspMotion()
STANDOFF, LIFT = MOTION.standoff, MOTION.lift_height
AWAY = GraspMotion(retreat=0.06, lift_height=0.2, lift_direction=(0.3, -0.4, 1.0))
CAN = Instance(name="can", object="can", X_SO=Pose((0.4, 0.0, 0.0)))
"""34 mm in radius, 102 mm high."""
X_WG = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, 0.0, 0.09))
"""From above, over the middle of the can."""


def place(*instances: Instance, **background: Obstacle) -> tuple[Scene, Station]:
    """A scene whose frame is the world."""
    station = load_station("panda_tabletop")
    document = replace(station.document, X_WS=Pose(), background=background)
    few = SceneDocument(name="few", library="household", instances=instances)
    scene = Scene(few, load_scene("tabletop_six").library, Path("few.yaml"))
    return scene, replace(station, document=document)


def sweep(*instances: Instance, **background: Obstacle) -> HandSweep:
    return HandSweep(*place(*instances, **background), MOTION)


def drake(*instances: Instance, **background: Obstacle) -> HandClearance:
    scene, station = place(*instances, **background)
    return HandClearance(build_station_diagram(scene, station, robot="hand"))


def block(center: tuple[float, float, float], size: tuple[float, float, float]) -> Obstacle:
    return Obstacle(X_WB=Pose(center), size=size)


def both(
    swept: HandSweep, X: Array, width: float = 0.068, name: str = "can"
) -> tuple[SweepResult, SweepResult]:
    return swept.approach(name, X[None]), swept.lift(name, X[None], np.array([width]))


def roof_at(z: float) -> Obstacle:
    """The lower side at z, far wider than the hand."""
    return block((0.4, 0.0, z + 0.01), (0.8, 0.8, 0.02))


@pytest.fixture(scope="module")
def hand_top() -> float:
    """Where the hand ends at the grasp, by Drake [m]."""
    return 0.5 - drake(CAN, roof=roof_at(0.5)).signed_distances(X_WG)["roof"]


@pytest.mark.parametrize("gap", [1e-3, -1e-3])
def test_a_shelf_over_the_hand(hand_top: float, gap: float) -> None:
    approach, lift = both(sweep(CAN, roof=roof_at(hand_top + LIFT + gap)), X_WG)
    assert approach.free.all() and lift.free.all() == (gap > 0)
    assert lift.clearance[0] == pytest.approx(gap, abs=1e-6)
    if gap < 0:
        assert lift.blocker[0] == "roof" and lift.at[0] == LIFT


@pytest.mark.parametrize("gap", [2e-3, -2e-3])
def test_a_tall_neighbour(gap: float) -> None:
    size = (0.02, 0.02, 0.8)
    distance = drake(CAN, post=block((0.4, 0.1, 0.4), size)).signed_distances(X_WG)["post"]
    for swept in both(sweep(CAN, post=block((0.4, 0.1 - distance + gap, 0.4), size)), X_WG):
        assert swept.free[0] == (gap > 0) and swept.blocker[0] == ("" if gap > 0 else "post")
        assert swept.clearance[0] == pytest.approx(gap, abs=1e-6)
        assert np.isnan(swept.at[0]) == (gap > 0)


def test_a_bar_that_bridges_the_way(hand_top: float) -> None:
    """Between the fingers before the approach, above the hand after it."""
    bar = {"bar": block((0.4, 0.0, hand_top + 0.015), (0.01, 0.5, 0.01))}
    ends = drake(CAN, **bar)
    assert [ends.check("can", X).outcome for X in (X_WG, pregrasp(X_WG, STANDOFF))] == [None, None]
    approach, lift = both(sweep(CAN, **bar), X_WG)
    assert not approach.free[0] and approach.blocker[0] == "bar"
    assert 0.01 < approach.at[0] < STANDOFF and approach.clearance[0] < -0.004
    assert lift.blocker[0] == "bar"


def test_the_target_counts_on_the_approach_alone() -> None:
    low = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, 0.0, 0.05))  # the palm is in the can
    approach, lift = both(sweep(CAN), low)
    assert approach.blocker[0] == "can" and approach.at[0] == 0.0
    assert lift.free[0]


def test_fingers_are_lifted_where_they_hold() -> None:
    """A low post 5 mm within a pad of the open hand, which then moves 7 mm inward."""
    size = (0.02, 0.02, 0.09)
    at_finger = block((0.48, 0.0, 0.045), size)
    distance = drake(CAN, post=at_finger).signed_distances(X_WG)["post"]
    swept = sweep(CAN, post=block((0.48 - distance - 0.005, 0.0, 0.045), size))
    held = swept.lift("can", X_WG[None], np.array([0.066]))
    assert held.free[0] and held.clearance[0] == pytest.approx(0.002, abs=1e-6)
    for width in (0.08, np.nan, 0.2):
        lift = swept.lift("can", X_WG[None], np.array([width]))
        assert lift.blocker[0] == "post" and lift.clearance[0] == pytest.approx(-0.005, abs=1e-4)
    assert swept.approach("can", X_WG[None]).blocker[0] == "post"


@pytest.mark.parametrize(("beside", "hit"), [(0.0, True), (0.041, False)])
def test_the_target_meets_what_the_hand_does_not(beside: float, hit: bool) -> None:
    """A box that is gripped at one end, 60 x 158 x 210 mm, under a bar of 20 mm at the other."""
    box = Instance(name="box", object="box", X_SO=Pose((0.4, 0.0, 0.0)))
    bar = block((0.4 + beside, 0.05, 0.3), (0.02, 0.02, 0.02))
    X = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, -0.05, 0.20))
    approach, lift = both(sweep(box, bar=bar), X, 0.06, "box")
    assert approach.free[0] and lift.free[0] is np.bool_(not hit)
    if hit:
        assert lift.blocker[0] == "bar" and 0.08 < lift.at[0] <= LIFT
        assert lift.clearance[0] == pytest.approx(-0.039, abs=1e-6)  # out to the near end


@pytest.mark.parametrize(("depth", "hit"), [(5e-4, True), (-5e-4, False)])
def test_the_target_gets_no_half_millimetre_into_what_it_does_not_touch(
    depth: float, hit: bool
) -> None:
    """The same box, 210 mm high, lifted to a bar at the other end."""
    box = Instance(name="box", object="box", X_SO=Pose((0.4, 0.0, 0.0)))
    bar = block((0.4, 0.05, 0.21 + LIFT - depth + 0.01), (0.02, 0.02, 0.02))
    X = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, -0.05, 0.20))
    lift = both(sweep(box, bar=bar), X, 0.06, "box")[1]
    assert lift.free[0] is np.bool_(not hit)
    if hit:
        assert lift.blocker[0] == "bar"
        assert lift.clearance[0] == pytest.approx(-depth, abs=1e-6)


def test_what_lies_on_the_target_is_in_its_way_and_not_what_it_lies_on() -> None:
    box = Instance(name="box", object="box", X_SO=Pose((0.4, 0.0, -0.0005)))
    on_it = Instance(name="can", object="can", X_SO=Pose((0.4, 0.03, 0.209)))
    swept = sweep(box, on_it)
    X = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, -0.05, 0.20))
    assert both(swept, X, 0.06, "box")[1].blocker[0] == "can"
    X = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.4, 0.03, 0.30))
    assert both(swept, X)[1].free[0]


def random_grasps(scene: Scene, station: Station, n: int) -> list[tuple[str, Array]]:
    """n grasps about each instance, from above at up to 50 degrees."""
    diagram = build_station_diagram(scene, station, robot="none")
    rng, found = np.random.default_rng(11), []
    for name in diagram.free:
        p_WO = diagram.X_WO(name)[:3, 3] + (0.0, 0.0, 0.08)
        approach = rng.normal(size=(n, 3)) * 0.4 - (0.0, 0.0, 1.0)
        p_WG = p_WO + rng.uniform(-0.06, 0.06, (n, 3))
        found.append((name, grasp_from_axes(rng.normal(size=(n, 3)), approach, p_WG)))
    return found


@pytest.fixture(scope="module")
def shelf() -> tuple[Scene, Station]:
    """A mug between a wall, a can that lies, a marble, and the edge of a roof, under which a box
    stands."""
    return place(
        Instance(object="mug", X_SO=Pose((0.36, 0.1, 0.0), (0.0, 0.0, 140.0))),
        Instance(name="lying", object="can", X_SO=Pose((0.45, 0.0, 0.034), (90.0, 0.0, 30.0))),
        Instance(object="marble", X_SO=Pose((0.4, -0.1, 0.0))),
        Instance(object="box", X_SO=Pose((0.65, 0.0, 0.0), (0.0, 0.0, 20.0))),
        roof=block((0.65, 0.0, 0.46), (0.3, 0.6, 0.02)),
        wall=block((0.25, 0.0, 0.06), (0.02, 0.66, 0.12)),
    )


@pytest.fixture(scope="module")
def swept(shelf: tuple[Scene, Station]) -> HandSweep:
    return HandSweep(*shelf, MOTION)


@pytest.fixture(scope="module")
def swept_away(shelf: tuple[Scene, Station]) -> HandSweep:
    return HandSweep(*shelf, AWAY)


@pytest.fixture(scope="module")
def clearance(shelf: tuple[Scene, Station]) -> HandClearance:
    return HandClearance(build_station_diagram(*shelf, robot="hand"))


def overlapped(clearance: HandClearance, path: Array, closed: float) -> set[str]:
    return {name for X in path for name in clearance.touched(X, closed)}


def test_dense_samples_in_drake_agree(
    shelf: tuple[Scene, Station], swept: HandSweep, clearance: HandClearance
) -> None:
    rng, seen = np.random.default_rng(2), set[tuple[bool, bool]]()
    for name, X in random_grasps(*shelf, 3):
        width = rng.uniform(0.0, 0.08, len(X))
        approach, lift = swept.approach(name, X), swept.lift(name, X, width)
        for i, X_WG in enumerate(X):
            back = np.repeat(X_WG[None], 101, axis=0)
            back[:, :3, 3] -= np.linspace(0.0, STANDOFF, 101)[:, None] * X_WG[:3, 2]
            met = overlapped(clearance, back, 0.0)
            assert approach.free[i] == (not met) and (not met or approach.blocker[i] in met)
            up = np.repeat(X_WG[None], 301, axis=0)
            up[:, 2, 3] += np.linspace(0.0, LIFT, 301)
            met = overlapped(clearance, up, 1.0 - width[i] / 0.08) - {name}
            if name == "box" and not met:  # the box itself meets the roof
                met = {"roof"}
            assert lift.free[i] == (not met) and (not met or lift.blocker[i] in met)
            seen |= {(True, bool(approach.free[i])), (False, bool(lift.free[i]))}
    assert len(seen) == 4


@pytest.mark.thorough
def test_dense_samples_in_drake_agree_on_the_way_back_and_aside(
    shelf: tuple[Scene, Station], swept_away: HandSweep, clearance: HandClearance
) -> None:
    """Of the hand alone, which counts against all: without a target."""
    swept, seen = swept_away, set[tuple[bool, bool]]()
    rng = np.random.default_rng(2)
    for name, X in random_grasps(*shelf, 3):
        width = rng.uniform(0.0, 0.08, len(X))
        retreat, lift = swept.retreat("", X, width), swept.lift("", X, width)
        for i, X_WG in enumerate(X):
            back = np.repeat(X_WG[None], 61, axis=0)
            back[:, :3, 3] -= np.linspace(0.0, AWAY.retreat, 61)[:, None] * X_WG[:3, 2]
            away = np.repeat(back[-1:], 201, axis=0)
            away[:, :3, 3] += np.linspace(0.0, 0.2, 201)[:, None] * AWAY.direction_W
            for way, path in ((retreat, back), (lift, away)):
                met = overlapped(clearance, path, 1.0 - width[i] / 0.08)
                assert way.free[i] == (not met) and (not met or way.blocker[i] in met), name
                seen.add((way is lift, bool(way.free[i])))
    assert len(seen) == 4


BOX = Instance(name="box", object="box", X_SO=Pose((0.4, 0.0, 0.0)))
"""60 x 158 x 210 mm."""


@pytest.mark.parametrize(
    ("slope", "others", "blocker", "depth"),
    [
        (0.0, {}, "", 0.0),  # dragged over the table that it stands on
        (0.1, {}, "", 0.0),  # lifted a little
        (-0.1, {}, "table", 0.005),  # into it
        (0.0, {"sill": block((0.34, 0.0, 0.005), (0.02, 0.3, 0.01))}, "sill", 0.01),
        (0.5, {"sill": block((0.34, 0.0, 0.005), (0.02, 0.3, 0.01))}, "", 0.0),
        (0.0, {"near": block((0.35, 0.0, 0.05), (0.0395, 0.3, 0.1))}, "near", 0.04975),
    ],
)
def test_the_target_goes_back_with_the_hand(
    slope: float, others: dict[str, Obstacle], blocker: str, depth: float
) -> None:
    """From a height at which the hand meets nothing: horizontally, or rising by a share of it."""
    motion = GraspMotion(retreat=0.05 * np.hypot(1.0, slope))
    swept = HandSweep(*place(BOX, **others), motion)
    X = grasp_from_axes((0, 1, 0), (1, 0, -slope), (0.4, 0.0, 0.18))
    back = swept.retreat("box", X[None], np.array([np.nan]))
    assert back.blocker[0] == blocker and back.free[0] is np.bool_(not blocker)
    if blocker:
        assert back.clearance[0] == pytest.approx(-depth, abs=2e-4)


def test_lower_heights_are_free_below_what_ends_the_whole_lift(hand_top: float) -> None:
    swept = sweep(CAN, roof=roof_at(hand_top + 0.137))
    width = np.array([0.068])
    free = [swept.lift("can", X_WG[None], width, h).free[0] for h in (0.02, 0.13, 0.136, 0.138)]
    assert free == [True, True, True, False]
    assert not swept.lift("can", X_WG[None], width).free[0]


def test_a_bound_below_every_sample(
    shelf: tuple[Scene, Station], swept: HandSweep, clearance: HandClearance
) -> None:
    """Signed clearances of the open hand on the way: none below, and one that is nearly it."""
    step, tested = 1e-3, 0
    for name, X in random_grasps(*shelf, 20):
        approach = swept.approach(name, X)
        for i in np.flatnonzero(approach.free)[:3]:
            back = np.repeat(X[i][None], 101, axis=0)
            back[:, :3, 3] -= np.linspace(0.0, STANDOFF, 101)[:, None] * X[i][:3, 2]
            lowest = clearance.measure(name, back).clearance.min()
            assert lowest - step / 2 <= approach.clearance[i] + 1e-8 <= lowest + 2e-8
            tested += 1
    assert tested > 6


def test_a_grasp_alone_and_in_any_batch(
    shelf: tuple[Scene, Station], swept_away: HandSweep
) -> None:
    name, X = random_grasps(*shelf, 8)[0]
    width = np.random.default_rng(3).uniform(0.0, 0.08, len(X))
    order = np.random.default_rng(4).permutation(len(X))
    swept, other = swept_away, HandSweep(*shelf, AWAY)
    for way in ("approach", "retreat", "lift"):
        rows = (lambda i: (X[i],)) if way == "approach" else (lambda i: (X[i], width[i]))
        ask = getattr(other, way)
        alone = [ask(name, *rows(np.array([i]))) for i in range(len(X))]
        for chosen in (np.arange(len(X)), order):
            batch = getattr(swept, way)(name, *rows(chosen))
            for field in ("free", "blocker", "clearance", "at"):
                expected = np.array([getattr(alone[i], field)[0] for i in chosen])
                np.testing.assert_array_equal(getattr(batch, field), expected)
        assert 0 < batch.free.sum() < len(X)
    assert len(swept.approach(name, X[:0])) == len(swept.lift(name, X[:0], width[:0])) == 0


def test_ways_of_no_length_are_the_grasp_itself(
    shelf: tuple[Scene, Station], clearance: HandClearance
) -> None:
    still = HandSweep(*shelf, replace(MOTION, standoff=0.0))
    for name, X in random_grasps(*shelf, 10):
        measured = clearance.measure(name, X)
        approach, lift = still.approach(name, X), still.lift("", X, np.full(len(X), np.nan), 0.0)
        np.testing.assert_array_equal(
            approach.blocker, np.where(approach.free, "", measured.blocker)
        )
        np.testing.assert_array_equal(approach.free, measured.overlap == 0.0)
        np.testing.assert_allclose(approach.clearance, measured.clearance, atol=1e-8)
        np.testing.assert_array_equal(lift.free, approach.free)
        np.testing.assert_allclose(
            lift.clearance[lift.free], approach.clearance[lift.free], atol=1e-8
        )


@pytest.mark.thorough
def test_an_empty_hand(swept: HandSweep, shelf: tuple[Scene, Station]) -> None:
    """All bodies count, on either way."""
    for name, X in random_grasps(*shelf, 10):
        width = np.full(len(X), 0.05)
        np.testing.assert_array_equal(swept.approach("", X).free, swept.approach(name, X).free)
        full, empty = swept.lift(name, X, width), swept.lift("", X, width)
        at_target = empty.blocker == name
        others = ~at_target & (full.blocker != "roof")  # which the box, but no hand, meets
        np.testing.assert_array_equal(empty.blocker[others], full.blocker[others])


def test_swapped_fingers_and_a_turned_world(
    shelf: tuple[Scene, Station], swept_away: HandSweep
) -> None:
    """The direction of the lift turns with the world."""
    scene, station = shelf
    turn = Pose((0.1, -0.05, 0.0), (0.0, 0.0, 37.0)).matrix()
    moved = {
        name: replace(o, X_WB=Pose.from_matrix(turn @ o.X_WB.matrix(), quaternion=True))
        for name, o in station.document.background.items()
    }
    X_WS = Pose.from_matrix(turn @ station.document.X_WS.matrix(), quaternion=True)
    document = replace(station.document, X_WS=X_WS, background=moved)
    direction = tuple((turn[:3, :3] @ AWAY.direction_W).tolist())
    turned = HandSweep(
        scene, replace(station, document=document), replace(AWAY, lift_direction=direction)
    )
    for name, X in random_grasps(scene, station, 3):
        width = np.full(len(X), 0.05)
        ways = [
            (s.approach(name, Y), s.retreat(name, Y, width), s.lift(name, Y, width))
            for s, Y in ((swept_away, X), (swept_away, swap_fingers(X)), (turned, turn @ X))
        ]
        for one, *others in zip(*ways, strict=True):
            for other in others:
                np.testing.assert_array_equal(other.blocker, one.blocker)
                np.testing.assert_allclose(other.clearance, one.clearance, atol=1e-6)


def test_bad_input() -> None:
    scene, station = place(CAN)
    swept = HandSweep(scene, station, MOTION)
    with pytest.raises(UnknownNameError, match=r"instance 'cam' does not exist.*'can'"):
        swept.approach("cam", X_WG[None])
    with pytest.raises(InvalidInputError, match="NaN"):
        swept.lift("can", np.full((1, 4, 4), np.nan), np.array([0.05]))
