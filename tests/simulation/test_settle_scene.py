"""Stacks, heaps and rolling balls come to rest, or it is told what still moves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trial_world import GRAVITY, from_above, make_station

from burg_drake.core import InvalidInputError, Outcome, Pose, inverse
from burg_drake.objects import load_library
from burg_drake.scene import Instance, ObjectShapes, Scene, SceneDocument
from burg_drake.simulation import (
    HandTrial,
    SettledScene,
    drop_onto_scene,
    is_still,
    measure_drift,
    settle_scene,
)
from burg_drake.station import (
    ENGINES,
    build_station_diagram,
    check_scene,
    find_overlaps,
    load_station,
)
from tests.thorough import thorough

EDGE = 0.05
"""Of the blocks [m]; they stand on their origins."""


def placed(name: str, object: str, x: float, y: float, z: float, **options) -> Instance:
    return Instance(name=name, object=object, X_SO=Pose((x, y, z), **options))


@pytest.fixture(scope="module")
def stack(make_scene) -> Scene:
    """Three blocks, 1 mm above each other, the upper ones turned."""
    return make_scene(
        placed("low", "block", 0.3, 0.2, 0.001),
        placed("middle", "block", 0.303, 0.2, EDGE + 0.002, rpy_deg=(0.0, 0.0, 5.0)),
        placed("high", "block", 0.298, 0.202, 2 * EDGE + 0.003, rpy_deg=(0.0, 0.0, -3.0)),
    )


@pytest.fixture(scope="module")
def settled(stack: Scene) -> SettledScene:
    return settle_scene(stack, make_station())


@pytest.fixture(scope="module")
def settled_stack(settled: SettledScene) -> Scene:
    return settled.scene


def test_a_stack_stays_a_stack(settled: SettledScene) -> None:
    assert settled.at_rest and settled.fallen == () and settled.duration < 1.0
    for k, name in enumerate(("low", "middle", "high")):
        fall = 0.001 * (k + 1)
        assert settled.scene.X_SO(name)[2, 3] == pytest.approx(k * EDGE, abs=3e-4)
        assert settled.displacements[name].distance == pytest.approx(fall, abs=5e-4)
        assert settled.displacements[name].angle < 0.01


def test_what_is_settled_stays_where_it_is(settled_stack: Scene) -> None:
    again = settle_scene(settled_stack, make_station())
    assert again.at_rest
    assert max(moved.distance for moved in again.displacements.values()) < 1e-4


def test_the_board_may_lie_anywhere(stack: Scene, settled_stack: Scene) -> None:
    station = make_station(Pose((0.4, -0.1, 0.0), rpy_deg=(0.0, 0.0, 37.0)))
    moved = settle_scene(stack, station)
    for name in stack.instances:
        difference = inverse(settled_stack.X_SO(name)) @ moved.scene.X_SO(name)
        np.testing.assert_allclose(difference, np.eye(4), atol=2e-3)


@pytest.mark.thorough
def test_a_heap_of_household_objects(tmp_path) -> None:
    """What leans on others may creep on, and is named then."""
    library = load_library("household")
    instances = (
        placed("bowl", "bowl", 0.3, 0.2, 0.0),
        placed("screwdriver", "screwdriver", 0.3, 0.2, 0.3),
    )
    document = SceneDocument(name="heap", library="household", instances=instances)
    heap = Scene(document, library, tmp_path / "heap.yaml")
    settled = settle_scene(heap, make_station())
    assert not settled.fallen
    assert all(v.speed < 1e-3 and v.turning < 0.02 for v in settled.moving.values())
    assert settled.displacements["screwdriver"].distance > 0.2
    depths = find_overlaps(build_station_diagram(settled.scene, make_station(), robot="none"))
    assert max(depths.values()) < 1e-3


def test_what_only_seems_to_creep_at_first_is_at_rest(tmp_path) -> None:
    """A can that has come to rest: of its pose only the rounded digits are not in equilibrium."""
    pose = {"rpy_deg": (90.8228, 85.2632, 121.3462)}
    can = placed("can", "can", 0.356232, 0.087259, 0.03361, **pose)
    document = SceneDocument(name="can", library="household", instances=(can,))
    scene = Scene(document, load_library("household"), tmp_path / "can.yaml")
    settled = settle_scene(scene, load_station("panda_tabletop"))
    assert settled.at_rest and settled.scene.instances["can"] == can


def test_what_falls_when_time_is_up_is_named_with_its_speed(make_scene) -> None:
    """The mean speed of the last 40 ms is that of free fall at their middle."""
    scene = make_scene(("block", 0.2, 0.2, 0.0), placed("high", "ball", 0.4, 0.2, 1.0))
    settled = settle_scene(scene, make_station(), engine=ENGINES["standard"], time_limit=0.2)
    assert not settled.at_rest and list(settled.moving) == ["high"]
    assert settled.moving["high"].speed == pytest.approx(GRAVITY * 0.18, rel=0.02)
    assert settled.displacements["high"].distance == pytest.approx(GRAVITY * 0.2**2 / 2, rel=0.02)


def test_a_ball_that_rolls_away(make_scene) -> None:
    """It lies on the edge of a block, rolls off, and on along the table."""
    scene = make_scene(
        ("block", 0.3, 0.2, 0.0), placed("ball", "ball", 0.3 + EDGE / 2 - 0.002, 0.2, EDGE)
    )
    early = settle_scene(scene, make_station(), time_limit=1.0)
    assert list(early.moving) == ["ball"]
    speed = early.moving["ball"]
    assert speed.speed == pytest.approx(speed.turning * 0.03, rel=0.1)  # it rolls, on its radius
    late = settle_scene(scene, make_station(), time_limit=20.0)
    assert late.at_rest
    assert late.scene.X_SO("ball")[0, 3] > early.scene.X_SO("ball")[0, 3] > 0.35
    assert late.displacements["block"].distance < 0.005


def test_what_lands_is_kept_on_the_board(make_scene) -> None:
    """The ball rolls off a block that holds still, and would roll on over the edge."""
    scene = make_scene(
        ("block", 0.48, 0.2, 0.0), placed("ball", "ball", 0.48 + EDGE / 2 + 0.005, 0.2, EDGE)
    )
    width = scene.board.size[0]
    assert settle_scene(scene, make_station()).scene.X_SO("ball")[0, 3] > width
    landed = drop_onto_scene(scene, make_station(), ["ball"], ObjectShapes(scene.library), 0.03)
    center = (landed.X_SO("ball") @ (0.0, 0.0, 0.03, 1.0))[0]  # of the ball, whose radius is 30 mm
    assert 0.53 < center < width - 0.03 - 0.03 + 0.003
    assert landed.instances["block"] == scene.instances["block"]  # to the last digit


def test_what_sinks_into_the_table_is_let_go_unless_it_is_deep(make_scene) -> None:
    settled = settle_scene(make_scene(placed("low", "block", 0.3, 0.2, -0.002)), make_station())
    assert settled.at_rest
    assert settled.scene.X_SO("low")[2, 3] == pytest.approx(0.0, abs=2e-4)
    with pytest.raises(InvalidInputError, match="'low' and 'table' overlap by"):
        settle_scene(make_scene(placed("low", "block", 0.3, 0.2, -0.008)), make_station())


@pytest.mark.parametrize("pose", [0, thorough(1), thorough(2)])
def test_what_sinks_in_on_tips_is_lifted_out_of_the_table(pose: int, tmp_path) -> None:
    """The airplane sinks in by 1.7 to 2.4 mm on its wheels and its wing tips."""
    library = load_library("household")
    X_SO = library.entry("airplane").stable_poses[pose].X_SO.matrix()
    X_SO[:2, 3] += (0.3, 0.2)
    airplane = Instance(object="airplane", X_SO=Pose.readable(X_SO))
    document = SceneDocument(name="airplane", library="household", instances=(airplane,))
    scene = Scene(document, library, tmp_path / "airplane.yaml")
    settled = settle_scene(scene, make_station())
    assert settled.at_rest
    surface = library.surface("airplane").vertices @ settled.scene.X_SO("airplane")[2, :3]
    lowest = surface.min() + settled.scene.X_SO("airplane")[2, 3]
    assert lowest == pytest.approx(0.0, abs=6e-4)
    assert check_scene(settled.scene, make_station()) == ()
    moved = measure_drift(settled.scene, make_station(), duration=1.0)
    assert is_still(moved), moved


@pytest.mark.parametrize("tilt", [(90.0, 0.0, 0.0), (80.0, 0.0, 20.0), (30.0, 20.0, 0.0)])
def test_the_depth_in_the_table_is_that_of_validate(make_scene, tilt) -> None:
    """A can whose lower rim was put 8.7 mm deep, by the closed form of its tilted ends."""
    down = np.abs(Rotation.from_euler("xyz", tilt, degrees=True).as_matrix()[2, 2])
    reach = 0.03 * np.sqrt(max(0.0, 1.0 - down**2)) + 0.05 * down
    center = Rotation.from_euler("xyz", tilt, degrees=True).apply((0.0, 0.0, 0.05))[2]
    can = placed("low", "can", 0.3, 0.2, reach - center - 0.0087, rpy_deg=tilt)
    scene = make_scene(can)
    (issue,) = check_scene(scene, make_station())
    assert issue.amount == pytest.approx(0.0087, abs=1e-4)
    with pytest.raises(InvalidInputError, match=r"overlap by 8\.7 mm"):
        settle_scene(scene, make_station())


def test_background_stays_and_carries(make_scene) -> None:
    scene = make_scene(("block", 0.1, 0.1, 0.0), placed("top", "block", 0.4, 0.2, 0.252))
    shelf = placed("shelf", "block", 0.4, 0.2, 0.2)
    document = SceneDocument(
        name="shelf",
        library=scene.document.library,
        instances=scene.document.instances,
        background=(shelf,),
    )
    settled = settle_scene(Scene(document, scene.library, scene.path), make_station())
    assert settled.at_rest
    assert settled.scene.background == {"shelf": shelf}
    assert settled.scene.X_SO("top")[2, 3] == pytest.approx(0.25, abs=2e-4)
    assert settled.displacements.keys() == {"block", "top"}
    assert settled.scene.instances["block"] == scene.instances["block"]  # to the last digit


def test_what_falls_off_the_table_is_left_out(make_scene) -> None:
    scene = make_scene(("block", 0.3, 0.2, 0.0), placed("gone", "block", 5.0, 0.2, 0.0))
    settled = settle_scene(scene, make_station())
    assert settled.fallen == ("gone",) and not settled.moving and not settled.at_rest
    assert list(settled.scene.instances) == list(settled.displacements) == ["block"]
    assert settled.duration < 2.0


def test_clear_errors(make_scene) -> None:
    scene = make_scene(("block", 0.3, 0.2, 0.0), placed("other", "block", 0.33, 0.2, 0.0))
    with pytest.raises(InvalidInputError, match=r"'block' and 'other' overlap by 20\.0 mm and"):
        settle_scene(scene, make_station())
    with pytest.raises(InvalidInputError, match="time limit is 0 s; give more than 0"):
        settle_scene(scene, make_station(), time_limit=0.0)


def test_the_top_of_a_stack_is_lifted_off(settled_stack: Scene) -> None:
    """The one below is touched from the start, and stays where it is."""
    trial = HandTrial(settled_stack, make_station())
    result = trial.run("high", from_above(0.035))
    assert result.outcome is Outcome.LIFTED
    assert result.displacements.keys() == {"low", "middle"}
    assert 0.0 < result.displacements["middle"] < 0.005
    free = HandTrial(settled_stack, make_station(), lock=False).run("high", from_above(0.035))
    assert free.outcome is result.outcome
    assert free.margins.others_moved == pytest.approx(result.margins.others_moved, abs=5e-3)
