"""Why there is no motion, and which reason comes first.

A gantry has one configuration for each place of its hand, which points down: what is in the way,
and how far a limit is off, can be told by eye. `X` is across the closing direction of its fingers.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gantry import UPPER, box, gantry_diagram

import burg_drake as burg
from burg_drake.core import Array, Outcome, Pose, grasp_from_axes
from burg_drake.motion import ArmReach, Failure, Reach, ReachSettings, SuccessiveLineSearch
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Obstacle, load_station

DOWN = (0.0, 0.0, -1.0)
Z = 0.3
"""Height of the grasps [m]."""
TCP = 0.1034
"""From the grasp to the hand's origin [m]. The gantry's block begins 75 mm above that, ends 125 mm
above it, and reaches 50 mm to the front, where the hand reaches 32 mm."""
LOW, HIGH = Z + TCP + 0.075, Z + TCP + 0.125
"""Of the block at the grasp [m]."""


def in_front(low: float, high: float) -> Obstacle:
    """In front of the hand, where only the block gets to; between two heights [m]."""
    return box((0.54, -0.05, low), (0.56, 0.05, high))


POST = in_front(0.0, LOW + 0.005)
"""Met at the grasp, 5 mm deep."""
HALFWAY = in_front(HIGH + 0.015, HIGH + 0.03)
"""Met between the pregrasp, 100 mm up, and the grasp."""
ABOVE = in_front(HIGH + 0.2, HIGH + 0.22)
"""Met on the lift alone."""
IN_THE_HAND = box((0.49, -0.2, Z - 0.01), (0.51, 0.2, Z + 0.01))
CEILING = box((0.49, -0.03, Z + 0.3 + 0.02), (0.51, 0.03, Z + 0.3 + 0.04))
"""Between the fingers on the lift; met by the palm."""
CAGE = {
    "front": box((0.30, -0.25, 0.0), (0.32, 0.25, 1.2)),
    "back": box((0.68, -0.25, 0.0), (0.70, 0.25, 1.2)),
    "right": box((0.32, -0.25, 0.0), (0.68, -0.23, 1.2)),
    "left": box((0.32, 0.23, 0.0), (0.68, 0.25, 1.2)),
}


def gantry(folder: Path, **background: Obstacle) -> ArmReach:
    diagram = gantry_diagram(folder, **background)
    return ArmReach(diagram.scene, diagram.station)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> ArmReach:
    """With nothing in the way."""
    return gantry(tmp_path_factory.mktemp("gantry"))


def at(reach: ArmReach, x: float = 0.5, z: float = Z, approach: tuple[float, ...] = DOWN) -> Reach:
    return reach.check("", grasp_from_axes((0.0, 1.0, 0.0), approach, (x, 0.0, z)))


def test_nothing_in_the_way(alone: ArmReach) -> None:
    assert at(alone).outcome is None


def test_what_only_the_flange_meets_at_the_grasp_is_an_arm_collision(tmp_path: Path) -> None:
    found = at(gantry(tmp_path, post=POST))
    assert (found.outcome, found.blocker) == (Outcome.ARM_COLLISION, "z_link vs post")
    assert found.clearance == pytest.approx(-0.005, abs=1e-3) and np.isnan(found.excess)


def test_what_is_met_on_the_way_there_fails_the_approach_line(tmp_path: Path) -> None:
    found = at(gantry(tmp_path, bar=HALFWAY))
    assert (found.outcome, found.blocker) == (Outcome.APPROACH_LINE, "z_link vs bar")
    assert found.clearance < 0.0


def test_what_is_met_on_the_way_up_fails_the_lift_line(tmp_path: Path) -> None:
    found = at(gantry(tmp_path, bar=ABOVE))
    assert (found.outcome, found.blocker) == (Outcome.LIFT_LINE, "z_link vs bar")
    assert found.clearance < 0.0


def test_a_cage_leaves_no_path(tmp_path: Path) -> None:
    reach = gantry(tmp_path, **CAGE)
    assert at(reach).outcome is Outcome.NO_PATH
    assert at(reach, x=0.2).outcome is None


def test_a_joint_limit_is_told_with_what_is_missing(alone: ArmReach) -> None:
    found = at(alone, x=UPPER[0] + 0.05)
    assert found.outcome is Outcome.JOINT_LIMIT and not found.blocker
    assert found.excess == pytest.approx(0.05 + ReachSettings().limit_margin, abs=1e-6)


def test_a_limit_on_the_way_up_fails_the_lift_line(alone: ArmReach) -> None:
    found = at(alone, z=UPPER[2] - TCP - 0.2)
    assert found.outcome is Outcome.LIFT_LINE and not found.blocker and not found.reason
    assert found.excess == pytest.approx(0.1 + ReachSettings().limit_margin, abs=1e-6)


def test_a_gantry_does_not_tilt(alone: ArmReach) -> None:
    found = at(alone, approach=(0.3, 0.0, -1.0))
    assert found.outcome is Outcome.NO_IK and np.isnan(found.excess)


@pytest.mark.parametrize(
    ("background", "where", "outcome"),
    [
        ({"low": IN_THE_HAND, "high": CEILING}, {}, Outcome.HAND_COLLISION_APPROACH),
        ({"high": CEILING}, {"approach": (0.05, 0.0, -1.0)}, Outcome.HAND_COLLISION_LIFT),
        ({"post": box((1.0, -0.05, 0.0), (1.02, 0.05, LOW))}, {"x": 0.96}, Outcome.JOINT_LIMIT),
        ({"post": POST, "bar": ABOVE}, {}, Outcome.ARM_COLLISION),
        ({"near": HALFWAY, "far": ABOVE}, {}, Outcome.APPROACH_LINE),
        ({"bar": ABOVE, **CAGE}, {}, Outcome.LIFT_LINE),
    ],
)  # fmt: skip
def test_what_fails_first_is_told(
    tmp_path: Path,
    background: dict[str, Obstacle],
    where: dict[str, object],
    outcome: Outcome,
) -> None:
    assert at(gantry(tmp_path, **background), **where).outcome is outcome  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def empty() -> Scene:
    scene = load_scene("tabletop_six")
    return Scene(replace(scene.document, instances=(), background=()), scene.library, scene.path)


def panda(scene: Scene, **background: Obstacle) -> ArmReach:
    """The Panda, which has a closed form and a joint to spare."""
    station = load_station("panda_tabletop")
    station = replace(station, document=replace(station.document, background=background))
    return ArmReach(scene, station, settings=ReachSettings())


def test_a_roof_over_the_wrist_fails_the_lift_line(empty: Scene) -> None:
    """The roof is 0.45 m over the grasp, to where the hand just does not get; the last axes but one
    are 0.21 m above the grasp, and the links around them reach 0.05 m farther."""
    place = (0.5, 0.0, 0.1)
    roof = Obstacle(X_WB=Pose((0.5, 0.0, 0.1 + 0.46)), size=(0.14, 0.14, 0.02))
    X_WG = grasp_from_axes((0.0, 1.0, 0.0), DOWN, place)
    found = panda(empty, roof=roof).check("", X_WG)
    assert found.outcome is Outcome.LIFT_LINE and found.clearance < 0.0
    assert found.blocker in [f"panda_link{k} vs roof" for k in (5, 6, 7)]


def test_posts_that_the_last_link_meets_at_the_grasp(empty: Scene) -> None:
    """On both sides of the hand, so that they are in the way with the fingers either way."""
    posts = {
        name: Obstacle(X_WB=Pose((0.5 + x, 0.0, 0.1)), size=(0.015, 0.03, 0.28))
        for name, x in (("front", 0.048), ("behind", -0.048))
    }
    X_WG = grasp_from_axes((0.0, 1.0, 0.0), DOWN, (0.5, 0.0, 0.1))
    found = panda(empty, **posts).check("", X_WG)
    assert found.outcome is Outcome.ARM_COLLISION and found.clearance < 0.0
    assert found.blocker.startswith("panda_link7 vs ")


def test_earlier_names_still_work() -> None:
    with pytest.warns(DeprecationWarning, match="ArmPath since 0.1"):
        assert burg.arm.Witness is burg.arm.ArmPath
    with pytest.warns(DeprecationWarning, match="Reach.path since 0.1"):
        assert burg.Reach(None).witness is None


class Failing:
    """A search that finds nothing, and knows two arm positions in collision."""

    def __init__(self, first: float) -> None:
        self.q = np.array([[first], [first + 1.0]])

    def lifted(self, height: float) -> Failing:
        return self

    def begin(self, X_AG: Array, clearance: Array) -> Failing:
        return self

    def propose(self, grasps: list[int]) -> list[None]:
        return [None] * len(grasps)

    def refuse(self, grasp: int, chain: object, row: int | None) -> None: ...

    def close(self, grasp: int, flip: int) -> None: ...

    def failure(self, grasp: int) -> Failure:
        return Failure(Outcome.LIFT_LINE, q=self.q, moved_W=np.zeros((2, 3)))


def test_the_attempts_of_both_searches_are_told() -> None:
    """So that the one that came closest can be named."""
    search = SuccessiveLineSearch(Failing(0.0), lambda: Failing(5.0))
    batch = search.begin(np.zeros((1, 2, 4, 4)), np.zeros((1, 2)))
    assert batch.propose([0]) == [None]
    assert batch.failure(0).q[:, 0].tolist() == [0.0, 1.0, 5.0, 6.0]
    assert len(batch.failure(0).moved_W) == 4
