"""The journal: lossless lines, torn ends, one writer at a time."""

from __future__ import annotations

import errno
import fcntl
import math
import os
from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError, Outcome, Stage, Verdict
from burg_drake.evaluation import (
    Journal,
    WriterLock,
    decode_verdict,
    encode_verdict,
    hold_unchanged,
    is_locked,
    read_journal,
)

LIFTED = Verdict(
    Outcome.LIFTED,
    Stage.EXECUTED,
    margins={"slip": 0.1 + 0.2, "tilt": 1e-300, "pad_force": math.nan},
    displacements={"mug": 1 / 3, "bowl.2": 0.0},
    pushed={"mug": 1 / 7},
    touched="panda_link5 vs bowl.2",
    q_grasp=(0.1, -2.0 / 3.0),
    q_pregrasp=(1.0, math.pi),
    cpu={Stage.CLEAR: 0.0002, Stage.REACHABLE: 0.01, Stage.EXECUTED: 0.25},
)
BLOCKED = Verdict(
    Outcome.COLLISION_CLUTTER, Stage.CLEAR, blocker='a "quoted"\nname', reason="Ä → ö"
)


KILLED = Verdict(
    Outcome.SIMULATION_FAILED, Stage.EXECUTED, reason="ended by SIGKILL", interrupted=True
)


@pytest.mark.parametrize("verdict", [LIFTED, BLOCKED, KILLED])
def test_a_line_gives_back_what_went_in(verdict: Verdict) -> None:
    line = encode_verdict("mug-1", verdict)
    assert line.count(b"\n") == 1 and line.endswith(b"\n")
    assert b"NaN" not in line  # JSON has no such number
    id, back = decode_verdict(line)
    assert id == "mug-1"
    assert repr(back) == repr(verdict)  # equality would fail on NaN


def test_a_line_of_an_older_release_is_read() -> None:
    line = (
        b'{"id":"mug-1","outcome":"lifted","stage":"executed","blocker":"","reason":"","margins":'
        b'{"overlap":0.0,"slip":0.002,"tilt":null},"q_grasp":[],"q_pregrasp":[],"cpu":{}}\n'
    )
    id, verdict = decode_verdict(line)
    assert (id, verdict.outcome, verdict.margins["slip"]) == ("mug-1", Outcome.LIFTED, 0.002)
    assert not verdict.interrupted
    assert verdict.displacements == {} and "patch_area" not in verdict.margins


def test_a_torn_line_is_cut_off_and_the_rest_is_kept(tmp_path) -> None:
    path = tmp_path / "journal.jsonl"
    whole = encode_verdict("a", LIFTED) + encode_verdict("b", BLOCKED)
    for cut in range(len(encode_verdict("a", LIFTED)), len(whole)):
        path.write_bytes(whole[:cut])
        with Journal(path) as journal:
            journal.append("c", BLOCKED)
        assert list(read_journal(path)) == ["a", "c"], cut


def test_opening_a_whole_journal_leaves_its_date(tmp_path) -> None:
    path = tmp_path / "journal.jsonl"
    for content in (b"", encode_verdict("a", LIFTED)):
        path.write_bytes(content)
        os.utime(path, ns=(10**18, 10**18))
        Journal(path).close()
        assert path.stat().st_mtime_ns == 10**18


def test_a_damaged_line_counts_as_not_judged(tmp_path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(
        encode_verdict("a", LIFTED) + b'{"id": "b"}\n\x00\xff\n[]\n' + encode_verdict("c", BLOCKED)
    )
    assert list(read_journal(path)) == ["a", "c"]
    good = encode_verdict("b", LIFTED)
    damaged = [
        good.replace(b'"tilt":1e-300', b'"tilt":"steep"'),
        good.replace(b'"cpu":{"clear":0.0002', b'"cpu":{"clear":null'),
        good.replace(b'"q_pregrasp":[1.0', b'"q_pregrasp":[[]'),
        good.replace(b'"blocker":""', b'"blocker":["mug"]'),
        good.replace(b"0.25", b"[" * 100_000),
        good.replace(b"0.25", b"9" * 5000),
    ]
    assert good not in damaged
    path.write_bytes(b"".join(damaged))
    assert read_journal(path) == {}


def test_two_cannot_write_at_once(tmp_path) -> None:
    with Journal(tmp_path / "j"), pytest.raises(InvalidInputError, match="by another process"):
        Journal(tmp_path / "j")
    Journal(tmp_path / "j").close()


def test_no_journal_means_nothing_judged(tmp_path) -> None:
    assert read_journal(tmp_path / "none") == {}
    with pytest.raises(InvalidInputError, match=r"cannot write .*: Is a directory"):
        Journal(tmp_path)
    with pytest.raises(InvalidInputError, match=r"cannot read .*: it is a folder"):
        read_journal(tmp_path)


def test_a_full_disk_is_said_in_one_line() -> None:
    from pathlib import Path

    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    journal = object.__new__(Journal)
    journal._path, journal._file = Path("run/journal.jsonl"), os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(InvalidInputError, match=r"No space left on device; .* is kept"):
        journal.append("a", LIFTED)
    journal.close()


def test_a_file_system_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Writers are refused with the reason; nothing there is being written, and all can be read."""

    def no_locks(file: int, kind: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    path = tmp_path / "journal.jsonl"
    with Journal(path):
        assert is_locked(path)
    monkeypatch.setattr(fcntl, "flock", no_locks)
    expected = f"{tmp_path} is on a file system without file locks (No locks available), where two"
    for writer in (Journal, WriterLock):
        with pytest.raises(InvalidInputError) as refused:
            writer(path)
        assert str(refused.value).startswith(expected)
    assert not is_locked(path)
    with hold_unchanged(path):
        pass
