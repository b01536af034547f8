"""Feasibility of a set: answers that geometry demands, configurations that Drake places there."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from known_judge import refuse

from burg_drake.core import (
    Array,
    BurgError,
    GraspSet,
    InvalidInputError,
    Outcome,
    Progress,
    Stage,
    UnknownNameError,
    Verdict,
    describe_column,
    grasp_from_axes,
    make_pose,
)
from burg_drake.evaluation import (
    PlanOutput,
    encode_verdict,
    reach,
    reach_columns,
    read_table,
    write_table,
)
from burg_drake.motion import load_plan
from burg_drake.scene import Scene, load_scene, save_scene
from burg_drake.station import Station, build_station_diagram, load_station
from tests.evaluation.composed import tabletop

pytestmark = pytest.mark.usefixtures("judged_here")

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
BELOW = grasp_from_axes((1, 0, 0), (0, 0, 1), (0.0, 0.0, 0.03))
"""From below, through the table."""
INSIDE = ABOVE @ make_pose(p_AB=(0, 0, 0.1))
"""The hand is in the box."""
BESIDE = grasp_from_axes((0, 0, 1), (0, 1, 0), (0.0, -0.9, 0.2))
"""In thin air, far from the box."""
GRASPS = np.stack([ABOVE, INSIDE, BELOW, BESIDE])
EXPECTED = ["reachable", "collision_target", "collision_table"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The household box where it stands in the built-in scene, and nothing else."""
    path = tmp_path_factory.mktemp("scene") / "box.yaml"
    save_scene(tabletop("box").document, path)
    return load_scene(path)


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plans")


@pytest.fixture(scope="module")
def judged(scene: Scene, station: Station, plans: Path, judged_here: None) -> GraspSet:
    given = GraspSet.create(GRASPS, object="box", width=0.06)
    return reach(scene, station, given, plans=plans, workers=1)


def X_WG(scene: Scene, station: Station, q: Array) -> Array:
    """Where Drake has the grasp frame at arm positions (n,)."""
    built = build_station_diagram(scene, station, robot="arm")
    context = built.plant.CreateDefaultContext()
    for joint, value in zip(built.arm_joints, q, strict=True):
        joint.set_angle(context, value)
    hand = built.plant.GetModelInstanceByName("hand")
    body = built.plant.GetBodyByName(station.hand.body, hand)
    X_WH = built.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
    return X_WH @ station.hand.X_HG.matrix()


def at(judged: GraspSet, name: str, row: int) -> Array:
    return np.array([judged.column(f"{name}_{k}")[row] for k in range(1, 8)])


def same_grasp(a: Array, b: Array) -> bool:
    """Whether two poses are one grasp, the fingers swapped or not."""
    swapped = b @ np.diag([-1.0, -1.0, 1.0, 1.0])
    return any(np.allclose(a, X, atol=1e-4) for X in (b, swapped))


def test_answers_are_those_that_geometry_demands(judged: GraspSet) -> None:
    assert judged.column("outcome")[:3].tolist() == EXPECTED
    assert judged.column("blocker")[:3].tolist() == ["", "box", "table"]
    assert judged.column("instance").tolist() == ["box"] * 4
    clearance = judged.column("clearance")
    assert clearance[0] > 0.0 > clearance[1]
    assert judged.column("arm_clearance")[0] >= 0.0
    assert (judged.column("cpu") > 0.0).all()


def test_the_arm_is_where_the_grasp_is(judged: GraspSet, scene: Scene, station: Station) -> None:
    wanted = station.document.X_WS.matrix() @ scene.X_SO("box") @ ABOVE
    assert same_grasp(X_WG(scene, station, at(judged, "q_grasp", 0)), wanted)
    back = wanted @ make_pose(p_AB=(0.0, 0.0, -0.1))
    assert same_grasp(X_WG(scene, station, at(judged, "q_pregrasp", 0)), back)
    assert np.isnan(at(judged, "q_grasp", 1)).all()


def test_a_plan_leads_from_home_over_the_pregrasp_up(
    judged: GraspSet, plans: Path, scene: Scene, station: Station
) -> None:
    good = judged.column("outcome") == "reachable"
    written = sorted(path.name for path in plans.iterdir())
    names = [f"box-{id}.json" for id in judged.id[good]]
    assert written == sorted([*names, "journal.jsonl", "plans.yaml"])
    plan = load_plan(plans / f"box-{judged.id[0]}.json")
    arm = station.document.arm
    assert arm is not None
    np.testing.assert_allclose(plan.transfer.q[0], arm.home, atol=1e-12)
    np.testing.assert_allclose(plan.approach.q[0], at(judged, "q_pregrasp", 0), atol=1e-9)
    np.testing.assert_allclose(plan.approach.q[-1], at(judged, "q_grasp", 0), atol=1e-9)
    wanted = station.document.X_WS.matrix() @ scene.X_SO("box") @ ABOVE
    top = make_pose(p_AB=(0.0, 0.0, 0.3)) @ wanted
    assert same_grasp(X_WG(scene, station, plan.lift.q[-1]), top)
    assert judged.column("duration")[0] == plan.duration
    assert np.isnan(judged.column("duration")[~good]).all()


def test_answers_do_not_depend_on_neighbours_or_workers(
    judged: GraspSet, scene: Scene, station: Station
) -> None:
    other = GraspSet.create(GRASPS[[3, 0]], object="box", width=0.06)
    again = reach(scene, station, other, workers=2)
    assert again.id.tolist() == judged.id[[3, 0]].tolist()
    for name, values in again.columns.items():
        if name != "cpu":
            np.testing.assert_array_equal(values, judged.column(name)[[3, 0]], err_msg=name)


def test_plans_go_to_a_folder_of_their_own(
    judged: GraspSet, plans: Path, scene: Scene, station: Station
) -> None:
    """Those of another question would be taken for motions of this one."""
    before = contents(plans)
    given = GraspSet.create(GRASPS[:2], object="box", width=0.06)
    with pytest.raises(InvalidInputError) as error:
        reach(scene, station, given, exact=False, plans=PlanOutput(plans, format="csv"))
    assert re.fullmatch(
        rf"folder {plans} has plans of another evaluation \(grasps are 4 there, 2 here;"
        r" check is exact there, screening here; format is json there, csv here\); choose"
        r" another one, or delete it",
        str(error.value),
    )
    assert contents(plans) == before


def contents(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in folder.iterdir()}


def test_what_is_finished_is_not_asked_again(
    judged: GraspSet, plans: Path, scene: Scene, station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.evaluation.feasibility.ReachJudgeFactory", lambda *_: refuse)
    given = GraspSet.create(GRASPS, object="box", width=0.06)
    before = contents(plans)
    again = reach(scene, station, given, plans=plans)
    assert contents(plans) == before
    for name, values in judged.columns.items():
        np.testing.assert_array_equal(again.column(name), values)


def test_what_failed_is_asked_again_on_request(
    judged: GraspSet,
    plans: Path,
    scene: Scene,
    station: Station,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("burg_drake.evaluation.feasibility.ReachJudgeFactory", lambda *_: refuse)
    folder = shutil.copytree(plans, tmp_path / "plans")
    given = GraspSet.create(GRASPS, object="box", width=0.06)
    failed = Verdict(Outcome.SIMULATION_FAILED, Stage.PLANNED, reason="it crashed")
    with (folder / "journal.jsonl").open("ab") as journal:
        journal.write(encode_verdict(f"box-{judged.id[2]}", failed))
    kept = reach(scene, station, given, plans=folder)
    assert np.flatnonzero(kept.column("outcome") == "").tolist() == [2]
    with pytest.raises(BurgError, match="no such model"):
        reach(scene, station, given, plans=PlanOutput(folder, retry_failed=True))


KILLED = """
import sys
from burg_drake.core.grasp_set import GraspSet
from burg_drake.evaluation.feasibility import reach
grasps = GraspSet.load(sys.argv[1])
reach(sys.argv[3], "panda_tabletop", grasps, plans=sys.argv[2], workers=1)
"""


@pytest.mark.thorough
def test_a_killed_call_is_gone_on_with(
    judged: GraspSet, plans: Path, scene: Scene, station: Station, tmp_path: Path
) -> None:
    """Killed while it writes a plan, or just after; what is half written goes."""
    folder = tmp_path / "plans"
    given = GraspSet.create(GRASPS, object="box", width=0.06)
    given.save(tmp_path / "grasps.npz")
    name = f"box-{judged.id[0]}.json"
    command = [sys.executable, "-c", KILLED, tmp_path / "grasps.npz", folder, scene.path]
    process = subprocess.Popen(list(map(str, command)), start_new_session=True)
    while not any(folder.glob(f"*{name}*")) and process.poll() is None:
        time.sleep(0.0005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    (folder / f".{name}.0123456789abcdef").write_text("half of a pl")
    found = reach(scene, station, given, plans=folder, workers=1)
    ours, theirs = contents(folder), contents(plans)
    assert ours.keys() == theirs.keys()
    for file in set(ours) - {"journal.jsonl"}:
        assert ours[file][1] == theirs[file][1], file
    for column in set(judged.columns) - {"cpu"}:
        np.testing.assert_array_equal(found.column(column), judged.column(column))


def test_a_plan_that_fails_leaves_the_answer(
    judged: GraspSet, scene: Scene, station: Station, tmp_path: Path
) -> None:
    """Where the first plan is to be written, somebody has made a folder."""
    taken = tmp_path / f"box-{judged.id[0]}.json"

    def take(event: Progress) -> None:
        taken.mkdir(exist_ok=True)

    given = GraspSet.create(ABOVE[None], object="box", width=0.06)
    found = reach(scene, station, given, plans=tmp_path, workers=1, progress=take)
    assert found.column("outcome").tolist() == ["reachable"]
    (reason,) = found.column("reason")
    assert reason.startswith(f"no plan: InvalidInputError: cannot write {taken}: ")
    assert "duration" not in found.columns
    assert {path.name for path in tmp_path.iterdir()} == {taken.name, "journal.jsonl", "plans.yaml"}


@pytest.mark.thorough
def test_what_cannot_be_answered_has_no_outcome(
    judged: GraspSet, scene: Scene, station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    from known_judge import CrashingJudge, Make

    lost = f"box-{judged.id[2]}"
    judge = Make(CrashingJudge(how=((lost, "screen"),)))
    monkeypatch.setattr("burg_drake.evaluation.feasibility.ReachJudgeFactory", lambda *_: judge)
    given = GraspSet.create(GRASPS, object="box", width=0.06)
    found = reach(scene, station, given, workers=2)
    empty = found.column("outcome") == ""
    assert found.id[empty].tolist() == [judged.id[2]]
    assert found.column("reason")[empty].tolist() == ["the worker process was killed by SIGSEGV"]


def test_a_set_has_to_name_its_objects(station: Station) -> None:
    scene = load_scene("tabletop_six")
    with pytest.raises(InvalidInputError) as error:
        reach(scene, station, GraspSet.create(GRASPS, object=""))
    assert str(error.value) == (
        "the set does not name the object of its grasps; name it"
        " (GraspSet.create(..., object=NAME)); scene 'tabletop_six' has banana, bottle,"
        " bowl, box, mug, screwdriver"
    )
    with pytest.raises(UnknownNameError) as unknown:
        reach(scene, station, GraspSet.create(GRASPS, object="bax"))
    assert str(unknown.value) == (
        "the set has grasps of object 'bax', which is not in scene 'tabletop_six'; did you mean"
        " 'box'? Known: banana, bottle, bowl, box, mug, screwdriver"
    )


def test_a_table_has_it_all(judged: GraspSet, tmp_path: Path) -> None:
    assert all(map(describe_column, reach_columns(judged)))
    write_table(tmp_path / "reach.csv", reach_columns(judged))
    back = read_table(tmp_path / "reach.csv")
    assert back["id"].tolist() == [f"box-{id}" for id in judged.id]
    assert back["outcome"].tolist() == judged.column("outcome").tolist()
    np.testing.assert_array_equal(back["q_grasp_1"], judged.column("q_grasp_1"))
    np.testing.assert_array_equal(back["z"], GRASPS[:, 2, 3])


def test_a_set_comes_back_from_its_file(judged: GraspSet, tmp_path: Path) -> None:
    judged.save(tmp_path / "reach.h5")
    back = GraspSet.load(tmp_path / "reach.h5")
    assert back.column("outcome").tolist() == judged.column("outcome").tolist()
    said = back.provenance["reach"]
    assert said["exact"] is True and said["lift_height"] == 0.3


def test_no_grasps_are_no_answers(scene: Scene, station: Station) -> None:
    found = reach(scene, station, {})
    assert len(found) == 0 and "outcome" in found.columns


def test_a_folder_that_cannot_be_written_is_said_before_any_work(
    scene: Scene, station: Station
) -> None:
    with pytest.raises(InvalidInputError, match="/dev/null"):
        reach(scene, station, {}, plans="/dev/null/plans")
