"""`evaluate` around a known judge: the same table on any number of workers and after kills."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import asked
from inline_executor import Inline
from known_judge import JUDGE_FACTORY, KnownJudge, Make, ShortOfMemory, expected, install, number

from burg_drake.core import (
    ONE_BY_ONE,
    GraspSet,
    InvalidInputError,
    Progress,
    Stage,
    UnknownNameError,
    make_pose,
)
from burg_drake.evaluation import (
    TEXT_COLUMNS,
    EvaluationSettings,
    Run,
    evaluate,
    load_run,
    merge_runs,
    read_grasps,
    read_journal,
    read_table,
    reproduce_command,
    run_notes,
)
from burg_drake.scene import Scene
from burg_drake.station import Station
from tests.hang_guard import HANG_GUARD, until


def same_results(a: Run, b: Run) -> bool:
    """Whether two tables agree in everything but time."""
    assert list(a.results) == list(b.results)
    names = [name for name in a.results if not name.startswith("cpu_")]
    return all(
        np.array_equal(a.results[n], b.results[n], equal_nan=n not in TEXT_COLUMNS) for n in names
    )


def test_results_do_not_depend_on_workers(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    options = {"grasps_per_object": 20, "blind": True, "progress": False}
    one = evaluate(scene, station, tmp_path / "one", **asked(workers=1, **options))
    two = evaluate(scene, station, tmp_path / "two", **asked(workers=2, **options))
    assert same_results(one, two)
    assert one.complete and one.failures == []
    assert one.results["id"].tolist() == one.candidates.id
    assert one.results["outcome"].tolist() == [expected(id) for id in one.candidates.id]
    other = evaluate(
        scene, station, tmp_path / "other", **asked(seed=1, executor=Inline(), **options)
    )
    assert not same_results(one, other)


def test_sessions_count_the_grasps_of_each_device_whoever_judges(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Worker processes here, and an executor like that of a cluster, stopped and continued."""
    install(monkeypatch.setattr)
    cards = [f"NVIDIA {name} (driver supports CUDA 12.8, x: 1)" for name in ("A100", "H100")]
    make = Make(KnownJudge(devices=(*cards, ONE_BY_ONE)))
    monkeypatch.setattr(JUDGE_FACTORY, lambda *_: make)
    options = asked(grasps_per_object=20, blind=True, progress=False)
    run = evaluate(scene, station, tmp_path / "run", workers=2, **options)
    tried = [id for id in run.candidates.id if expected(id).stage is Stage.EXECUTED]
    counts = Counter(make.judge.devices[number(id) % 3] for id in tried)
    (session,) = run.document.stretches
    assert session.executed == counts and len(counts) == 3
    with pytest.raises(KeyboardInterrupt):
        evaluate(scene, station, tmp_path / "other", executor=Inline(stop=30), **options)
    other = evaluate(scene, station, tmp_path / "other", executor=Inline(), **options)
    first, second = other.document.stretches
    assert first.executed and second.executed
    assert Counter(first.executed) + Counter(second.executed) == counts
    assert first.judged == 30 and "device" not in other.document.versions
    merged = merge_runs([tmp_path / "other"], tmp_path / "merged")
    note = f"{counts[ONE_BY_ONE]} of {len(tried)} executed grasps {ONE_BY_ONE}"
    for one in (other, load_run(other.path), merged):
        notes = run_notes(one)
        assert f"{note}; the others in parallel" in notes
        assert any("on 2 devices" in text and "; ".join(cards) in text for text in notes)
    (versions,) = set(other.results["versions"].tolist())
    assert f"device={'; '.join(cards)}".replace(" ", "_") in versions


def test_a_complete_run_returns_at_once(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None, monkeypatch
) -> None:
    first = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=5, blind=True),
        executor=Inline(),
        progress=False,
    )
    monkeypatch.setattr("burg_drake.evaluation.cascade.Job", None)
    again = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=5, blind=True),
        progress=False,
    )
    assert same_results(first, again)
    assert len(again.document.stretches) == 1
    files = {path: path.stat().st_ino for path in first.path.iterdir()}
    assert len(files) == 8
    dates = {path: path.stat().st_mtime_ns for path in files}
    evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=5, blind=True),
        progress=False,
    )
    assert {path: path.stat().st_ino for path in first.path.iterdir()} == files
    assert {path: path.stat().st_mtime_ns for path in files} == dates
    pytest.importorskip("pyarrow")
    parquet = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=5, blind=True, table="parquet"),
        progress=False,
    )
    assert parquet.table_path.suffix == ".parquet"
    assert read_table(parquet.table_path)["id"].tolist() == first.results["id"].tolist()


SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import known_judge
def patch(name, value):
    module, _, attribute = name.rpartition(".")
    __import__(module)
    setattr(sys.modules[module], attribute, value)
known_judge.install(patch, Path(sys.argv[2]), pause=0.2)
from burg_drake import EvaluationSettings, evaluate
settings = EvaluationSettings(grasps_per_object=40, blind=True)
evaluate(sys.argv[3], "panda_tabletop", sys.argv[4], settings=settings, workers=2)
"""


def start(scene: Scene, run: Path, log: Path) -> subprocess.Popen[str]:
    """Another process that evaluates slowly, without a guard around its main module."""
    arguments = [Path(__file__).parent, log, scene.path, run]
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *map(str, arguments)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_lines(path: Path, count: int) -> None:
    until(lambda: path.exists() and path.read_bytes().count(b"\n") >= count)


def test_a_killed_run_goes_on_where_it_was(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch
) -> None:
    journal = tmp_path / "run" / "journal.jsonl"
    process = start(scene, tmp_path / "run", tmp_path / "first.log")
    wait_for_lines(journal, 20)
    process.kill()
    process.communicate()
    time.sleep(0.5)  # the workers find out by themselves
    with journal.open("ab") as file:
        file.write(b'{"id":"left-torn","outc')
    before = set(read_journal(journal))
    assert 20 <= len(before) < 120
    partial = load_run(tmp_path / "run")
    assert not partial.complete and set(partial.results["id"]) == before
    assert partial.document.stretches[0].judged is None

    install(monkeypatch.setattr, tmp_path / "second.log")
    events: list[Progress] = []
    run = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=40, blind=True),
        workers=2,
        progress=events.append,
    )
    again = (tmp_path / "second.log").read_text().split()
    assert len(again) == len(set(again)) == 120 - len(before)
    assert not before & set(again)
    assert events[0].done == events[0].before == len(before) and events[-1].done == 120
    assert [s.judged for s in run.document.stretches] == [None, len(again)]

    fresh = evaluate(
        scene,
        station,
        tmp_path / "fresh",
        settings=EvaluationSettings(grasps_per_object=40, blind=True),
        executor=Inline(),
        progress=False,
    )
    assert same_results(run, fresh)
    assert read_table(run.table_path)["id"].tolist() == run.candidates.id


@pytest.mark.thorough
def test_grasps_whose_workers_were_ended_are_tried_again(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those ended from outside by the same call, those that crashed on request; no others."""

    def judge(known: KnownJudge, out: str, **options: Any) -> Run:
        make = Make(known)
        monkeypatch.setattr(JUDGE_FACTORY, lambda *_: make)
        options |= {"grasps_per_object": 10, "blind": True, "progress": False}
        judging = {"workers": 1} if isinstance(known, ShortOfMemory) else {"executor": Inline()}
        return evaluate(scene, station, tmp_path / out, **asked(**judging, **options))

    def judged(name: str) -> list[str]:
        return (tmp_path / name).read_text().split()

    install(monkeypatch.setattr)
    whole = judge(KnownJudge(), "whole")
    killed, crashing = [id for id in whole.candidates.id if expected(id).stage == "executed"][:2]
    short = ShortOfMemory(killed=(killed,), crashing=(crashing,))
    run = judge(short, "run")
    assert run.complete and run.failures == [killed, crashing] and run.interrupted == [killed]
    assert run.row(killed)["reason"] == "the worker process was killed from outside by SIGKILL"
    assert run.row(crashing)["reason"] == "the worker process was killed by SIGSEGV"

    run = judge(replace(short, log=tmp_path / "short again"), "run")  # dies again: no endless loop
    assert judged("short again") == [killed] and run.interrupted == [killed]
    run = judge(KnownJudge(tmp_path / "enough"), "run")
    assert judged("enough") == [killed] and run.failures == [crashing]
    assert run.row(killed)["outcome"] == expected(killed)
    run = judge(KnownJudge(tmp_path / "none"), "run")
    assert not (tmp_path / "none").exists()
    run = judge(KnownJudge(tmp_path / "failed"), "run", retry_failed=True)
    assert judged("failed") == [crashing] and run.failures == []
    assert same_results(run, whole)
    assert read_table(run.table_path)["outcome"].tolist() == whole.results["outcome"].tolist()
    assert [session.judged for session in run.document.stretches] == [30, 1, 1, 1]


@pytest.mark.thorough
def test_an_interrupt_keeps_what_is_done(scene: Scene, tmp_path: Path) -> None:
    process = start(scene, tmp_path / "run", tmp_path / "log")
    wait_for_lines(tmp_path / "run" / "journal.jsonl", 10)
    os.killpg(process.pid, signal.SIGINT)  # as the terminal does
    _, errors = process.communicate(timeout=HANG_GUARD)
    assert process.returncode == -signal.SIGINT and errors.count("Traceback") == 1
    run = load_run(tmp_path / "run")
    assert run.document.stretches[0].judged == len(run.results["id"]) >= 10
    assert not run.report_path.exists()


def test_another_run_is_not_mixed_in(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    run = tmp_path / "run"
    evaluate(
        scene,
        station,
        run,
        settings=EvaluationSettings(grasps_per_object=5, blind=True),
        executor=Inline(),
        progress=False,
    )
    with pytest.raises(InvalidInputError) as error:
        evaluate(
            scene,
            station,
            run,
            settings=EvaluationSettings(grasps_per_object=6, blind=True, engine="reference"),
            progress=False,
        )
    assert str(error.value) == (
        f"{run} already holds another run (engine is standard there, reference here; grasps are 5"
        " an object, sampled blind there, 6 an object, sampled blind here); choose another"
        " folder, or delete it"
    )
    with pytest.raises(InvalidInputError) as error:
        evaluate(
            scene,
            station,
            run,
            settings=EvaluationSettings(grasps_per_object=5, blind=True, approach_angle_deg=90),
            progress=False,
        )
    assert "(approach angle is 75.0 degrees there, 90.0 degrees here)" in str(error.value)
    with pytest.raises(InvalidInputError, match="mode is reach there, hand here"):
        evaluate(
            scene,
            station,
            run,
            settings=EvaluationSettings(grasps_per_object=5, blind=True, mode="hand"),
            progress=False,
        )
    with pytest.raises(InvalidInputError, match="blind there, 5 an object, clear"):
        evaluate(
            scene, station, run, settings=EvaluationSettings(grasps_per_object=5), progress=False
        )
    blind = {"grasps_per_object": 5, "blind": True, "progress": False}
    with pytest.raises(InvalidInputError, match=r"blind there, .* sampled blind, on bar here"):
        evaluate(scene, station, run, **asked(only=["bar"], **blind))
    whole = evaluate(scene, station, run, **asked(only=["bar", "cube"], **blind))
    assert whole.complete
    grasps = {"bar": GraspSet.create(np.eye(4), object="bar")}
    with pytest.raises(InvalidInputError, match="blind there, 1 given here") as error:
        evaluate(scene, station, run, grasps=grasps, progress=False)
    assert "approach angle" not in str(error.value)  # it goes with the sampling


def test_some_objects_only(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    options = {"grasps_per_object": 3, "blind": True, "executor": Inline(), "progress": False}
    run = evaluate(scene, station, tmp_path / "a", **asked(only=["right", "bar"], **options))
    everything = evaluate(scene, station, tmp_path / "b", **asked(**options))
    assert run.candidates.id == [i for i in everything.candidates.id if not i.startswith("left")]
    assert load_run(run.path).document.grasps.objects == {"cube": 3, "bar": 3}
    assert "--blind --only right,bar" in reproduce_command(run)
    given = {
        name: GraspSet.create(np.eye(4), object=object)
        for name, object in (("left", "cube"), ("bar", "bar"))
    }
    run = evaluate(
        scene,
        station,
        tmp_path / "c",
        settings=EvaluationSettings(only=["cube"]),
        grasps=given,
        executor=Inline(),
        progress=False,
    )
    assert set(run.candidates.instance) == {"left"}
    assert load_run(run.path).document.grasps.objects == {"cube": 1}  # and no bar without grasps
    assert "grasps.npz --only left,right" in reproduce_command(run)
    with pytest.raises(InvalidInputError, match=r"no grasps of right; .* some of left, bar"):
        evaluate(
            scene,
            station,
            tmp_path / "d",
            settings=EvaluationSettings(only=["right"]),
            grasps=given,
            progress=False,
        )
    with pytest.raises(UnknownNameError, match="'lef', which is not a free instance"):
        evaluate(scene, station, tmp_path / "d", grasps={"lef": given["left"]}, progress=False)
    with pytest.raises(UnknownNameError, match="no free instance 'lef'; did you mean 'left'"):
        evaluate(scene, station, tmp_path / "d", **asked(only=["lef"], **options))
    assert not (tmp_path / "d").exists()


def test_given_grasps_are_judged_in_place_of_sampled_ones(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    grasps = {"bar": GraspSet.create(np.eye(4), object="bar")}
    run = evaluate(
        scene, station, tmp_path / "run", grasps=grasps, executor=Inline(), progress=False
    )
    assert run.candidates.id == [f"bar-{grasps['bar'].id[0]}"]
    assert run.document.grasps.objects == {"cube": 0, "bar": 1}
    np.testing.assert_array_equal(run.candidate(run.candidates.id[0]).X_OG, np.eye(4))


def test_given_grasps_are_reproduced_from_the_run(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    poses = make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2]])
    cubes = GraspSet.create(poses, object="cube")
    given = {"right": cubes.select([1]), "left": cubes.select([0])}
    run = evaluate(
        scene, station, tmp_path / "run", grasps=given, executor=Inline(), progress=False
    )
    back = read_grasps(scene, run.path / "grasps.npz").by_instance
    again = evaluate(
        scene, station, tmp_path / "again", grasps=back, executor=Inline(), progress=False
    )
    assert same_results(run, again) and len(again.candidates) == 2
    assert evaluate(scene, station, run.path, grasps=back, progress=False).complete  # the same run


def test_a_set_goes_to_its_instances_or_else_to_all_of_its_object(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    cubes = GraspSet.create(make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2]]), object="cube")
    everywhere = evaluate(
        scene, station, tmp_path / "a", grasps=cubes, executor=Inline(), progress=False
    )
    assert everywhere.candidates.instance.tolist() == ["left", "left", "right", "right"]
    told = cubes.with_columns(instance=["right", "left"])
    run = evaluate(scene, station, tmp_path / "b", grasps=told, executor=Inline(), progress=False)
    assert set(run.candidates.id) == {f"right-{cubes.id[0]}", f"left-{cubes.id[1]}"}


@pytest.mark.parametrize("name", ["scene.yaml", "station.yaml", "grasps.npz", "results.csv"])
def test_own_files_are_not_overwritten(
    name: str, scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / name).write_text("my work")
    with pytest.raises(InvalidInputError) as error:
        evaluate(
            scene,
            station,
            mine,
            settings=EvaluationSettings(grasps_per_object=2, blind=True),
            progress=False,
        )
    assert str(error.value) == (
        f"{mine} is not empty and not a run: it has {name} in it; choose another folder"
    )
    assert {path.name: path.read_text() for path in mine.iterdir()} == {name: "my work"}


@pytest.mark.parametrize("write", ["save_run", "write_copies", "portable_station"])
def test_a_run_that_is_killed_at_its_start_goes_on(
    write: str, scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    def die(*arguments: object) -> None:
        raise KeyboardInterrupt

    options = {"grasps_per_object": 2, "blind": True, "executor": Inline(), "progress": False}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"burg_drake.evaluation.run_folder.{write}", die)
        with pytest.raises(KeyboardInterrupt):
            evaluate(scene, station, tmp_path / "run", **asked(**options))  # type: ignore[arg-type]
    run = evaluate(scene, station, tmp_path / "run", **asked(**options))  # type: ignore[arg-type]
    assert run.complete and run.scene().content == scene.content
    assert run.station().content == station.content


def test_no_grasps_are_a_complete_run(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    run = evaluate(scene, station, tmp_path / "run", grasps={}, progress=False)
    assert run.complete and run.report_path.exists() and run.best() == []


def test_bad_input_is_said_before_any_work(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch
) -> None:
    def evaluate_in(folder: str, **options: object) -> None:
        evaluate(scene, station, tmp_path / folder, **asked(progress=False, **options))  # type: ignore[arg-type]

    install(monkeypatch.setattr)
    monkeypatch.setattr("burg_drake.evaluation.cascade.Job", None)
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"cannot write to folder .*file"):
        evaluate_in("file")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    with pytest.raises(InvalidInputError, match=r"is not empty and not a run: it has thesis.tex"):
        evaluate_in("full")
    with pytest.raises(InvalidInputError, match="workers is 0"):
        evaluate_in("run", workers=0)
    with pytest.raises(InvalidInputError, match="'xlsx' does not exist"):
        evaluate_in("run", table="xlsx")
    with pytest.raises(UnknownNameError, match="engine 'standart'"):
        evaluate_in("run", engine="standart")
    with pytest.raises(InvalidInputError, match=r"^grasps_per_object is 0; give 1 or more$"):
        evaluate_in("run", grasps_per_object=0)
    with pytest.raises(InvalidInputError, match=r"^grasps_per_object is -1; give 1 or more$"):
        evaluate(
            "no such scene",
            "no such station",
            "",
            settings=EvaluationSettings(grasps_per_object=-1),
        )
    with pytest.raises(InvalidInputError, match=r"^approach angle is 181 degrees; give"):
        evaluate_in("run", approach_angle_deg=181.0)
    assert not (tmp_path / "run" / "run.yaml").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_said(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(InvalidInputError, match="Permission denied; choose a writable place"):
        evaluate(scene, station, tmp_path / "locked" / "run", progress=False)


def test_an_unsound_scene_is_refused(scene: Scene, station: Station, tmp_path: Path) -> None:
    def refuse(scene: Scene, station: Station) -> None:
        raise InvalidInputError("'left' and 'right' overlap")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("burg_drake.station.require_valid_scene", refuse)
        with pytest.raises(InvalidInputError, match="overlap"):
            evaluate(scene, station, tmp_path / "run", progress=False)
    assert not (tmp_path / "run").exists()


def test_judges_are_pickled_with_all_they_need(scene: Scene, station: Station) -> None:
    import pickle

    from burg_drake.evaluation import StationJudgeFactory
    from burg_drake.station import ENGINES

    factory = StationJudgeFactory(scene, station, ENGINES["standard"], "reach")
    assert pickle.loads(pickle.dumps(factory)).scene.content == scene.content
    assert pickle.loads(pickle.dumps(Make(KnownJudge()))) == Make(KnownJudge())
