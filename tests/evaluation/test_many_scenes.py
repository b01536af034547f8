"""Runs over many scenes around a known judge: as each scene on its own, however they come about."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from asked import asked
from inline_executor import Inline
from known_judge import JUDGE_FACTORY, KnownJudge, Make, expected, number, refuse
from known_many import OPTIONS, run_all, same
from page_reading import read_page

from burg_drake.core import (
    ONE_BY_ONE,
    GraspSet,
    InvalidInputError,
    Outcome,
    Stage,
    UnknownNameError,
    make_pose,
)
from burg_drake.evaluation import (
    TEXT_COLUMNS,
    Campaign,
    Run,
    campaign_page,
    evaluate,
    load_campaign,
    load_runs,
    read_results,
    summarize,
)
from burg_drake.scene import Scene, load_scene, scene_references
from burg_drake.station import Station

pytest.importorskip("pyarrow")
pytestmark = pytest.mark.usefixtures("pages")


def test_each_scene_is_as_on_its_own(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    campaign = load_campaign(whole.path)
    assert campaign.names == ["cubes", "moved", "three"] and campaign.complete
    alone: list[Run] = [
        evaluate(path, station, tmp_path / path.stem, **asked(executor=Inline(1), **OPTIONS))
        for path in scenes
    ]
    for run, own in zip(load_runs(campaign.path), alone, strict=True):
        assert same(run.results, own.results)
        assert {p.name for p in run.path.iterdir()} == {p.name for p in own.path.iterdir()}
    table = campaign.results
    for name in ("id", "outcome", "slip", "run", "seed", "X_OG", "given_none"):
        parts = [run.results.get(name, np.full(len(run.results["id"]), np.nan)) for run in alone]
        found = read_results(campaign.path, [name])[name]
        assert np.array_equal(found, np.concatenate(parts), equal_nan=name not in TEXT_COLUMNS)
    assert np.isnan(table["moved_bar"][:10]).all()
    summary, own = summarize(campaign), [summarize(run) for run in alone]
    assert [group.judged for group in summary.scenes] == [10, 15, 15]
    assert summary.total.outcomes == sum((s.total.outcomes for s in own), start=Counter())
    for name in ("cube", "bar"):
        (group,) = [g for g in summary.objects if g.name == name]
        assert group.judged == sum(g.judged for s in own for g in s.objects if g.name == name)


def test_sessions_count_the_grasps_of_each_device(
    scenes: list[Path],
    station: Station,
    tmp_path: Path,
    known_judge: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the run over many scenes, and in that of each scene."""
    make = Make(KnownJudge(devices=("NVIDIA H100", ONE_BY_ONE)))
    monkeypatch.setattr(JUDGE_FACTORY, lambda *_: make)
    campaign = run_all(scenes, station, tmp_path / "all")
    ids = [id for run in load_runs(campaign.path) for id in run.candidates.id]
    tried = [id for id in ids if expected(id).stage is Stage.EXECUTED]
    counts = Counter(make.judge.devices[number(id) % 2] for id in tried)
    (session,) = campaign.document.stretches
    assert session.executed == counts and len(counts) == 2
    runs = [one.document.stretches[0].executed for one in load_runs(campaign.path)]
    assert sum(map(Counter, runs), Counter()) == counts
    note = f"{counts[ONE_BY_ONE]} of {len(tried)} executed grasps {ONE_BY_ONE}"
    assert any(text.startswith(note) for text in summarize(campaign).notes)


def test_any_program_reads_the_parts(whole: Campaign) -> None:
    pandas = pytest.importorskip("pandas")
    campaign = load_campaign(whole.path)
    theirs = pandas.read_parquet(campaign.path / "parts")
    ours = campaign.frame()
    assert len(theirs) == len(ours) == 40
    assert theirs["id"].tolist() == ours["id"].tolist() == campaign.results["id"].tolist()
    assert np.array_equal(theirs["moved_bar"], ours["moved_bar"], equal_nan=True)
    assert ours["outcome"].tolist() == [expected(id) for id in ours["id"]]
    assert ours["outcome"].cat.categories.tolist() == [o.value for o in Outcome]
    assert ours["stage"].cat.ordered and ours["name"].tolist()[:10] == ["cubes"] * 10
    single = campaign.run("three").frame(["id", "outcome", "slip"])
    assert single["outcome"].tolist() == ours["outcome"].tolist()[25:]
    assert single["outcome"].dtype == ours["outcome"].dtype


def test_an_interrupted_call_goes_on(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    executor = Inline(seed=2, stop=17)
    with pytest.raises(KeyboardInterrupt):
        run_all(scenes, station, tmp_path / "again", executor=executor)
    there = load_campaign(tmp_path / "again")
    assert len(there.columns(["id"])["id"]) == 17 and not there.complete
    rest = Inline(seed=3)
    again = run_all(scenes, station, tmp_path / "again", executor=rest)
    assert rest.judged == 40 - 17
    assert same(whole.results, again.results)
    assert [session.judged for session in again.document.stretches] == [17, 23]
    nothing = Inline()
    files = {p: p.stat().st_mtime_ns for p in again.path.rglob("*") if p.is_file()}
    run_all(scenes, station, tmp_path / "again", executor=nothing)
    assert nothing.judged == 0
    assert {p: p.stat().st_mtime_ns for p in again.path.rglob("*") if p.is_file()} == files


def test_without_what_can_be_deleted_it_is_the_same(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    campaign = load_campaign(shutil.copytree(whole.path, tmp_path / "all"))
    before = campaign.results
    shutil.rmtree(campaign.path / "parts")
    assert same(before, load_campaign(campaign.path).results)
    (campaign.path / "scenes.jsonl").unlink()
    again = run_all(scenes, station, campaign.path, executor=(executor := Inline()))
    assert executor.judged == 0 and again.complete
    assert same(before, again.results) and list((campaign.path / "parts").iterdir())


def test_what_is_not_the_same_is_refused(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    out = shutil.copytree(whole.path, tmp_path / "all")
    changed = rewritten(scenes[1], tmp_path, "0.12", "0.13")
    with pytest.raises(InvalidInputError, match=r"another run \(scenes: changed moved\); choose"):
        run_all([scenes[0], changed, scenes[2]], station, out)
    with pytest.raises(InvalidInputError, match=r"\(scenes: only there three\)"):
        run_all(scenes[:2], station, out)
    with pytest.raises(InvalidInputError, match=r"\(seed is 0 there, 1 here\)"):
        run_all(scenes, station, out, seed=1)
    with pytest.raises(InvalidInputError, match="holds all of this run, but shard 1/2 is given"):
        run_all(scenes, station, out, shard="1/2")
    with pytest.raises(InvalidInputError, match=r"not a run: it has .* in it"):
        run_all(scenes, station, tmp_path)
    with pytest.raises(InvalidInputError, match=r"cubes\.yaml is given twice; give it once"):
        run_all([scenes[0], scenes[0]], station, tmp_path / "twice")
    with pytest.raises(InvalidInputError, match=r"three\.yaml are the same scene; give it once"):
        run_all([rewritten(scenes[2], tmp_path, "", ""), *scenes], station, tmp_path / "twice")
    with pytest.raises(InvalidInputError, match=r"2 of 3 scenes cannot be read: .*gone.*other"):
        run_all([scenes[0], "gone.yaml", "other.yaml"], station, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    with pytest.raises(UnknownNameError, match="'mug'; known: bar, cu"):
        run_all(scenes, station, tmp_path / "new", only=["mug"])


def test_a_scene_that_cannot_be_judged_does_not_stop_the_others(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None, monkeypatch
) -> None:
    def unsound(scene: Scene, *_: object) -> None:
        if scene.name == "cubes":
            raise InvalidInputError("two cubes overlap")

    def judge(scene: Scene, *_):
        return refuse if scene.name == "moved" else made(scene)

    from burg_drake.evaluation import run_preparation, scene_tasks

    made, sound = run_preparation.StationJudgeFactory, scene_tasks.require_sound
    monkeypatch.setattr("burg_drake.evaluation.scene_tasks.require_sound", unsound)
    monkeypatch.setattr(JUDGE_FACTORY, judge)
    campaign = run_all(scenes, station, tmp_path / "all")
    assert campaign.failed == {"cubes": "two cubes overlap", "moved": "no such model"}
    assert not campaign.complete and campaign.run("three").complete
    assert summarize(campaign).notes == ("2 scenes could not be judged: cubes, moved",)
    monkeypatch.setattr("burg_drake.evaluation.scene_tasks.require_sound", sound)
    monkeypatch.setattr(JUDGE_FACTORY, made)
    mended = run_all(scenes, station, tmp_path / "all", executor=(executor := Inline()))
    assert mended.complete and not mended.failed and executor.judged == 25


def test_of_many_scenes_only_who_asks_gets_reports(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None, monkeypatch
) -> None:
    def reports() -> list[bool]:
        return [run.report_path.exists() for run in campaign.runs]

    monkeypatch.setattr("burg_drake.evaluation.run_document.MAX_SCENES_WITH_REPORTS", 2)
    campaign = run_all(scenes, station, tmp_path / "all", grasps_per_object=1)
    assert campaign.complete and reports() == [False] * 3
    assert all(run.table_path.exists() for run in campaign.runs)
    dates = {run.table_path: run.table_path.stat().st_mtime_ns for run in campaign.runs}
    prepared: list[str] = []
    monkeypatch.setattr(
        "burg_drake.evaluation.scene_tasks.open_run",
        lambda folder, *_: prepared.append(folder.name),
    )
    run_all(scenes, station, tmp_path / "all", grasps_per_object=1)  # has nothing to do
    assert not prepared and all(p.stat().st_mtime_ns == date for p, date in dates.items())
    monkeypatch.undo()
    page = read_page(campaign_page(campaign))
    assert f"burg-drake report {tmp_path}/all/scenes/" in page.text


@pytest.mark.parametrize("asked", [False, True])
def test_reports_of_scenes_as_asked(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None, asked: bool
) -> None:
    campaign = run_all(scenes[:2], station, tmp_path / "all", scene_reports=not asked, only=["bar"])
    again = run_all(scenes[:2], station, campaign.path, scene_reports=asked, only=["bar"])
    assert again.run("moved").report_path.exists()  # one that is not out of date stays
    journal = again.run("moved").path / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:-1])
    run_all(scenes[:2], station, campaign.path, scene_reports=asked, only=["bar"])
    assert again.run("moved").report_path.exists() == asked


def rewritten(scene: Path, folder: Path, old: str, new: str) -> Path:
    """A scene with another text, in another folder."""
    library = str(scene.parent.parent / "shapes")
    text = scene.read_text().replace(old, new).replace("../shapes", library)
    (folder / scene.name).write_text(text)
    return folder / scene.name


def test_names_and_places(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None
) -> None:
    other = rewritten(scenes[0], tmp_path, "0.1", "0.11")
    campaign = run_all([*scenes, other], station, tmp_path / "all", grasps_per_object=1)
    assert campaign.names == ["cubes", "moved", "three", "cubes_2"]
    assert campaign.run("cubes_2").scene().path.parent == campaign.path / "scenes/cubes_2"
    assert scene_references([str(scenes[0].parent)]) == [str(path) for path in scenes]
    assert scene_references([f"{scenes[0].parent}/*e*.yaml"]) == [str(path) for path in scenes]
    with pytest.raises(InvalidInputError, match="has no scenes"):
        scene_references([str(tmp_path / "all/scenes")])


def test_given_grasps_go_where_their_objects_are(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None
) -> None:
    X_OG = np.array([make_pose(np.diag([1.0, -1.0, -1.0]), (0, 0, z)) for z in (0.0, 0.001)])
    grasps = GraspSet.create(X_OG, object=["bar", "bar"], width=0.03)
    campaign = run_all(scenes, station, tmp_path / "all", grasps=grasps)
    assert {name: state.state for name, state in campaign.states.items()} == {
        "cubes": "empty",
        "moved": "done",
        "three": "done",
    }
    assert campaign.complete and len(campaign.runs) == 2
    alone = evaluate(
        scenes[2], station, tmp_path / "one", grasps=grasps, executor=Inline(), progress=False
    )
    assert same(campaign.run("three").results, alone.results)
    assert summarize(campaign).notes == ("1 scenes have no grasps to judge: cubes",)
    only = run_all(scenes, station, tmp_path / "only", only=["bar"])
    assert set(only.columns(["object"])["object"].tolist()) == {"bar"}
    assert load_scene(scenes[0]).content == only.document.scenes[0].content


def test_fewer_grasps_than_asked_are_explained(
    scenes: list[Path],
    station: Station,
    tmp_path: Path,
    known_judge: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def shortfall(name: str, asked: int, part: object, found: int) -> str:
        return f"{name}: {found} of 6" if name == "bar" else ""

    monkeypatch.setattr("burg_drake.evaluation.run_summary.shortfall_note", shortfall)
    campaign = run_all(scenes, station, tmp_path / "all")
    assert summarize(load_campaign(campaign.path)).notes == (
        "scene moved: bar: 5 of 6",
        "scene three: bar: 5 of 6",
    )
