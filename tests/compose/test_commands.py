"""Effects of commands on poses, measured on the objects' surfaces."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.compose import (
    AddObject,
    Align,
    ComposeSession,
    Distribute,
    Duplicate,
    MoveObjects,
    PutDown,
    RandomConfiguration,
    Rename,
    SessionView,
    SetBoard,
    SetFixed,
    SetPose,
    SnapToContact,
    SnapToGrid,
    Turn,
    board_size,
)
from burg_drake.core import Array, BurgError, InvalidInputError, Pose, make_pose, rotation_from_rpy
from burg_drake.scene import Board
from burg_drake.station import Obstacle, Station

ROUNDED = 2e-6
"""Of poses as people read them [m]."""


def span(view: SessionView, name: str) -> Array:
    """(2, 3) bounds of an instance's surface in the scene [m]."""
    mesh = view.library.surface(view.instances[name].object)
    mesh.apply_transform(view.X_SO(name))
    return np.asarray(mesh.bounds)


def center_of_mass(view: SessionView, name: str) -> Array:
    p_OOcm = view.state.entry(name).mass_properties.center_of_mass
    return np.asarray((view.X_SO(name) @ (*p_OOcm, 1.0))[:3])


@pytest.fixture
def three(session: ComposeSession) -> ComposeSession:
    """A box, a can and a marble, separate on an A2 board."""
    session.do(SetBoard(Board(size=board_size("A2"))))
    session.do(AddObject("box", position=(0.15, 0.15), yaw_deg=20.0))
    session.do(AddObject("can", position=(0.33, 0.2)))
    assert set(session.do(AddObject("marble", position=(0.5, 0.35))).status.values()) == {"ok"}
    return session


def test_objects_are_added_where_they_are_free(session: ComposeSession) -> None:
    session.do(SetBoard(Board(size=board_size("A2"))))
    for object in ("can", "box", "can", "bottle", "bowl", "screwdriver"):
        view = session.do(AddObject(object))
        assert set(view.status.values()) == {"ok"}, object
    assert list(view.instances) == [*("can", "box", "can_2", "bottle", "bowl", "screwdriver")]
    np.testing.assert_allclose(center_of_mass(view, "can")[:2], (0.297, 0.21), atol=0.03)


def test_objects_are_added_as_their_mesh_stands(three: ComposeSession) -> None:
    """Dropped, a box comes to lie flat most often; its mesh stands upright, which is stable."""
    box = three.view.library.entry("box")
    assert box.X_SO(0)[2, 2] == pytest.approx(0.0, abs=1e-6)
    added = three.do(AddObject("box"))
    assert added.X_SO("box_2")[2, 2] == pytest.approx(1.0)
    flat = three.do(AddObject("box", 0))
    assert flat.X_SO("box_3")[2, 2] == pytest.approx(0.0, abs=1e-6)


def test_another_stable_pose_keeps_place_and_turn(three: ComposeSession) -> None:
    before = three.view
    lying = three.do(SetPose(("box",), 0))
    np.testing.assert_allclose(
        center_of_mass(lying, "box")[:2], center_of_mass(before, "box")[:2], atol=ROUNDED
    )
    assert span(lying, "box")[0, 2] == pytest.approx(0.0, abs=1e-5)
    assert span(lying, "box")[1, 2] != pytest.approx(span(before, "box")[1, 2], abs=1e-3)
    back = three.do(SetPose(("box",), 2))
    np.testing.assert_allclose(back.X_SO("box"), before.X_SO("box"), atol=2e-5)


@pytest.mark.parametrize(
    ("edge", "axis", "side"), [("left", 0, 0), ("right", 0, 1), ("bottom", 1, 0), ("top", 1, 1)]
)
def test_edges_are_aligned(three: ComposeSession, edge: str, axis: int, side: int) -> None:
    before = [span(three.view, name)[side, axis] for name in three.view.instances]
    view = three.do(Align(tuple(three.view.instances), edge))  # type: ignore[arg-type]
    outermost = (min, max)[side](before)
    for name in view.instances:
        assert span(view, name)[side, axis] == pytest.approx(outermost, abs=ROUNDED)


def test_gaps_become_equal(three: ComposeSession) -> None:
    view = three.do(Distribute(("marble", "box", "can"), "x"))
    spans = [span(view, name)[:, 0] for name in ("box", "can", "marble")]
    gaps = [right[0] - left[1] for left, right in itertools.pairwise(spans)]
    assert gaps[0] == pytest.approx(gaps[1], abs=2 * ROUNDED)


def test_origins_come_onto_the_grid(three: ComposeSession) -> None:
    view = three.do(SnapToGrid(("box", "can"), 0.02))
    for name in ("box", "can"):
        xy = view.X_SO(name)[:2, 3]
        np.testing.assert_allclose(xy, np.round(xy / 0.02) * 0.02, atol=ROUNDED)


def test_turning_keeps_the_middle(three: ComposeSession) -> None:
    middle = span(three.view, "box").mean(axis=0)
    view = three.do(Turn(("box",), 180.0))
    np.testing.assert_allclose(span(view, "box").mean(axis=0), middle, atol=1e-5)


def test_objects_go_until_they_touch_or_are_at_the_edge(session: ComposeSession) -> None:
    session.do(AddObject("can", 1, position=(0.1, 0.15)))
    session.do(AddObject("can", 1, position=(0.3, 0.15)))
    view = session.do(SnapToContact(("can",), "x"))
    between = center_of_mass(view, "can_2") - center_of_mass(view, "can")
    diameter = np.ptp(span(view, "can")[:, 0])
    assert np.linalg.norm(between[:2]) == pytest.approx(diameter, rel=0.01)  # a can of many sides
    assert set(view.status.values()) == {"ok"}
    view = session.do(SnapToContact(("can", "can_2"), "-y"))
    assert span(view, "can")[0, 1] == pytest.approx(0.0, abs=ROUNDED)


def test_what_hovers_is_put_on_what_is_below(session: ComposeSession) -> None:
    session.do(AddObject("box", position=(0.2, 0.15)))
    session.do(AddObject("marble", position=(0.2, 0.15)))
    session.restrict_movement(False)
    X_SO = session.view.X_SO("marble")
    X_SO[2, 3] += 0.4
    status = session.do(MoveObjects({"marble": X_SO})).status
    assert (status["marble"], status["box"]) == ("hovering", "ok")
    view = session.do(PutDown(("marble",)))
    assert set(view.status.values()) == {"ok"}
    top = span(view, "box")[1, 2]
    assert span(view, "marble")[0, 2] == pytest.approx(top, abs=2e-4)  # a marble of many faces
    X_SO[2, 3] = -0.05
    X_SO[0, 3] = 0.05
    assert session.do(MoveObjects({"marble": X_SO})).status["marble"] == "in_ground"
    view = session.do(PutDown(("marble",)))
    assert span(view, "marble")[0, 2] == pytest.approx(0.0, abs=ROUNDED)
    X_SO = view.X_SO("box")
    X_SO[2, 3] -= 1.2e-3
    assert session.do(MoveObjects({"box": X_SO})).status["box"] == "sunken"


def test_planar_movement_takes_place_and_yaw_alone(three: ComposeSession) -> None:
    before = three.view.X_SO("box")
    yaw = make_pose(rotation_from_rpy((0.0, 0.0, 0.5)))
    tilt = make_pose(rotation_from_rpy((0.05, 0.0, 0.0)), (0.2, 0.1, 0.3))
    X_SO = three.do(MoveObjects({"box": tilt @ yaw @ before})).X_SO("box")
    assert X_SO[2, 3] == before[2, 3]
    np.testing.assert_allclose(X_SO[2, :3], before[2, :3], atol=2e-6)  # tilt
    raised = three.do(MoveObjects({"box": tilt @ yaw @ before}, changes_height=True)).X_SO("box")
    assert raised[2, 3] == pytest.approx((tilt @ yaw @ before)[2, 3], abs=1e-6)
    np.testing.assert_array_equal(raised[2, :3], X_SO[2, :3])
    turn = X_SO[:3, :3] @ before[:3, :3].T
    assert np.arctan2(turn[1, 0], turn[0, 0]) == pytest.approx(0.5, abs=2e-3)


def test_copies_stand_beside_and_keep_their_places_to_one_another(three: ComposeSession) -> None:
    three.do(SetFixed(("can",)))
    view = three.do(Duplicate(("marble", "can")))
    assert view.selection == ("marble_2", "can_2")
    assert [i.object for i in view.document.background] == ["can", "can"]
    assert set(view.status.values()) == {"ok"}
    np.testing.assert_allclose(
        view.X_SO("marble_2")[:3, 3] - view.X_SO("marble")[:3, 3],
        view.X_SO("can_2")[:3, 3] - view.X_SO("can")[:3, 3],
        atol=ROUNDED,
    )


def test_what_is_added_overlaps_nothing_and_is_refused_without_room(
    station: Station, tmp_path: Path
) -> None:
    post = Obstacle(size=(0.06, 0.06, 0.2), X_WB=Pose(translation=(0.21, 0.15, 0.1)))
    posted = replace(station, document=replace(station.document, background={"post": post}))
    with ComposeSession.open("household", posted, folder=tmp_path) as session:
        added = 0
        with pytest.raises(InvalidInputError, match=r"there is no free place for '.*' on the"):
            for name in 3 * ("box", "mug", "can", "marble", "banana"):
                assert set(session.do(AddObject(name)).status.values()) == {"ok"}
                added += 1
        assert added >= 4
        for names in (("marble",), tuple(session.view.instances)):
            assert "collision" not in session.do(Duplicate(names)).status.values()


def test_how_far_a_selected_object_is_above_what_is_below(three: ComposeSession) -> None:
    """A box above the board, and a marble above it."""
    assert three.select(("box",)).gaps == {}
    box = three.view.X_SO("box")
    box[2, 3] += 0.1
    assert three.do(MoveObjects({"box": box}, changes_height=True)).gaps == {
        "box": pytest.approx(0.1, abs=2e-4)
    }
    (x, y, _), top = span(three.view, "box").mean(axis=0), span(three.view, "box")[1, 2]
    marble = three.view.X_SO("marble")
    marble[:3, 3] = x, y, top + marble[2, 3] + 0.03
    view = three.do(MoveObjects({"marble": marble}, changes_height=True))
    assert view.gaps == {"marble": pytest.approx(0.03, abs=1e-3)}
    assert three.select(()).gaps == {}


def test_a_random_configuration_is_that_of_its_seed(three: ComposeSession) -> None:
    first = three.do(RandomConfiguration(1)).document
    assert set(three.view.instances) == {"box", "can", "marble"}
    assert set(three.view.status.values()) == {"ok"}
    assert three.do(RandomConfiguration(2)).document != first
    assert three.do(RandomConfiguration(1)).document == first
    assert len(three.do(RandomConfiguration(1, count=5)).instances) == 5


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (AddObject("cann"), "object 'cann' is not in library"),
        (AddObject("can", 9), "'can': stable pose 9 does not exist; give 0 to 1"),
        (AddObject("can", position=(0.1, np.inf)), "y of the new 'can' is inf; give a number from"),
        (
            MoveObjects({"box": make_pose(p_AB=(0.0, 0.0, 200.0))}),
            "z of 'box' is 200; give a number from",
        ),
        (MoveObjects({}), "nothing is selected; select 1 or more objects"),
        (Align(("box",), "left"), "only 'box' is selected; select 2 or more objects"),
        (SnapToGrid(("box",), float("nan")), "spacing of the grid is nan; give a number from"),
        (Rename("box", "can"), "name 'can' is used already; choose another one"),
        (Rename("box", "table"), "name 'table' is used by station 'wsg_tabletop'"),
        (Rename("box", "../x"), "name '../x' cannot be used in paths"),
        (Rename("bax", "x"), "has no instance 'bax'; did you mean 'box'?"),
        (RandomConfiguration(0, count=60, repeat=True), "60 objects need more area than the board"),
        (RandomConfiguration(0, count=9, layout="wide"), "the board has no room for"),
        (SetBoard(Board(size=(0.04, 0.04))), "do not fit on a board of 40 x 40 mm"),
    ],
)
def test_a_refusal_says_what_would_be_right(
    three: ComposeSession, command: object, message: str
) -> None:
    before = three.view
    with pytest.raises(BurgError) as refused:
        three.do(command)  # type: ignore[arg-type]
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert three.view is before
