"""How far instances can be moved, by closed form and by what Drake says of the two ends."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose, UnknownNameError, make_pose, rot_z
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.station import (
    Obstacle,
    SceneCheck,
    Station,
    StationDocument,
    Table,
    build_station_diagram,
    find_overlaps,
    load_station,
)

DOWN, UP, RIGHT, LEFT, AHEAD = (0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0)
CAN, MARBLE = 0.034, 0.015
"""Radii of the household objects [m]."""
WALL = 0.5
"""Where the wall's face is on the board [m]."""


@pytest.fixture(scope="module")
def library() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="module")
def station() -> Station:
    """A table and a wall, no arm; the board is turned and lies beside the world's origin."""
    panda = load_station("panda_tabletop")
    X_WS = make_pose(rot_z(0.5), (0.3, -0.2, 0.0))
    X_WB = X_WS @ make_pose(p_AB=(WALL + 0.05, 0.2, 0.1))
    document = StationDocument(
        name="bare",
        table=Table(size=(3.0, 3.0, 0.1)),
        X_WS=Pose.from_matrix(X_WS),
        background={"wall": Obstacle(X_WB=Pose.from_matrix(X_WB), size=(0.1, 1.0, 0.2))},
    )
    return Station(document, panda.hand, panda.hand_model, None, Path("bare.yaml"))


@pytest.fixture(scope="module")
def check(station: Station, library: ObjectLibrary) -> SceneCheck:
    return SceneCheck(station, library)


@pytest.fixture(scope="module")
def scene(library: ObjectLibrary) -> Callable[..., Scene]:
    """Objects by name of their kind, at places."""

    def make(**places: tuple[float, ...]) -> Scene:
        instances = tuple(
            Instance(
                name=name,
                object=name.partition("_")[0],
                X_SO=Pose(p[:3], rpy_deg=(0.0, 0.0, p[3] if len(p) > 3 else 0.0)),
            )
            for name, p in places.items()
        )
        document = SceneDocument(name="test", library="household", instances=instances)
        return Scene(document, library, Path("scene.yaml"))

    return make


MakeScene = Callable[..., Scene]


def test_down_to_the_table(check: SceneCheck, scene: MakeScene) -> None:
    for name in ("mug", "bowl", "can", "marble", "banana"):
        above = scene(**{name: (0.2, 0.2, 0.0432)})
        assert check.travel(above, [name], DOWN, 1.0) == pytest.approx(0.0432, abs=1e-6)
        assert check.travel(above, [name], DOWN, 0.01) == 0.01
        assert check.travel(above, [name], UP, 1.0) == 1.0
    aslant = (1.0, 0.0, -1.0)
    assert check.travel(above, ["banana"], aslant, 1.0) == pytest.approx(
        0.0432 * math.sqrt(2.0), abs=1e-6
    )


@pytest.mark.parametrize("height", [1e-6, 1e-12, 0.0, -1e-12, -1e-6, -5e-4])
@pytest.mark.parametrize("name", ["mug", "can", "box"])
def test_what_stands_on_the_table_slides_on_it(
    check: SceneCheck, scene: MakeScene, name: str, height: float
) -> None:
    standing = scene(**{name: (0.2, 0.2, height, 20.0)})
    for direction in (LEFT, AHEAD, (0.3, -0.4, 0.0), UP):
        assert check.travel(standing, [name], direction, 0.15) == 0.15
    assert check.travel(standing, [name], DOWN, 0.1) == pytest.approx(max(height, 0.0), abs=2e-6)


def test_cans_meet_as_circles(check: SceneCheck, scene: MakeScene) -> None:
    for aside in (0.0, 0.03, -0.06):
        cans = scene(can=(0.1, 0.2, 0.0), can_2=(0.35, 0.2 + aside, 0.0))
        expected = 0.25 - math.sqrt((2 * CAN) ** 2 - aside**2)
        assert check.travel(cans, ["can"], RIGHT, 1.0) == pytest.approx(expected, abs=2e-6)
        assert check.travel(cans, ["can_2"], LEFT, 1.0) == pytest.approx(expected, abs=2e-6)
    passing = scene(can=(0.1, 0.2, 0.0), can_2=(0.35, 0.2 + 2 * CAN + 1e-5, 0.0))
    assert check.travel(passing, ["can"], RIGHT, 1.0) == pytest.approx(WALL - 0.1 - CAN, abs=1e-6)


def test_what_moves_together_does_not_meet_itself(check: SceneCheck, scene: MakeScene) -> None:
    row = scene(marble=(0.1, 0.1, 0.0), can=(0.2, 0.1, 0.0), marble_2=(0.4, 0.1, 0.0))
    assert check.travel(row, ["marble"], RIGHT, 1.0) == pytest.approx(0.1 - CAN - MARBLE, abs=2e-6)
    assert check.travel(row, ["marble", "can"], RIGHT, 1.0) == pytest.approx(
        0.2 - CAN - MARBLE, abs=2e-6
    )
    assert check.travel(row, list(row.instances), RIGHT, 1.0) == pytest.approx(
        WALL - 0.4 - MARBLE, abs=1e-6
    )


@pytest.mark.thorough
def test_mug_and_bowl_touch_there_and_not_before(
    check: SceneCheck, scene: MakeScene, station: Station
) -> None:
    """With the handle ahead, which comes over the bowl's rim, and into the bowl from above."""
    for mug, direction in (
        ((0.15, 0.2, 0.0), RIGHT),
        ((0.15, 0.22, 0.0, 100.0), (1.0, 0.05, 0.0)),
        ((0.37, 0.2, 0.2, 45.0), DOWN),
    ):
        start = {"mug": mug, "bowl": (0.37, 0.2, 0.0)}
        way = check.travel(scene(**start), ["mug"], direction, 1.0)
        assert 0.01 < way < 0.25
        unit = np.array(direction) / np.linalg.norm(direction)
        met = []
        for moved in (way - 2e-5, way + 1e-4):
            p = (np.array(mug[:3]) + moved * unit).tolist()
            there = scene(**start | {"mug": (*p, *mug[3:])})
            built = build_station_diagram(there, station, robot="none")
            met.append(find_overlaps(built).get(("mug", "bowl"), 0.0) > 1e-5)
        assert met == [False, True], direction


def test_neighbours_that_touch(check: SceneCheck, scene: MakeScene) -> None:
    """After the way to contact there is no way on, but back, up and along."""
    cans = scene(can=(0.1, 0.2, 0.0), can_2=(0.3, 0.2, 0.0))
    way = check.travel(cans, ["can"], RIGHT, 1.0)
    for more in (-1e-7, 0.0, 1e-6, 5e-4):
        touching = scene(can=(0.1 + way + more, 0.2, 0.0), can_2=(0.3, 0.2, 0.0))
        assert check.travel(touching, ["can"], RIGHT, 0.1) == pytest.approx(0.0, abs=1e-6)
        assert check.travel(touching, ["can"], (1.0, 1.0, 0.0), 0.1) == pytest.approx(0, abs=1e-6)
        for direction in (LEFT, UP, (-1.0, 1.0, 0.0), AHEAD):
            assert check.travel(touching, ["can"], direction, 0.1) == 0.1, (more, direction)
        assert check.travel(touching, ["can", "can_2"], RIGHT, 0.1) == 0.1


def test_what_overlaps_gets_out_but_not_in(check: SceneCheck, scene: MakeScene) -> None:
    inside = scene(can=(0.2, 0.2, 0.0), can_2=(0.24, 0.2, 0.0))
    assert check.travel(inside, ["can"], RIGHT, 0.1) == 0.0
    assert check.travel(inside, ["can"], LEFT, 0.1) == 0.1


def test_the_scene_is_checked_as_before_afterwards(check: SceneCheck, scene: MakeScene) -> None:
    cans = scene(can=(0.2, 0.2, 0.0), can_2=(0.24, 0.2, 0.0))
    before = check.issues(cans)
    assert len(before) == 1
    check.travel(cans, ["can"], RIGHT, 1.0)
    assert check.issues(cans) == before


def test_the_arm_is_in_the_way(scene: MakeScene, library: ObjectLibrary) -> None:
    panda = load_station("panda_tabletop")
    high = scene(can=(0.3, 0.2, 0.0))
    p_SA = np.linalg.inv(panda.document.X_WS.matrix())[:3, 3]
    towards = (*(p_SA[:2] - (0.3, 0.2)), 0.0)
    way = SceneCheck(panda, library).travel(high, ["can"], towards, 5.0)
    far = math.hypot(*towards)
    assert far - 0.2 < way < far - CAN - 0.05


def test_refusals(check: SceneCheck, scene: MakeScene) -> None:
    one = scene(can=(0.2, 0.2, 0.0))
    with pytest.raises(UnknownNameError, match="no 'cann'"):
        check.travel(one, ["cann"], DOWN, 1.0)
    with pytest.raises(InvalidInputError, match="name the instances to move"):
        check.travel(one, [], DOWN, 1.0)
    for direction in ((0.0, 0.0, 0.0), (math.nan, 0.0, 1.0), (1.0, 0.0)):
        with pytest.raises(InvalidInputError, match="three finite numbers"):
            check.travel(one, ["can"], direction, 1.0)
    for limit in (-1.0, math.nan):
        with pytest.raises(InvalidInputError, match=r"at least 0 \[m\]"):
            check.travel(one, ["can"], DOWN, limit)
    assert check.travel(one, ["can"], UP, math.inf) == math.inf


def test_background_moves_and_blocks(check: SceneCheck, scene: MakeScene) -> None:
    cans = scene(can=(0.1, 0.2, 0.0), can_2=(0.3, 0.2, 0.0))
    free, fixed = cans.document.instances
    document = dataclasses.replace(cans.document, instances=(free,), background=(fixed,))
    furnished = Scene(document, cans.library, cans.path)
    expected = pytest.approx(0.2 - 2 * CAN, abs=2e-6)
    assert check.travel(furnished, ["can"], RIGHT, 1.0) == expected
    assert check.travel(furnished, ["can_2"], LEFT, 1.0) == expected
