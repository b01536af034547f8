"""Shards of runs, and what comes of them: the rows of a run that nobody divided."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from asked import asked
from inline_executor import Inline
from known_many import OPTIONS, run_all, same

from burg_drake.core import UNFINISHED_FILE, InvalidInputError, Outcome
from burg_drake.evaluation import (
    JOURNAL_FILE,
    Campaign,
    Run,
    Shard,
    decode_verdict,
    encode_verdict,
    evaluate,
    load_run,
    merge_folders,
    merged_run,
    report_page,
)
from burg_drake.scene import Scene
from burg_drake.station import Station
from tests.thorough import thorough

pytestmark = pytest.mark.usefixtures("pages")


def run_one(scene: Scene, station: Station, out: Path, **options) -> Run:
    executor = options.pop("executor", None) or Inline()
    return evaluate(scene, station, out, **asked(executor=executor, **{**OPTIONS, **options}))


def change(run: Run, **values) -> str:
    """Changes the first verdict of a journal; the id of its grasp."""
    journal = run.path / JOURNAL_FILE
    first, *rest = journal.read_bytes().splitlines(keepends=True)
    id, verdict = decode_verdict(first)
    journal.write_bytes(b"".join([encode_verdict(id, replace(verdict, **values)), *rest]))
    return id


def test_shares_are_whole_and_apart() -> None:
    for count in (1, 2, 3, 7):
        shards = [Shard(k, count) for k in range(1, count + 1)]
        assert all(sum(shard.has(place) for shard in shards) == 1 for place in range(20))
    for text in ("0/2", "3/2", "1", "1/2/3", "-1/2", "a/b"):
        with pytest.raises(InvalidInputError, match="shard"):
            Shard.parse(text)


def test_shards_of_one_scene(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    whole = run_one(scene, station, tmp_path / "whole")
    shards = [
        run_one(scene, station, tmp_path / f"s{k}", shard=f"{k}/3", executor=Inline(seed=k))
        for k in (1, 2, 3)
    ]
    for k, shard in enumerate(shards):
        assert shard.complete and shard.document.hash == whole.document.hash
        assert shard.results["id"].tolist() == whole.candidates.id[k::3]
        assert f"shard {k + 1}/3:" in (shard.path / "results.csv-metadata.json").read_text()
    assert "This is shard 3 of 3" in report_page(shards[2])
    merged = merge_folders([shard.path for shard in reversed(shards)], tmp_path / "merged")
    assert merged.notes == () and isinstance(merged.result, Run)
    assert same(whole.results, merged.result.results) and merged.result.complete
    assert merged.result.scene().content == scene.content
    nothing = Inline()
    run_one(scene, station, tmp_path / "merged", executor=nothing)
    assert nothing.judged == 0
    two = merge_folders([shards[0].path, shards[2].path], tmp_path / "two")
    assert two.notes == (
        "5 grasps are not judged yet",
        "shards that were not given: 2/3",
        f"to judge the rest, run the same evaluation into {tmp_path / 'two'}, with no shard",
    )
    rest = run_one(scene, station, tmp_path / "two", executor=(executor := Inline()))
    assert executor.judged == 5 and same(whole.results, rest.results)


@pytest.mark.parametrize("count", [2, thorough(4)])  # scenes as wholes, and grasps of each
def test_shards_of_many_scenes(
    count: int,
    scenes: list[Path],
    whole: Campaign,
    station: Station,
    tmp_path: Path,
    known_judge: None,
) -> None:
    folders = []
    for k in range(1, count + 1):
        shard = run_all(scenes, station, tmp_path / f"s{k}", shard=f"{k}/{count}")
        assert shard.complete and len(shard.document.scenes) == 3
        folders.append(shard.path)
    merged = merge_folders(folders, tmp_path / "merged")
    assert merged.notes == () and isinstance(merged.result, Campaign)
    assert same(whole.results, merged.result.results) and merged.result.complete
    nothing = Inline()
    again = run_all(scenes, station, tmp_path / "merged", executor=nothing)
    assert nothing.judged == 0 and same(whole.results, again.results)
    part = merge_folders(folders[1:], tmp_path / "part")
    if count == 2:
        alone = ("only shard 2/2 was given, so the merged run has that shard alone",)
        assert part.notes == alone and part.result.complete
        return
    assert f"shards that were not given: 1/{count}" in part.notes
    rest = run_all(scenes, station, tmp_path / "part", executor=(executor := Inline()))
    assert same(whole.results, rest.results) and 0 < executor.judged < 40


@pytest.mark.thorough
def test_interrupted_copies(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    for name, seed, stop in (("a", 1, 22), ("b", 2, 31)):
        with pytest.raises(KeyboardInterrupt):
            run_all(scenes, station, tmp_path / name, executor=Inline(seed, stop))
    merged = merge_folders([tmp_path / "a", tmp_path / "b"], tmp_path / "ab")
    assert merged.missing + len(merged.result.results["id"]) == 40 and merged.missing <= 9
    run_all(scenes, station, tmp_path / "ab")
    assert same(whole.results, Campaign(tmp_path / "ab", merged.result.document).results)


def test_verdicts_give_way(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    whole = run_one(scene, station, tmp_path / "whole")
    for name in ("interrupted", "failed", "slow", "other"):
        shutil.copytree(whole.path, tmp_path / name)
    broken = {"outcome": Outcome.SIMULATION_FAILED, "reason": "ended"}
    change(load_run(tmp_path / "interrupted"), **broken, interrupted=True)
    id = change(load_run(tmp_path / "failed"), **broken)
    change(load_run(tmp_path / "slow"), cpu={})
    names = ("interrupted", "failed", "slow")
    merged = merge_folders([tmp_path / name for name in names], tmp_path / "three")
    assert same(merged.result.results, whole.results)
    merged = merge_folders([tmp_path / name for name in names[:2]], tmp_path / "two").result
    assert merged.failures == [id] and merged.interrupted == []
    outcome = load_run(tmp_path / "other").verdicts[id].outcome
    instead = Outcome.DROPPED if outcome is not Outcome.DROPPED else Outcome.LIFTED
    change(load_run(tmp_path / "other"), outcome=instead)
    message = (
        f"grasp {id} ended as {outcome} in {whole.path} and as {instead} in"
        f" {tmp_path}/other; the same run gives the same verdict on every machine, so one"
        " of them was judged in another way: leave it out"
    )
    with pytest.raises(InvalidInputError) as error:
        merge_folders([whole.path, tmp_path / "other"], tmp_path / "no")
    assert str(error.value) == message.replace(" and as ", " and ", 1)
    assert not (tmp_path / "no").exists() and not list(tmp_path.glob(".no.*"))


def test_refusals(
    scene: Scene, scenes: list[Path], station: Station, tmp_path: Path, known_judge: None
) -> None:
    a = run_one(scene, station, tmp_path / "a", grasps_per_object=1)
    b = run_one(scene, station, tmp_path / "b", grasps_per_object=1, seed=1)
    many = run_all(scenes, station, tmp_path / "many", grasps_per_object=1)
    for paths, out, message in (
        ([a.path, b.path], "c", "(seed is 0 there, 1 here); only shards or copies of the same run"),
        ([a.path, many.path], "c", "many one of many scenes; merge runs of one kind"),
        ([a.path], "b", "b exists already; choose another folder"),
        ([tmp_path / "nothing"], "c", "is not the folder of a run (run.yaml is missing)"),
        ([], "c", "no runs are given; give the folders of one or more"),
    ):
        with pytest.raises(InvalidInputError) as error:
            merge_folders(paths, tmp_path / out)
        assert message in str(error.value)


def test_a_merge_that_was_killed_leaves_nothing(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    run = run_one(scene, station, tmp_path / "a", grasps_per_object=1)
    left = tmp_path / ".b.0123456789abcdef"
    left.mkdir()
    (left / JOURNAL_FILE).write_bytes(b"half")
    merge_folders([run.path], tmp_path / "b")
    assert not left.exists() and same(load_run(tmp_path / "b").results, run.results)


def test_the_same_merge_finishes_what_was_killed(
    scenes: list[Path], scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    few = {"grasps_per_object": 1}
    halves = [
        run_one(scene, station, tmp_path / f"{k}", **few, shard=f"{k}/3").path for k in (1, 2)
    ]
    shards = [
        run_all(scenes, station, tmp_path / f"many{k}", **few, shard=f"{k}/3").path for k in (1, 2)
    ]
    for paths, where in ((halves, "finish_run"), (shards, "update_parts")):
        whole = merge_folders(paths, tmp_path / f"whole_{where}")
        out = tmp_path / where
        with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(f"burg_drake.evaluation.run_merging.{where}", interrupt)
            merge_folders(paths, out)
        assert not (out / "report.html").exists()
        (note,) = out.glob(".merge.*")
        assert UNFINISHED_FILE.fullmatch(note.name)  # `evaluate` removes it
        with pytest.raises(InvalidInputError, match="exists already; choose another folder"):
            merge_folders(paths[:1], out)
        merged = merge_folders(reversed(paths), out)
        assert same(merged.result.results, whole.result.results)
        assert merged.notes == tuple(n.replace(f"whole_{where}", where) for n in whole.notes)
        files = [
            sorted(str(p.relative_to(r)) for p in r.rglob("*")) for r in (out, whole.result.path)
        ]
        assert files[0] == files[1] and "report.html" in files[0]


def interrupt(*_, **__) -> None:
    raise KeyboardInterrupt


@pytest.mark.thorough
def test_what_is_merged_cannot_be_written_meanwhile(
    scenes: list[Path], scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    one = run_one(scene, station, tmp_path / "one", grasps_per_object=1)
    many = run_all(scenes, station, tmp_path / "many", grasps_per_object=1)
    (many.path / ".lock").unlink()  # as in a copy
    tried = []

    def look(*arguments, **options):
        tried.append(arguments)
        with pytest.raises(InvalidInputError, match="is being written by another process"):
            run_one(scene, station, tmp_path / "one", grasps_per_object=1)
        return choose(*arguments, **options)

    def look_at_many(*arguments, **options):
        tried.append(arguments)
        for call, given, out in (
            (run_all, scenes, many.path),
            (run_one, scenes[0], many.path / "scenes" / "cubes"),
        ):
            with pytest.raises(InvalidInputError, match="is being written by another process"):
                call(given, station, out, grasps_per_object=1)
        return copytree(*arguments, **options)

    choose, copytree = merged_run.choose_verdicts, shutil.copytree
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(merged_run, "choose_verdicts", look)
        merge_folders([one.path], tmp_path / "a")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            shutil,
            "copytree",
            lambda a, b, **o: look_at_many(a, b, **o) if a.name == "cubes" else copytree(a, b, **o),
        )
        merge_folders([many.path], tmp_path / "b")
    assert len(tried) == 2
    run_one(scene, station, one.path, grasps_per_object=1)
    run_all(scenes, station, many.path, grasps_per_object=1)


def test_reports_of_scenes_do_not_name_the_old_folder(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None, reports: None
) -> None:
    old = run_all(scenes[:1], station, tmp_path / "old", grasps_per_object=1)
    merge_folders([old.path], tmp_path / "new")
    for path in (tmp_path / "new").rglob("report.html"):
        assert f"{tmp_path}/new" in path.read_text() and f"{tmp_path}/old" not in path.read_text()
    assert len(list((tmp_path / "new").rglob("report.html"))) == 2
