"""The columnar store: never another result than the journals', whatever happens to it or them."""

from __future__ import annotations

import importlib
import itertools
import random
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from asked import asked
from inline_executor import Inline
from known_many import OPTIONS, run_all, same

from burg_drake.evaluation import (
    JOURNAL_FILE,
    Campaign,
    Columns,
    PartWriter,
    evaluate,
    load_campaign,
    load_run,
    open_part,
    part_store,
    read_results,
    summarize,
    write_part,
)
from burg_drake.station import Station

pytestmark = pytest.mark.usefixtures("pages")


@pytest.fixture
def campaign(whole: Campaign, tmp_path: Path, monkeypatch) -> Campaign:
    """With several parts."""
    monkeypatch.setattr(part_store, "PART_ROWS", 12)
    campaign = load_campaign(shutil.copytree(whole.path, tmp_path / "all"))
    shutil.rmtree(campaign.path / "parts")
    refresh(campaign)
    return campaign


def from_journals(campaign: Campaign) -> Columns:
    tables = [load_run(stored.folder).results for stored in campaign.stored_runs]
    names = ("id", "outcome", "slip", "X_OG", "run")
    return {name: np.concatenate([table[name] for table in tables]) for name in names}


def require_true(campaign: Campaign, truth: Columns | None = None) -> None:
    truth = truth or from_journals(campaign)
    assert same(truth, load_campaign(campaign.path).columns(list(truth)))


def refresh(campaign: Campaign) -> PartWriter:
    writer = PartWriter(campaign)
    writer.add_new_rows()
    writer.close()
    return writer


def test_damage(campaign: Campaign) -> None:
    parts = sorted((campaign.path / "parts").iterdir())
    assert len(parts) > 1
    part = parts[0]
    data = part.read_bytes()
    truth = from_journals(campaign)
    rng = random.Random(0)
    places = [
        0,
        3,
        4,
        len(data) - 1,
        len(data) - 5,
        len(data) - 9,
        *rng.sample(range(len(data)), 12),
    ]
    for place in places:
        part.write_bytes(
            data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :]
        )
        require_true(campaign, truth)
    for length in (0, 7, len(data) // 2, len(data) - 1):
        part.write_bytes(data[:length])
        require_true(campaign, truth)
    refresh(campaign)
    require_true(campaign)
    assert load_campaign(campaign.path).rows(["id"]).table.num_rows != 0
    (campaign.path / "parts" / "part-000099-0123456789abcdef.parquet").write_bytes(b"PAR1")
    require_true(campaign)


def test_journals_count(campaign: Campaign) -> None:
    journal = campaign.folder("moved") / JOURNAL_FILE
    data = journal.read_bytes()
    lines = data.splitlines(keepends=True)
    states = [
        data + b'{"id":"torn',
        data[:-1],
        data[: len(data) // 2],
        b"",
        b"".join(reversed(lines)),
        data.replace(b'"outcome":"lifted"', b'"outcome":"slippd"'),
        data.replace(b'"outcome":"lifted"', b'"outcome":"dropped"').replace(
            b'"slip":0', b'"slip":1'
        ),
    ]
    for state in states:
        journal.write_bytes(state)
        require_true(campaign)
        refresh(campaign)
        require_true(campaign)


@pytest.mark.thorough
def test_grown_journals_and_later_verdicts(campaign: Campaign) -> None:
    journal = campaign.folder("moved") / JOURNAL_FILE
    data = journal.read_bytes()
    lines = data.splitlines(keepends=True)
    ends = [sum(map(len, lines[:k])) for k in (0, 4, 9, len(lines))]
    for begin, end in itertools.pairwise(ends):
        journal.write_bytes(data[:begin])
        refresh(campaign)
        journal.write_bytes(data[:end] + b"to")
        require_true(campaign)
        refresh(campaign)
        require_true(campaign)
    journal.write_bytes(data + lines[3])
    require_true(campaign)
    refresh(campaign)
    require_true(campaign)
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(campaign.path / "parts")
    pairs = zip(table.column("run").to_pylist(), table.column("id").to_pylist(), strict=True)
    assert table.num_rows == len(set(pairs)) == 40


def test_an_edit_is_noticed_wherever_it_is(campaign: Campaign, monkeypatch) -> None:
    monkeypatch.setattr("burg_drake.evaluation.table_parts.SEGMENT_TAIL", 64)
    journal = campaign.folder("moved") / JOURNAL_FILE
    data = journal.read_bytes()
    lines = data.splitlines(keepends=True)
    cut = sum(map(len, lines[:7]))
    journal.write_bytes(data[:cut])
    refresh(campaign)
    journal.write_bytes(data)
    for grown in (False, True):  # into a segment of its own
        if grown:
            refresh(campaign)
        for place in (0, 3, 5):
            edited = lines[place].replace(b'"blocker":"', b'"blocker":"un')
            journal.write_bytes(b"".join([*lines[:place], edited, *lines[place + 1 :]]))
            require_true(campaign)
            same_length = lines[place].replace(b'"slip":0.', b'"slip":1.')
            journal.write_bytes(b"".join([*lines[:place], same_length, *lines[place + 1 :]]))
            require_true(campaign)
        journal.write_bytes(data)
        refresh(campaign)


def test_what_nobody_touched_is_not_read(campaign: Campaign, monkeypatch) -> None:
    monkeypatch.setattr("burg_drake.evaluation.table_parts.SEGMENT_TAIL", 64)
    read = []
    segments = importlib.import_module("burg_drake.evaluation.table_parts")
    hashed = segments._stream_hash
    monkeypatch.setattr(
        segments, "_stream_hash", lambda s, a, b: (read.append(b - a), hashed(s, a, b))[1]
    )
    load_campaign(campaign.path).columns(["slip"])
    assert read and max(read) <= 64


@pytest.mark.thorough
def test_kills_at_every_byte(
    scenes: list[Path], whole: Campaign, station: Station, tmp_path: Path, known_judge: None
) -> None:
    shutil.copytree(whole.path, tmp_path / "all")
    truth = whole.results
    rng = random.Random(1)
    for path in ("scenes.jsonl", "scenes/moved/journal.jsonl", "scenes/three/grasps.npz"):
        file = tmp_path / "all" / path
        data = file.read_bytes()
        npz = path.endswith("npz")
        for length in (rng.randrange(len(data)), len(data) - 1)[npz:]:
            if npz:  # comes before run.yaml, whole or not at all
                (file.parent / "run.yaml").unlink()
                for name in file.parent.iterdir():
                    if name.name not in (JOURNAL_FILE, "grasps.npz"):
                        name.unlink()
                (file.parent / JOURNAL_FILE).write_bytes(b"")
            else:
                file.write_bytes(data[:length])
            again = run_all(scenes, station, tmp_path / "all", executor=Inline(seed=length))
            assert same(truth, again.results) and again.complete
            file.write_bytes(data) if path.endswith("jsonl") and "scenes/" not in path else None


def test_a_large_run_of_one_scene(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None, monkeypatch
) -> None:
    monkeypatch.setattr(part_store, "PART_ROWS", 7)
    monkeypatch.setattr(part_store, "BATCH_BYTES", 2000)
    run = evaluate(scenes[1], station, tmp_path / "one", **asked(executor=Inline(), **OPTIONS))
    assert len(list((run.path / "parts").iterdir())) == 2
    assert same(run.results, read_results(run.path))
    names = ["outcome", "slip", "none"]
    assert list(read_results(run.path, names)) == names


def test_parts_of_a_release_that_knew_fewer_columns(campaign: Campaign) -> None:
    """They are read, and summed up, with nothing in the columns that they lack."""
    before = summarize(campaign)
    lacking = ["confidence", "judged_again", "outcome_before"]
    for path in sorted((campaign.path / "parts").glob("*.parquet")):
        part = open_part(path)
        assert part is not None
        table = pyarrow.parquet.read_table(path).drop_columns(lacking)
        path.unlink()
        write_part(path.parent, part.number, table, part.segments)
    now = summarize(load_campaign(campaign.path))
    assert before.knows_confidence and not now.knows_confidence
    assert now.total.outcomes == before.total.outcomes
    assert (now.total.contested, now.total.settled) == (0, 0)
