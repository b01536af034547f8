"""Arms of which nothing needs to be asked: one line, before a folder is made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Pose
from burg_drake.evaluation import EvaluationSettings, evaluate, reach
from burg_drake.motion import require_usable_arm
from burg_drake.scene import Scene
from burg_drake.station import Obstacle, Station, load_station
from tests.evaluation.composed import tabletop

pytestmark = pytest.mark.usefixtures("judged_here")

NOTHING: dict[str, GraspSet] = {}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return tabletop("bowl")


def changed(**changes: object) -> Station:
    station = load_station("panda_tabletop")
    return replace(station, document=replace(station.document, **changes))  # type: ignore[arg-type]


def with_box(x: float, z: float, size: tuple[float, float, float]) -> Station:
    return changed(background={"post": Obstacle(X_WB=Pose((x, 0.0, z)), size=size)})


def moved_back(distance: float) -> Station:
    station = load_station("panda_tabletop")
    arm, table = station.document.arm, station.document.table
    assert arm is not None
    return changed(
        arm=replace(arm, X_WA=Pose((-distance, 0.0, 0.0))), table=replace(table, size=(9, 9, 0.1))
    )


UNUSABLE = {
    "home": (
        "arm",
        with_box(0.36, 0.55, (0.1, 0.4, 0.1)),
        "at arm.home the arm collides in scene 'tabletop_six': panda_hand with post",
    ),
    "base": (
        "reach",
        with_box(0.15, 0.1, (0.2, 0.1, 0.2)),
        "arm.X_WA puts the arm's base 21 mm deep into 'post' by its collision shapes (panda_link0",
    ),
    "board": (
        "reach",
        moved_back(3.0),
        "no part of the board is within reach: its nearest point is 3.26 m from the arm's shoulder,"
        " and the arm reaches 0.95 m at most; change X_WS or arm.X_WA",
    ),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_it_is_refused_before_a_folder_is_made(case: str, scene: Scene, tmp_path: Path) -> None:
    mode, station, message = UNUSABLE[case]
    run, plans = tmp_path / "run", tmp_path / "plans"
    with pytest.raises(InvalidInputError) as error:
        evaluate(
            scene,
            station,
            run,
            settings=EvaluationSettings(mode=mode),
            grasps=NOTHING,
            progress=False,
        )  # type: ignore[arg-type]
    assert str(error.value).startswith(f"{station.path}: {message}")
    with pytest.raises(InvalidInputError) as other:
        reach(scene, station, NOTHING, plans=plans)
    assert str(other.value) == str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_without_the_fault_the_same_call_goes_through(scene: Scene, tmp_path: Path) -> None:
    station = load_station("panda_tabletop")
    assert evaluate(scene, station, tmp_path / "run", grasps=NOTHING, progress=False).complete


def test_the_hand_alone_does_not_mind(scene: Scene, tmp_path: Path) -> None:
    _, station, _ = UNUSABLE["home"]
    run = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(mode="hand"),
        grasps=NOTHING,
        progress=False,
    )
    assert run.complete


def test_objects_out_of_reach_are_told(scene: Scene) -> None:
    assert require_usable_arm(scene, load_station("panda_tabletop")) == ()
    told = require_usable_arm(scene, moved_back(0.6))
    assert any(line.startswith("'bowl' is out of reach: it is 1.") for line in told)
    assert require_usable_arm(scene, load_station("wsg_tabletop")) == ()


def test_a_grasp_of_an_object_out_of_reach(scene: Scene) -> None:
    """Above the bowl, in thin air: the hand is clear, and no configuration gets there."""
    X_OG = np.diag([1.0, -1.0, -1.0, 1.0])
    X_OG[2, 3] = 0.2
    given = GraspSet.create(X_OG, object="bowl")
    found = reach(scene, moved_back(0.6), given, exact=False, workers=1)
    assert found.column("outcome").tolist() == ["no_ik"]
    assert found.provenance["reach"]["exact"] is False
