"""`status` from another process than the one that works, and a campaign that is killed."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from asked import asked
from inline_executor import Inline
from known_many import OPTIONS, run_all, same

from burg_drake.apps import main
from burg_drake.core import Outcome
from burg_drake.evaluation import (
    JOURNAL_FILE,
    Campaign,
    Journal,
    PartWriter,
    Run,
    RunWatch,
    decode_verdict,
    encode_verdict,
    evaluate,
    load_campaign,
    part_store,
    read_journal_counts,
    read_status,
    save_run,
)
from burg_drake.scene import Scene
from burg_drake.station import Station

pytestmark = pytest.mark.usefixtures("pages")
SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
import known_judge
from inline_executor import Inline
from burg_drake.evaluation import cascade
from burg_drake.evaluation import many_scenes
def patch(place, value):
    module, _, name = place.rpartition(".")
    if "reachability" not in place:
        setattr(__import__(module, fromlist=[name]), name, value)
known_judge.install(patch, pause=0.04)
cascade.evaluate({scenes!r}, "panda_tabletop", {out!r}, executor=Inline(3),
    settings=cascade.EvaluationSettings(grasps_per_object=5, blind=True), progress=False)
"""


def test_of_a_run(scene: Scene, station: Station, tmp_path: Path, known_judge: None) -> None:
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        evaluate(scene, station, out, **asked(executor=Inline(stop=6), **OPTIONS))
    watch = RunWatch(out)
    status = watch.look()
    assert (status.judged, status.total, status.complete, status.working) == (6, 15, False, False)
    run = evaluate(scene, station, out, **asked(executor=Inline(), **OPTIONS))
    status = watch.look()
    assert (status.judged, status.complete, status.left) == (15, True, None)
    assert status.outcomes == Counter(run.results["outcome"].tolist())
    journal = out / JOURNAL_FILE
    lines = journal.read_bytes().splitlines(keepends=True)
    fail = b'{"id":"new","outcome":"simulation_failed","stage":"executed"}\n'
    journal.write_bytes(b"".join(lines[:-2]) + fail)
    assert read_status(out).outcomes["simulation_failed"] == 1
    journal.write_bytes(b"".join(lines[:-2]) + fail + fail.replace(b"simulation_failed", b"lifted"))
    again = read_status(out)
    assert again.outcomes["simulation_failed"] == 0 and again.judged == 14


def test_the_rate_is_that_of_the_stretch_under_way(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        evaluate(scene, station, out, **asked(executor=Inline(stop=9), **OPTIONS))
    run = evaluate(scene, station, out, **asked(executor=Inline(), **OPTIONS))
    killed, last = run.document.stretches
    assert (killed.before, killed.judged, last.before, last.judged) == (0, 9, 9, 6)
    started = (datetime.now(UTC) - timedelta(seconds=10)).isoformat()
    for before, rate in ((9, 0.6), (None, None)):
        now = replace(last, started=started, before=before, judged=None, seconds=None)
        stretches = (replace(killed, judged=None, seconds=None), now)  # by kill -9
        save_run(Run(out, replace(run.document, stretches=stretches)))
        with Journal(out / JOURNAL_FILE):
            assert read_status(out).rate == (None if rate is None else pytest.approx(rate, rel=0.1))


def test_parts_are_not_counted_again(whole: Campaign, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(part_store, "PART_ROWS", 12)
    campaign = load_campaign(shutil.copytree(whole.path, tmp_path / "all"))
    for journal in campaign.path.glob("scenes/[mt]*/journal.jsonl"):
        first, *rest = journal.read_bytes().splitlines(keepends=True)
        id, verdict = decode_verdict(first)
        failed = encode_verdict(id, replace(verdict, outcome=Outcome.SIMULATION_FAILED))
        journal.write_bytes(b"".join([failed, *rest]))
        if journal.parent.name == "three":  # and judged again after it went to a part
            PartWriter(campaign).add_new_rows()
            journal.write_bytes(journal.read_bytes() + first)
    writer = PartWriter(campaign)
    writer.add_new_rows(["cubes", "moved"])
    writer.flush()
    counts = read_journal_counts(campaign)
    for name in ("cubes", "moved"):
        assert counts[name].counted_bytes == (campaign.folder(name) / JOURNAL_FILE).stat().st_size
    told = read_status(campaign.path)
    assert told.outcomes == Counter(campaign.columns(["outcome"])["outcome"].tolist())
    assert told.judged == 40 and told.outcomes["simulation_failed"] == 1
    shutil.rmtree(campaign.path / "parts")
    assert read_status(campaign.path) == told


@pytest.mark.thorough
def test_of_a_campaign_that_is_killed(
    scenes: list[Path],
    whole: Campaign,
    station: Station,
    tmp_path: Path,
    known_judge: None,
    capsys,
) -> None:
    out = tmp_path / "killed"
    names = [str(path) for path in scenes]
    text = SCRIPT.format(tests=str(Path(__file__).parent), scenes=names, out=str(out))
    process = subprocess.Popen([sys.executable, "-c", text], cwd=tmp_path)
    try:
        while not (out / "campaign.yaml").exists():
            assert process.poll() is None
            time.sleep(0.02)
        watch = RunWatch(out)
        while (status := watch.look()).judged < 13:
            assert process.poll() is None
            time.sleep(0.01)
        assert status.working and status.total == 40 and status.scenes == 3
        assert 13 <= sum(status.outcomes.values()) == status.judged < 40
        assert "being written" in str(refused(scenes, station, out))
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    there = read_status(out)
    assert not there.working and there.judged >= status.judged and not there.complete
    assert len(load_campaign(out).columns(["id"])["id"]) == there.judged
    again = run_all(scenes, station, out)
    assert same(whole.results, again.results)
    capsys.readouterr()
    assert main(["status", str(out), "--json", "--follow"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["complete"] and told["judged"] == told["total"] == 40 and told["done"] == 3
    assert main(["status", str(out)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("40 of 40 grasps judged (100 %)\noutcomes  ")
    assert "scenes    3 of 3 done\nprocess   none, and nothing is left to do; last" in text


def refused(scenes: list[Path], station: Station, out: Path) -> Exception:
    with pytest.raises(ValueError) as error:
        run_all(scenes, station, out)
    return error.value
