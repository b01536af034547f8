"""Recovery of sessions that ended without `close`."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.compose import AddObject, ComposeSession, Delete, FileChanged, SceneInUse
from burg_drake.core import resolve_reference
from burg_drake.station import Station

SCRIPT = Path(__file__).with_name("scripted_session.py")


def start(reference: str, folder: Path, what: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), reference, str(folder), what],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def test_killed_sessions_go_on_where_they_were(station: Station, tmp_path: Path) -> None:
    """An unsaved and a saved session in a process that is then killed."""
    process = start("household", tmp_path, "work")
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    saved = tmp_path / "saved" / "breakfast.yaml"
    try:
        other = ComposeSession.open("household", station, folder=tmp_path)
        assert other.view.document.name == "new_scene_2"  # the first one is in use
        other.close()
        with pytest.raises(SceneInUse, match=r"http://127.0.0.1:8080"):
            ComposeSession.open(saved, station)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        view = session.view
        assert view.notices == ("recovered the unsaved changes of 'new_scene' and their history",)
        assert list(view.instances) == ["bowl", "bowl_2", "marble"]
        assert (view.undo_label, view.redo_label) == ("add marble", "delete bowl")
        assert list(session.redo().instances) == ["bowl_2", "marble"]
        for _ in range(4):
            session.undo()
        assert not session.view.instances
    assert [path.name for path in tmp_path.iterdir()] == ["saved"]  # nothing was left to keep
    with ComposeSession.open(saved, station) as session:  # saved, and with its history
        assert session.view.saved and not session.view.notices
        assert session.undo().undo_label == "add bowl"


@pytest.mark.thorough
def test_with_a_full_disk_editing_goes_on_and_the_old_file_stays(tmp_path: Path) -> None:
    process = start("household", tmp_path, "full")
    assert process.stdout is not None
    editing, saving, after = process.stdout.read().splitlines()
    assert process.wait() == 0
    assert editing.startswith("3 ") and "until then changes are kept in memory only" in editing
    assert saving.startswith(f"cannot write {tmp_path / 'breakfast.yaml'}: File too large")
    assert saving.endswith(" 2")  # objects in the file
    assert after == "() True"


@pytest.fixture
def left(station: Station, tmp_path: Path) -> Path:
    """The journal of a session that had a file and two more steps."""
    session = ComposeSession.open("household", station, folder=tmp_path)
    session.do(AddObject("mug"))
    session.save("breakfast")
    session.do(AddObject("marble"))
    session.do(AddObject("box", position=(0.3, 0.1)))
    session.close()
    return tmp_path / ".breakfast.yaml.journal"


def test_a_torn_last_line_is_left_out(station: Station, left: Path) -> None:
    left.write_bytes(left.read_bytes()[:-20])
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        assert list(session.view.instances) == ["mug", "marble"]


def damaged(journal: Path, line: int, old: str, new: str) -> bytes:
    """Replaces a text in one line of a journal; returns the new content of the file."""
    lines = journal.read_text().splitlines()
    assert old in lines[line]
    lines[line] = lines[line].replace(old, new)
    journal.write_text("\n".join(lines) + "\n")
    return journal.read_bytes()


DEEP = "[" * 3000 + "]" * 3000


@pytest.mark.parametrize("value", ["null", DEEP, "[1e999,0,0]", "[1e999]", '["box"]', "{}", "NaN"])
def test_of_a_damaged_journal_nothing_is_lost_that_can_be_read(
    station: Station, left: Path, value: str
) -> None:
    kept = damaged(left, -2, "[0.", f"{value},[0.")  # an entry before the marble's position
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        aside = left.with_name(".breakfast.yaml.journal.damaged_1")
        assert session.view.notices == (
            "the journal of the last session is damaged (line 6 of 7 cannot be read); the"
            f" readable part is recovered, and the journal is kept as {aside}",
            "recovered the unsaved changes of 'breakfast' and their history",
        )
        assert list(session.view.instances) == ["mug", "box"]
        session.do(AddObject("can"))
        assert session.save().saved
    assert aside.read_bytes() == kept


def test_steps_behind_a_damaged_line_are_recovered(station: Station, left: Path) -> None:
    path = left.with_name("breakfast.yaml")
    with ComposeSession.open(path, station) as session:
        after = session.do(Delete(("marble",))).document
        session.undo()
        before = session.do(AddObject("can")).document
    lines = left.read_text().splitlines()
    last = json.loads(lines[-1])
    assert last["step"] == "add can" and last["at"] == 4
    damaged(left, 3, '"selection":', '"selection":null,"":')
    with ComposeSession.open(path, station) as session:
        assert "(line 4 of " in session.view.notices[0]
        assert session.view.document == before
        assert session.undo().undo_label != "delete marble" and session.view.document != after


def test_the_damaged_journal_of_a_scene_without_a_file_is_recovered(
    station: Station, tmp_path: Path
) -> None:
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        session.do(AddObject("mug"))
    journal = tmp_path / ".new_scene.yaml.journal"
    kept = damaged(journal, 0, "household", '"')
    with ComposeSession.open("tabletop_six", station, folder=tmp_path) as session:
        assert len(session.view.instances) == 6
    assert journal.read_bytes() == kept
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        assert list(session.view.instances) == ["mug"]
        assert "(line 1 of 5 cannot be read)" in session.view.notices[0]
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        assert list(session.view.instances) == ["mug"]
        assert "damaged" not in session.view.notices[0]


def test_a_journal_that_cannot_be_read_is_no_obstacle(station: Station, left: Path) -> None:
    left.unlink()
    left.mkdir()
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        assert "is damaged (" in session.view.notices[0]
        assert list(session.do(AddObject("can")).instances) == ["mug", "can"]
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        assert list(session.view.instances) == ["mug", "can"]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\n", b"[]\n", b"{}\nnull\n", b'{"at": 3}\n'])
def test_what_is_no_journal_is_no_obstacle(station: Station, left: Path, content: bytes) -> None:
    left.write_bytes(content)
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        assert list(session.view.instances) == ["mug"]
        assert "is damaged" in session.view.notices[0]


def test_a_journal_of_the_version_before_is_read(station: Station, left: Path) -> None:
    """Its lines have neither the numbers of instances nor the position of the step."""
    lines = []
    for line in map(json.loads, left.read_text().splitlines()):
        line.pop("from", None)
        if "step" in line:
            line.pop("at")
        lines.append(json.dumps(line))
    left.write_text("\n".join(lines) + "\n")
    with ComposeSession.open(left.with_name("breakfast.yaml"), station) as session:
        assert session.view.notices == (
            "recovered the unsaved changes of 'breakfast' and their history",
        )
        assert list(session.view.instances) == ["mug", "marble", "box"]
        for _ in range(3):
            session.undo()
        assert not session.view.instances


def test_steps_whose_library_is_gone_hinder_no_new_scene(station: Station, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    shutil.copytree(resolve_reference("household", "models"), mine)
    with ComposeSession.open(mine, station, folder=tmp_path) as session:
        session.do(AddObject("mug"))
    mine.rename(tmp_path / "elsewhere")
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        assert session.view.document.name == "new_scene_2"
        assert str(tmp_path / ".new_scene.yaml.journal") in session.view.notices[0]
    (tmp_path / "elsewhere").rename(mine)
    with ComposeSession.open(mine, station, folder=tmp_path) as session:
        assert list(session.view.instances) == ["mug"]


def test_a_file_that_was_changed_since_is_not_overwritten(station: Station, left: Path) -> None:
    path = left.with_name("breakfast.yaml")
    path.write_text(path.read_text().replace("mug", "can"))
    with ComposeSession.open(path, station) as session:
        assert "was changed by another program" in session.view.notices[0]
        assert list(session.view.instances) == ["mug", "marble", "box"]
        with pytest.raises(FileChanged):
            session.save()
        assert list(session.load(discard=True).instances) == ["can"]
        assert session.view.saved
        assert list(session.undo().instances) == ["mug", "marble", "box"]


def test_a_journal_writes_each_instance_once(left: Path) -> None:
    lines = [json.loads(line) for line in left.read_text().splitlines()]
    written = [instance[1] for line in lines for instance in line.get("new", ())]
    assert written == ["mug", "marble", "box"]
