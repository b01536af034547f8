"""The whole way on the real thing: grasps whose outcome is known by construction.

`burg-drake evaluate` judges them on the built-in scene; the friction limit is tried on a box of
which statics says which coefficient holds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from inline_executor import Inline

from burg_drake.apps import main
from burg_drake.core import GraspSet, Outcome, Pose, Stage, grasp_from_axes, inverse
from burg_drake.evaluation import EvaluationSettings, Run, evaluate, load_run, read_table
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, SceneDocument, load_scene, save_scene
from burg_drake.station import instance_pose, load_station
from tests.evaluation.composed import tabletop

SCENE, STATION = "tabletop_six", "panda_tabletop"
BOX = (0.06, 0.158, 0.21)
"""Size of the built-in box [m]; its frame is in the middle of the bottom, its narrow side x."""
DOWN = (0.0, 0.0, -1.0)
KNOWN = (
    Outcome.LIFTED,
    Outcome.COLLISION_TARGET,
    Outcome.COLLISION_TABLE,
    Outcome.COLLISION_CLUTTER,
    Outcome.NO_CONTACT,
    Outcome.NO_IK,
)
"""The outcomes that there is a grasp for, in its order."""


def on_the_box(height: float) -> np.ndarray:
    """(4, 4) grasp across the narrow side from above, in the box's frame."""
    return grasp_from_axes((1.0, 0.0, 0.0), DOWN, (0.0, 0.0, height))


def known_grasps() -> np.ndarray:
    """(6, 4, 4) grasps of the box `X_OG` with the outcomes `KNOWN`."""
    scene, station = load_scene(SCENE), load_station(STATION)
    X_OW = inverse(instance_pose(scene, station, "box"))

    def in_the_world(*p_WG: float) -> np.ndarray:
        return X_OW @ grasp_from_axes((1.0, 0.0, 0.0), DOWN, p_WG)

    p_WB = instance_pose(scene, station, "bottle")[:3, 3]
    grasps = {
        Outcome.LIFTED: on_the_box(BOX[2] - 0.025),
        # the palm is 45 mm above the grasp point, so that 60 mm is 15 mm inside
        Outcome.COLLISION_TARGET: on_the_box(BOX[2] - 0.06),
        # beside the board, finger tips 20 mm below the table's top
        Outcome.COLLISION_TABLE: in_the_world(0.3, 0.6, -0.02),
        # the hand stands in the bottle
        Outcome.COLLISION_CLUTTER: in_the_world(p_WB[0], p_WB[1], 0.1),
        # higher than everything, within the arm's range and outside of it (0.855 m)
        Outcome.NO_CONTACT: in_the_world(0.4, 0.0, 0.4),
        Outcome.NO_IK: in_the_world(1.6, 0.0, 0.4),
    }
    return np.array([grasps[outcome] for outcome in KNOWN])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The command line on the known grasps, with the box and the bottle that they are about."""
    folder = tmp_path_factory.mktemp("run")
    save_scene(tabletop("box", "bottle").document, folder / "scene.yaml")
    GraspSet.create(known_grasps(), object="box").save(folder / "known.npz")
    arguments = ["--station", STATION, "--grasps", str(folder / "known.npz"), "--workers", "1"]
    scene, out = str(folder / "scene.yaml"), str(folder / "out")
    assert main(["evaluate", scene, *arguments, "-o", out]) == 0
    return load_run(folder / "out")


def row(run: Run, outcome: Outcome) -> dict:  # type: ignore[type-arg]
    """The row of the grasp that was made for an outcome."""
    return run.row(run.candidates.id[KNOWN.index(outcome)])


@pytest.mark.parametrize("outcome", KNOWN)
def test_truth_by_construction(run: Run, outcome: Outcome) -> None:
    found = row(run, outcome)
    assert found["outcome"] == outcome
    assert found["stage"] == outcome.stage


def test_what_is_in_the_way_is_named(run: Run) -> None:
    assert row(run, Outcome.COLLISION_TABLE)["blocker"] == "table"
    assert row(run, Outcome.COLLISION_CLUTTER)["blocker"] == "bottle"
    assert row(run, Outcome.COLLISION_TARGET)["blocker"] == "box"
    assert row(run, Outcome.COLLISION_TABLE)["overlap"] > 0.0


def test_a_lifted_grasp_has_its_margins_and_arm_configurations(run: Run) -> None:
    lifted = row(run, Outcome.LIFTED)
    assert lifted["lift"] == pytest.approx(0.3, abs=5e-3)
    assert lifted["pad_force"] == pytest.approx(load_station(STATION).hand.force, rel=0.05)
    assert lifted["slip"] < 2e-3 and lifted["tilt"] < np.deg2rad(2)
    assert all(
        np.isfinite(lifted[f"q_{at}_{k}"]) for at in ("grasp", "pregrasp") for k in range(1, 8)
    )
    assert all(lifted[f"cpu_{stage}"] > 0.0 for stage in ("clear", "reach", "trial"))


def test_the_arm_stands_at_the_grasp(run: Run) -> None:
    from burg_drake.station import build_station_diagram

    scene, station = run.scene(), run.station()
    built = build_station_diagram(scene, station, robot="arm")
    plant = built.plant
    context = plant.CreateDefaultContext()
    arm = plant.GetModelInstanceByName("arm")
    lifted = row(run, Outcome.LIFTED)
    plant.SetPositions(context, arm, [lifted[f"q_grasp_{k}"] for k in range(1, 8)])
    hand = plant.GetBodyByName(station.hand.body)
    X_WG = plant.EvalBodyPoseInWorld(context, hand).GetAsMatrix4() @ station.hand.X_HG.matrix()
    expected = built.X_WO("box") @ run.candidate(lifted["id"]).X_OG
    np.testing.assert_allclose(X_WG[:3, 3], expected[:3, 3], atol=2e-3)
    # the hand turned by half a turn about its approach axis is the same grasp
    assert abs(X_WG[:3, 0] @ expected[:3, 0]) == pytest.approx(1.0, abs=1e-3)
    assert X_WG[:3, 2] @ expected[:3, 2] == pytest.approx(1.0, abs=1e-3)


def test_files_are_there_and_agree(run: Run) -> None:
    assert read_table(run.table_path)["id"].tolist() == run.candidates.id
    assert "tabletop_six on panda_tabletop" in run.report_path.read_text()
    stages = run.results["stage"].tolist()
    assert stages.count(Stage.CLEAR) == 3 and stages.count(Stage.REACHABLE) == 1


def test_the_same_again_in_another_process_and_order(run: Run, tmp_path: Path) -> None:
    again = evaluate(
        run.document.scene.path,
        STATION,
        tmp_path / "again",
        grasps={"box": GraspSet.create(known_grasps()[::-1], object="box")},
        executor=Inline(),
        progress=False,
    )
    for id in run.candidates.id:
        first, second = run.row(id), again.row(id)
        for name in first:
            if name != "run" and not name.startswith("cpu_"):
                assert repr(first[name]) == repr(second[name]), (id, name)


@pytest.mark.thorough  # `simulation/test_statics` has it for single trials
def test_friction_decides_as_statics_says(tmp_path: Path) -> None:
    """Two boxes with friction below and above the limit, 2 mu N = m g."""
    mass, force = 0.411, load_station(STATION).hand.force
    box = trimesh.creation.box(BOX)
    box.apply_translation((0.0, 0.0, BOX[2] / 2))
    sources = [
        ObjectSource(name=name, mesh=box, mass=mass, friction=friction, pieces=(box,))
        for name, factor in (("below", 0.8), ("above", 1.4))
        if (friction := factor * mass * 9.81 / (2 * force))
    ]
    assert build_library(sources, tmp_path / "boxes", confirm=False).failed == {}
    document = SceneDocument(
        name="boxes",
        library="boxes",
        instances=tuple(
            Instance(object=name, X_SO=Pose((x, 0.2, 0.0)))
            for name, x in (("below", 0.15), ("above", 0.45))
        ),
    )
    save_scene(document, tmp_path / "boxes.yaml")
    X_OG = on_the_box(BOX[2] - 0.025)
    run = evaluate(
        tmp_path / "boxes.yaml",
        STATION,
        tmp_path / "run",
        settings=EvaluationSettings(mode="hand"),
        grasps={name: GraspSet.create(X_OG, object=name) for name in ("below", "above")},
        executor=Inline(),
        progress=False,
    )
    found = dict(zip(run.results["instance"], run.results["outcome"], strict=True))
    assert found == {"below": Outcome.SLIPPED, "above": Outcome.LIFTED}
