"""Runs of benchmarks from image to verdict: what is written, repeated, resumed and verified."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.benchmark import (
    BenchmarkResult,
    BenchmarkSettings,
    Budget,
    CameraPlacement,
    Conditions,
    LeaderboardExtras,
    PlannedGrasps,
    StoredAnswer,
    Suite,
    SuiteSettings,
    all_tables,
    choose_grasps,
    compare_by_suite,
    episodes,
    failed_grasps,
    load_result,
    make_suite,
    measure_all,
    run_benchmark,
    scene_pictures,
    verify_result,
    write_leaderboard,
)
from burg_drake.core import InvalidInputError, Outcome
from burg_drake.scene import Board
from burg_drake.station import station_gripper
from tests.benchmark.can_scenes import cans
from tests.benchmark.judged import COLLIDES, LIFTED, SLIPPED, judged, result
from tests.benchmark.scripted_planners import grasp_in_scene

pytestmark = [pytest.mark.physics, pytest.mark.usefixtures("benchmarked_here")]

thorough = pytest.mark.thorough
PLANNERS = "tests.benchmark.scripted_planners"
DEPTH = BenchmarkSettings(depth_only=True)


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    """Two scenes of cans, of which one has a small board."""
    small = Board(size=(0.42, 0.297))
    scenes = [cans("two", (0.2, 0.2), (0.4, 0.2)), cans("one", (0.2, 0.15), board=small)]
    camera = CameraPlacement(exact_depth=True).camera(Board())
    camera = replace(camera, size=(212, 120))
    return make_suite(
        tmp_path_factory.mktemp("suite") / "cans.yaml",
        scenes,
        cameras=[camera],
        settings=SuiteSettings(
            budget=Budget(grasps=3, seconds=30.0, picks=4), mode="hand", engine="screening"
        ),
    )


@pytest.fixture(scope="module")
def cleared(suite: Suite, tmp_path_factory: pytest.TempPathFactory) -> BenchmarkResult:
    folder = tmp_path_factory.mktemp("results") / "cleared"
    settings = replace(DEPTH, protocol="clear", name="cans")
    return run_benchmark(
        suite, f"{PLANNERS}:plan_cans", folder, settings=settings, workers=1, progress=False
    )


def written(folder: Path) -> dict[Path, int]:
    """When the answers, scenes and journals of a result were written [ns]."""
    patterns = ("**/answers/*.npz", "**/scenes/*.yaml", "**/journal.jsonl")
    found = [path for pattern in patterns for path in folder.glob(pattern)]
    assert len(found) > 5
    return {path: path.stat().st_mtime_ns for path in found}


def outcomes(result: BenchmarkResult) -> list[tuple[str, list[str]]]:
    return [
        (one.answer.scene, [str(v and v.outcome) for v in one.verdicts]) for one in result.answers
    ]


def test_scenes_are_cleared_object_by_object(cleared: BenchmarkResult) -> None:
    attempts = episodes(cleared)
    assert [len(made) for made in attempts.values()] == [2, 1]
    assert all(one.succeeded for made in attempts.values() for one in made)
    measures = measure_all(cleared)
    assert measures["cleared"].value == measures["pick_success"].value == 1.0
    assert measures["mean_picks"].value == 1.5
    assert measures["mean_picks"].low < measures["mean_picks"].high == 1.5
    second = burg.load_scene(cleared.rounds[1].path / "scenes" / "two.yaml")
    assert len(second.instances) == 1
    (left,) = second.instances
    first = burg.load_scene(cleared.rounds[0].run_folder("two") / "scene.yaml")
    assert np.allclose(second.X_SO(left), first.X_SO(left), atol=1e-4)


def test_a_complete_result_is_not_asked_for_again(cleared: BenchmarkResult, suite: Suite) -> None:
    before = written(cleared.path)
    settings = replace(DEPTH, protocol="clear", name="cans")
    again = run_benchmark(
        suite, f"{PLANNERS}:plan_cans", cleared.path, settings=settings, workers=1, progress=False
    )
    assert written(again.path) == before and outcomes(again) == outcomes(cleared)
    assert again.document.times == cleared.document.times


def test_results_can_be_shared_and_verified(cleared: BenchmarkResult, tmp_path: Path) -> None:
    copy = tmp_path / "moved"
    shutil.copytree(cleared.path, copy)
    found = verify_result(copy, count=2, workers=1, progress=False)
    assert len(found.grasps) == 2 and not found.differing


def test_changed_friction_of_an_answer_is_noticed(cleared: BenchmarkResult, tmp_path: Path) -> None:
    copy = tmp_path / "slippery"
    shutil.copytree(cleared.path, copy)
    for scene in ("one", "two"):
        answer = StoredAnswer.load(copy, scene, "front")
        changed = answer.grasps.with_columns(friction_needed=np.full(len(answer.grasps), 0.1))
        replace(answer, grasps=changed).save(copy)
    found = verify_result(copy, count=9, workers=1, progress=False)
    assert len(found.differing) == 3  # of the first images; those of the second are as they were
    assert all("needed friction: " in one.text[-1] for one in found.differing)


def test_verdicts_of_another_engine_are_noticed(cleared: BenchmarkResult, tmp_path: Path) -> None:
    copy = tmp_path / "other"
    shutil.copytree(cleared.path, copy)
    for run in copy.glob("**/campaign.yaml"):
        run.write_text(run.read_text().replace("mode: hand", "mode: reach"))
    with pytest.raises(InvalidInputError, match=r"judged in mode reach .* suite says hand"):
        verify_result(copy, count=1, workers=1, progress=False)


@thorough
def test_any_number_of_workers_gives_the_same_bits(
    cleared: BenchmarkResult, suite: Suite, tmp_path: Path
) -> None:
    settings = replace(DEPTH, protocol="clear", name="cans")
    two = run_benchmark(
        suite, f"{PLANNERS}:plan_cans", tmp_path / "two", settings=settings, workers=2
    )
    for one, other in zip(cleared.rounds, two.rounds, strict=True):
        for own, found in zip(cleared.judged_answers(one), two.judged_answers(other), strict=True):
            assert own.answer.grasps.X_OG.tobytes() == found.answer.grasps.X_OG.tobytes()
            assert own.ids == found.ids
            for verdict, again in zip(own.verdicts, found.verdicts, strict=True):
                assert verdict.outcome is again.outcome and verdict.margins == again.margins


def test_a_changed_suite_is_noticed(cleared: BenchmarkResult, tmp_path: Path) -> None:
    copy = tmp_path / "easier"
    shutil.copytree(cleared.path, copy)
    suite = copy / "suite.yaml"
    suite.write_text(suite.read_text().replace("grasps: 3", "grasps: 1"))
    with pytest.raises(
        InvalidInputError, match=r"suite\.yaml has been changed since the benchmark"
    ):
        load_result(copy)


def test_a_changed_answer_is_noticed(cleared: BenchmarkResult, tmp_path: Path) -> None:
    copy = tmp_path / "changed"
    shutil.copytree(cleared.path, copy)
    shutil.copy(copy / "answers" / "two.front.npz", copy / "answers" / "one.front.npz")
    with pytest.raises(InvalidInputError, match="not those of the answers"):
        verify_result(copy, count=1, workers=1, progress=False)


def test_a_planner_that_always_fails_has_a_result(
    suite: Suite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "result"
    options = ["--planner", f"{PLANNERS}:plan_nothing", "--depth-only", "--workers", "1", "--quiet"]
    assert main(["benchmark", "run", str(suite.path), *options, "-o", str(folder)]) == 1
    assert capsys.readouterr().err.endswith("burg-drake: no answer has grasps\n")
    found = load_result(folder)
    assert all("KeyError" in one.answer.error for one in found.answers)
    measures = measure_all(found)
    assert measures["answered"].value == measures["top_success"].value == 0.0


def test_equal_scores_keep_the_order_of_the_planner(suite: Suite) -> None:
    scene, gripper = suite.scenes()["two"], station_gripper(suite.station)
    X_SG = np.array([grasp_in_scene(x, 0.2, 0.05) for x in (0.4, 0.2, 0.38, 0.22)])
    X_SG[2:, 2, 3] += 0.05  # not near the others
    for score in (np.ones(4), np.array([1.0, 1.0, 0.5, 0.5])):
        planned = PlannedGrasps(X_SG, np.full(4, np.nan), score, 0.0)
        chosen = choose_grasps(scene, planned, gripper, 4, "front")
        assert chosen.columns["instance"].tolist() == ["can_1", "can_0", "can_1", "can_0"]
        assert chosen.columns["planner_score"].tolist() == score.tolist()


def test_slippery_objects_are_not_lifted_whatever_camera_sees_them(
    suite: Suite, tmp_path: Path
) -> None:
    front = suite.document.cameras[0]
    behind = replace(CameraPlacement(azimuth_deg=90.0, exact_depth=True).camera(Board()), name="b")
    pair = make_suite(
        tmp_path / "pair.yaml",
        [suite.scenes()["two"]],
        cameras=[front, replace(behind, size=front.size)],
        settings=SuiteSettings(mode="hand", engine="screening"),
    )
    settings = replace(DEPTH, conditions=Conditions(friction=0.05))
    found = run_benchmark(
        pair,
        f"{PLANNERS}:plan_cans",
        tmp_path / "slippery",
        settings=settings,
        workers=1,
        progress=False,
    )
    assert [one.answer.camera for one in found.answers] == ["front", "b"]
    assert all(len(one.verdicts) == 2 for one in found.answers)
    held = {verdict.outcome.held for one in found.answers for verdict in one.verdicts}
    assert held == {False}
    assert measure_all(found)["top_success"].high > 0.7  # one scene, however many images
    campaign = found.rounds[0].campaign
    own = burg.load_library("household").entry("can").friction
    assert campaign.run("two").results["friction"] == pytest.approx(0.05 * own)
    assert not verify_result(found, count=1, workers=1, progress=False).differing
    with pytest.raises(InvalidInputError, match=r"conditions: friction x 0\.05 there"):
        run_benchmark(pair, f"{PLANNERS}:plan_cans", found.path, settings=DEPTH)


@thorough
def test_a_planner_that_fails_costs_its_own_answer(suite: Suite, tmp_path: Path) -> None:
    found = run_benchmark(
        suite,
        f"{PLANNERS}:plan_on_large_boards",
        tmp_path / "result",
        settings=DEPTH,
        workers=2,
        progress=False,
    )
    errors = {one.answer.scene: one.answer.error for one in found.answers}
    assert errors["two"] == "" and "KeyError" in errors["one"]
    assert outcomes(found)[0] == ("two", [Outcome.LIFTED.value] * 2)


@thorough
def test_a_scene_is_given_up_after_three_failures(suite: Suite, tmp_path: Path) -> None:
    found = run_benchmark(
        suite,
        f"{PLANNERS}:plan_in_the_air",
        tmp_path / "air",
        settings=replace(DEPTH, protocol="clear"),
        workers=1,
        progress=False,
    )
    assert [len(made) for made in episodes(found).values()] == [3, 3]


def test_tables_and_page_name_all_methods(cleared: BenchmarkResult, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(cleared.path, other)
    record = other / "benchmark.yaml"
    record.write_text(record.read_text().replace("name: cans", "name: same"))
    (comparison,) = compare_by_suite([load_result(other), cleared])
    assert comparison.names == ["cans", "same"]
    text = "\n".join(table.markdown() for table in all_tables([comparison]))
    assert "| cans | 100 (34-100) |" in text and "| cans - same | top grasp | +0 " in text
    pictures = scene_pictures([comparison])
    assert sorted(name for _, name in pictures) == ["one", "two"]
    image = cv2.imdecode(np.frombuffer(next(iter(pictures.values())), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (181, 320, 3) and image.std() > 10.0  # as 212 x 120 pixels are
    run = load_result(other).rounds[0].run_folder("two")
    id = load_result(other).answers[0].ids[0]
    extras = LeaderboardExtras(
        pictures=pictures, replays={(run, id): tmp_path / "page_replays" / "one.html"}
    )
    page = write_leaderboard([comparison], tmp_path / "page.html", extras=extras).read_text()
    assert page.count("data:image/jpeg") == 2 and page.count('href="page_replays/one.html"') == 1
    assert page.count("<table") == 7 and "other/trials/scenes/two/report.html" in page


def test_failures_with_different_outcomes_are_replayed_first() -> None:
    answers = [
        judged(f"s{k}", [v]) for k, v in enumerate((LIFTED, SLIPPED, SLIPPED, COLLIDES, SLIPPED))
    ]
    comparison = compare_by_suite([result(answers, grasps=1)])
    chosen = failed_grasps(comparison, 3)
    assert [run.name for run, _ in chosen] == ["s1", "s3", "s2"]
    assert failed_grasps(comparison, 0) == []


def test_another_benchmark_in_the_folder_is_refused(cleared: BenchmarkResult, suite: Suite) -> None:
    with pytest.raises(InvalidInputError, match="protocol: clear there, single here"):
        run_benchmark(
            suite, f"{PLANNERS}:plan_cans", cleared.path, settings=replace(DEPTH, name="cans")
        )


def test_a_planner_that_was_edited_is_refused(suite: Suite, tmp_path: Path) -> None:
    def run() -> BenchmarkResult:
        reference, folder = f"{planner}:plan", tmp_path / "result"
        return run_benchmark(suite, reference, folder, settings=DEPTH, workers=1, progress=False)

    planner = tmp_path / "own.py"
    planner.write_text("def plan(observation): return {'X_SG': []}\n")
    first = run().document.planner_content
    assert run().document.planner_content == first
    planner.write_text("def plan(observation): return {'X_CG': []}\n")
    with pytest.raises(InvalidInputError, match=f"has changed since .* began .{first} there, "):
        run()


def test_replay_of_all_scenes_names_one(
    cleared: BenchmarkResult, capsys: pytest.CaptureFixture[str]
) -> None:
    trials = cleared.path / "trials"
    assert main(["replay", str(trials), "--best"]) == 2
    assert f"one of them, such as {trials / 'scenes' / 'two'}\n" in capsys.readouterr().err


def test_an_unfinished_result_says_how_to_finish_it(
    cleared: BenchmarkResult, tmp_path: Path
) -> None:
    copy = tmp_path / "open"
    shutil.copytree(cleared.path, copy)
    record = copy / "benchmark.yaml"
    record.write_text(record.read_text().replace("complete: true", "complete: false"))
    with pytest.raises(InvalidInputError, match="is not complete; finish it with the command"):
        measure_all(load_result(copy))
