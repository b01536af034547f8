"""A trials file with several writers: no entry is lost, and other text stays as it was."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given, settings, strategies as st

from burg_drake.cameras import write_image
from burg_drake.core import (
    UNFINISHED_FILE,
    DocumentError,
    InvalidInputError,
    Pose,
    RealOutcome,
    UnknownNameError,
    dump_document,
    parse_document,
    parse_yaml_node,
    plain_data,
)
from burg_drake.experiment import (
    ObjectPlace,
    RobotReport,
    SheetText,
    TrialBook,
    TrialChanged,
    TrialSheet,
    load_trials,
    lock_trials_file,
    save_photo_and_placement,
)
from tests.experiment.trial_sheets import make_sheet, write_sheet

PLACE = ObjectPlace(
    status="measured", offset_mm=(1.25, -0.5), offset_sd_mm=(0.1, 0.2), X_SO=Pose((0.1, 0.2, 0.0))
)
WRITER = """
import sys
from burg_drake.experiment.trials.trial_book import TrialBook
book = TrialBook(sys.argv[1])
for number in map(int, sys.argv[2:]):
    book.record(number, outcome="slipped", note=f"by {number}")
    print(number, flush=True)
"""


def start(path: Path, *numbers: int) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", WRITER, str(path), *map(str, numbers)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


@pytest.mark.thorough
def test_writers_at_once_lose_nothing(tmp_path: Path) -> None:
    path = write_sheet(tmp_path, 40)
    writers = [start(path, *range(1 + k, 41, 2)) for k in range(2)]
    assert [writer.wait() for writer in writers] == [0] * 2
    sheet = load_trials(path)
    assert [trial.note for trial in sheet.trials] == [f"by {n}" for n in range(1, 41)]
    assert {trial.outcome for trial in sheet.trials} == {RealOutcome.SLIPPED}
    book = TrialBook(path)
    assert len(book.entries()) == 40 and book.missing_values() == []


def test_what_was_told_before_a_kill_is_there(tmp_path: Path) -> None:
    path = write_sheet(tmp_path, 60)
    writer = start(path, *range(1, 61))
    assert writer.stdout is not None
    told = [int(writer.stdout.readline()) for _ in range(7)]
    writer.send_signal(signal.SIGKILL)
    told += map(int, writer.stdout.read().split())
    writer.wait()
    book = TrialBook(path)
    assert all(book.sheet().trial(number).note == f"by {number}" for number in told)
    book.record(60, outcome="lifted")  # the lock is free


@pytest.mark.parametrize("step", ["append_entry", "SheetText.with_trial", "atomic_write"])
def test_a_kill_between_two_steps_leaves_a_sound_file(tmp_path: Path, step: str) -> None:
    path = write_sheet(tmp_path)
    where = "burg_drake.experiment.trials.trial_book"
    script = f"import os, {where} as b; b.{step} = lambda *_: os.kill(os.getpid(), 9)\n" + WRITER
    ended = subprocess.run([sys.executable, "-c", script, str(path), "2"], check=False)
    assert ended.returncode == -signal.SIGKILL
    book = TrialBook(path)
    assert book.sheet() == make_sheet()
    journalled = step == "atomic_write"
    assert [found.number for found in book.missing_values()] == [2] * journalled
    if journalled:
        (restored,) = book.restore()
        assert (restored.outcome, restored.note) == (RealOutcome.SLIPPED, "by 2")
    assert book.record(2, outcome="slipped").outcome is RealOutcome.SLIPPED


def test_all_links_to_a_file_share_its_lock_and_journal(tmp_path: Path) -> None:
    """Writers through a link and through the file lose nothing; both restore overwritten text."""
    (tmp_path / "real").mkdir()
    path = write_sheet(tmp_path / "real", 24)
    path.chmod(0o640)
    (tmp_path / "links").symlink_to("real")
    link = tmp_path / "linked.yaml"
    link.symlink_to(tmp_path / "links" / "trials.yaml")
    before = path.read_text()
    writers = [start(link, *range(1, 25, 2)), start(path, *range(2, 25, 2))]
    assert [writer.wait() for writer in writers] == [0] * 2
    assert [trial.note for trial in load_trials(path).trials] == [f"by {n}" for n in range(1, 25)]
    assert link.is_symlink() and path.stat().st_mode & 0o777 == 0o640
    assert {p.name for p in tmp_path.iterdir()} == {"real", "links", "linked.yaml"}
    names = {"trials.yaml", ".trials.yaml.lock", "trials.entries.jsonl"}
    assert {p.name for p in path.parent.iterdir()} == names
    path.write_text(before)
    assert len(TrialBook(path).missing_values()) == 24
    assert len(TrialBook(link).restore()) == 24 and TrialBook(path).missing_values() == []
    photo = tmp_path / "p.png"
    write_image(photo, np.zeros((4, 6, 3), np.uint8))
    assert save_photo_and_placement(link, 3, photo=photo) == "photos/003.png"
    assert (path.parent / "photos" / "003.png").exists()


def test_a_lock_that_is_kept_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    book = TrialBook(write_sheet(tmp_path))
    monkeypatch.setattr("burg_drake.experiment.trials.trial_book.TRIALS_LOCK_TIMEOUT", 0.05)
    with (
        lock_trials_file(book.path),
        pytest.raises(InvalidInputError, match="locked by another process"),
    ):
        book.record(1, outcome="lifted")
    assert book.entries() == [] and book.record(1, outcome="lifted").number == 1


def test_a_file_system_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    book = TrialBook(write_sheet(tmp_path))
    monkeypatch.setattr(fcntl, "flock", no_locks)
    with pytest.raises(InvalidInputError, match=r"trials.yaml .* without file locks"):
        book.record(1, outcome="lifted")
    assert book.entries() == [] and book.sheet() == make_sheet()


def no_locks(file: int, kind: int) -> None:
    """Raises the error of a network drive without locks."""
    raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))


def test_a_torn_line_of_the_journal_is_left_behind(tmp_path: Path) -> None:
    book = TrialBook(write_sheet(tmp_path))
    book.record(1, outcome="lifted")
    with (tmp_path / "trials.entries.jsonl").open("ab") as file:
        file.write(b'{"number": 2, "gra')
    book.record(3, outcome="lifted")
    assert [entry.number for entry in book.entries()] == [1, 3]
    assert book.damage().endswith(
        "trials.entries.jsonl:2: damaged entry, skipped; compare trials.yaml with your notes, then"
        " delete the line"
    )
    with (tmp_path / "trials.entries.jsonl").open("r+b") as file:
        file.write(b"\xff")
    assert "trials.entries.jsonl:1, 2: damaged entries, skipped;" in book.damage()
    assert [entry.number for entry in book.entries()] == [3]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("number", value) for value in ("1", 1.0, True, None)),
        *((field, value) for field in ("grasp", "content", "at") for value in (7, None)),
        *(("how", value) for value in (7, "guessed", ["recorded"], None)),
        *((f, value) for f in ("before", "after") for value in (None, [], "", {"colour": "red"})),
        ("colour", "red"),
    ],
)
def test_a_line_with_wrong_fields_is_damaged(tmp_path: Path, field: str, value: object) -> None:
    path = write_sheet(tmp_path)
    book = TrialBook(path)
    book.record(1, outcome="lifted")
    journal = tmp_path / "trials.entries.jsonl"
    line = json.dumps(json.loads(journal.read_text()) | {field: value})
    with journal.open("a") as file:
        file.write(line + "\n")
    assert "trials.entries.jsonl:2: damaged entry" in book.damage()
    assert len(book.entries()) == 1 and book.missing_values() == []


def test_a_line_that_lacks_a_field_or_is_no_mapping_is_damaged(tmp_path: Path) -> None:
    book = TrialBook(write_sheet(tmp_path))
    (tmp_path / "trials.entries.jsonl").write_text('{"number": 1}\n[]\nnull\n7\n')
    assert "trials.entries.jsonl:1, 2, 3, 4: damaged entries" in book.damage()
    assert book.entries() == []


def test_comments_and_layout_of_people_stay(tmp_path: Path) -> None:
    path = write_sheet(tmp_path)
    lines = path.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if "number: 2" in line)
    lines[at:at] = ["", "  # the camera was moved here"]
    lines[at + 2] += "   # after lunch"
    lines.insert(at + 4, "    # within the trial")
    path.write_text("\n".join(lines) + "\n# the end\n")
    before = path.read_text().splitlines()
    book = TrialBook(path)
    trial = book.record(2, outcome="dropped", note="Ärger: it fell", placement={"mug": PLACE})
    after = path.read_text().splitlines()
    assert [line for line in after if line not in before] != []
    assert [line for line in after if line in before] == before  # all are there, in order
    assert book.sheet() == replace(
        make_sheet(), trials=tuple(trial if t.number == 2 else t for t in make_sheet().trials)
    )
    assert "Ärger" in path.read_text()
    book.record(2, again=True, outcome="not_attempted", time=trial.time)
    assert book.sheet().trial(2).note == "" and "# within the trial" in path.read_text()


def test_the_same_entry_twice_is_one_and_another_one_is_refused(tmp_path: Path) -> None:
    book = TrialBook(write_sheet(tmp_path))
    first = book.record(1, outcome="slipped", operator="Ada")
    assert book.record(1, outcome="slipped", operator="Ada") == first
    assert len(book.entries()) == 1
    with pytest.raises(InvalidInputError, match=r"trial 1 already has outcome 'slipped'"):
        book.record(1, outcome="lifted")
    more = book.record(1, note="more is known", robot={"width_mm": 41.5})
    assert (more.outcome, more.time) == (first.outcome, first.time)
    with pytest.raises(InvalidInputError, match="already has robot"):
        book.record(1, robot={"width_mm": 40.0})
    assert book.record(1, robot={"effort_n": 30.0}).robot == RobotReport(width_mm=41.5, effort_n=30)
    right = book.record(1, correct=True, outcome="lifted")
    assert (right.operator, right.note) == ("Ada", "more is known")
    once_more = book.record(1, again=True, outcome="dropped")
    assert (once_more.operator, once_more.note, once_more.robot) == ("", "", None)
    assert [entry.after.get("outcome") for entry in book.entries()] == [
        *("slipped", "slipped", "slipped", "lifted", "dropped")
    ]
    assert book.record("next", outcome="lifted").number == 2
    with pytest.raises(TrialChanged, match="trial 1 was changed by someone else") as caught:
        book.record(1, expected=first, correct=True, outcome="lifted")
    assert caught.value.trial == once_more
    assert book.record(1, expected=once_more, note="so it is").note == "so it is"


def test_an_old_buffer_loses_nothing_and_an_edit_is_kept(tmp_path: Path) -> None:
    path = write_sheet(tmp_path)
    book = TrialBook(path)
    book.record(1, outcome="lifted")
    buffer = path.read_text()
    book.record(2, outcome="slipped", note="wet")
    book.record(3, outcome="lifted")
    edited = buffer.replace("- number: 3\n", "- number: 3\n    outcome: dropped\n")
    path.write_text(edited)
    lost = {found.number: found for found in book.missing_values()}
    assert lost[2].values.keys() == {"outcome", "note", "time"}
    assert lost[3].edited == ("outcome",) and "outcome" not in lost[3].values
    book.restore([2])
    assert book.sheet().trial(2).note == "wet"
    assert [found.number for found in book.missing_values()] == [3]
    before = path.read_text()
    book.keep()
    assert book.missing_values() == [] and path.read_text() == before
    path.write_text(edited)
    book.restore()
    assert book.sheet().trial(2).note == "wet"
    assert book.sheet().trial(3).outcome is RealOutcome.DROPPED


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mug-0001", "mug-0f01"),
        ("'000000000001'", "'000000000f01'"),
        ("number: 1\n", "number: 9\n"),
    ],
)
def test_entries_of_another_plan_are_not_this_one_s(tmp_path: Path, old: str, new: str) -> None:
    """An entry belongs to a trial with its number, grasp and content; here one of them differs."""
    path = write_sheet(tmp_path)
    before = path.read_text()
    TrialBook(path).record(1, outcome="lifted")
    path.write_text(before)
    assert [found.number for found in TrialBook(path).missing_values()] == [1]
    assert before.count(old) == 1
    path.write_text(before.replace(old, new))
    book = TrialBook(path)
    assert book.missing_values() == book.restore() == book.keep() == []
    assert path.read_text() == before.replace(old, new) and len(book.entries()) == 1


def test_each_step_is_on_the_disk_before_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a power failure only synchronised writes are left, so their order matters."""
    book = TrialBook(write_sheet(tmp_path))
    steps: list[str] = []
    real = {name: getattr(os, name) for name in ("write", "fsync", "replace")}

    def name_of(file: int) -> str:
        """Name of an open file; `new file` if it is not yet renamed to its final name."""
        status = os.fstat(file)
        if os.path.samestat(status, tmp_path.stat()):
            return "folder"
        names = [p.name for p in tmp_path.iterdir() if os.path.samestat(status, p.stat())]
        return "new file" if UNFINISHED_FILE.fullmatch(names[0]) else names[0]

    def logged(name: str) -> Callable[..., object]:
        def call(*arguments: Any) -> object:
            what = name_of(arguments[0]) if name != "replace" else Path(arguments[1]).name
            steps.append(f"{name} {what}")
            return real[name](*arguments)

        return call

    for name in real:
        monkeypatch.setattr(os, name, logged(name))
    book.record(1, outcome="lifted")
    journal = "trials.entries.jsonl"
    assert steps == [
        *(f"write {journal}", f"fsync {journal}", "fsync folder"),
        *("fsync new file", "replace trials.yaml", "fsync folder"),
    ]


TEXTS = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=40)
PLAIN = st.text("abc: #'\"-{}[]&*!|>%@`,?\n\t~äß€ 7", max_size=60)


@example(note="\xa0", second="", comment="", blank=0, newline="\n", first="note")
@example(note="\x85", second="", comment="", blank=0, newline="\n", first="number")
@example(note="a\u2028b\u2029", second="", comment="", blank=0, newline="\n", first="number")
@settings(max_examples=25, deadline=None)
@given(
    note=TEXTS | PLAIN,
    second=PLAIN,
    comment=st.text("abc #:'\"ä{}[]-", max_size=30),
    blank=st.integers(0, 2),
    newline=st.sampled_from(["\n", "\r\n"]),
    first=st.sampled_from(["number", "note", "block"]),
)
def test_any_note_survives_any_layout(
    note: str, second: str, comment: str, blank: int, newline: str, first: str
) -> None:
    plain = plain_data(make_sheet(3))
    head = {first: {**plain["trials"][1], "note": second}[first]}
    plain["trials"][1] = head | plain["trials"][1] | {"note": second}
    lines = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True).splitlines()
    at = next(i for i, line in enumerate(lines) if "number: 3" in line)
    lines[at:at] = [""] * blank + [f"# {comment}"]
    text = newline.join(lines) + newline
    sheet = parse_document(text, TrialSheet, "text")
    assert sheet.trial(2).note == second  # what was written is what is read
    for wanted in (
        replace(sheet.trial(2), note=note, outcome=RealOutcome.SLIPPED),
        replace(sheet.trial(2), note="", robot=RobotReport(width_mm=1.5)),
        make_sheet(3).trial(2),
    ):
        text = SheetText.read(text, "text").with_trial(wanted).text
        found = parse_document(text, TrialSheet, "text")
        assert found.trials == (sheet.trial(1), wanted, sheet.trial(3))
        assert newline == "\n" or "\n" not in text.replace(newline, "")
        end = newline.join(["", *lines[at + blank :], ""])  # all from the comment on
        assert text.endswith(end) and text.count(end) == 1


PIECES = (
    "  - number: 4\n",
    "    outcome: lifted\n",
    "    outcome: lifte\n",
    "    note: |+\n      a\n\n",
    '    note: "a\n',
    '  b"\n',
    "    note: &a x\n",
    "    operator: *a\n",
    "# a comment\n",
    "\n",
    "%TAG ! x\n",
    "---\n",
    "notes: [a]\n",
    "  ",
    "x",
    "\u2028",
)


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_what_is_read_of_a_changed_text_is_what_is_read_of_all_of_it(data: st.DataObject) -> None:
    """For any edit of the text, even if trials are no list of mappings any more."""
    text = dump_document(make_sheet(5))
    known = SheetText.read(text, "text")
    for _ in range(data.draw(st.integers(1, 3))):
        breaks = [0, *(k + 1 for k, c in enumerate(text) if c == "\n")]
        anywhere = st.sampled_from(breaks[-60:]) | st.integers(0, len(text))
        at, end = data.draw(anywhere), data.draw(anywhere)
        end = at if data.draw(st.booleans()) else end
        piece = "".join(data.draw(st.lists(st.sampled_from(PIECES), max_size=2)))
        text = text[: min(at, end)] + piece + text[max(at, end) :]
        found, expected = _sheet_or_error(known.read_changed, text), _sheet_or_error(_all_of, text)
        assert found == expected
        if not isinstance(found, str):
            known = known.read_changed(text)


def _all_of(text: str) -> SheetText:
    return SheetText.read(text, "text")


def _sheet_or_error(read: Callable[[str], SheetText], text: str) -> TrialSheet | str:
    try:
        return read(text).sheet
    except DocumentError as error:
        return str(error)


def test_an_entry_is_read_and_written_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an entry of this or another program, only the lines of its trial are parsed."""
    path = write_sheet(tmp_path, 60)
    path.write_text(f"{path.read_text()}notes: [a word on the choice]\n")
    book, other = TrialBook(path), TrialBook(path)
    lengths: list[int] = []

    def counted(text: str, *more: str) -> yaml.Node:
        lengths.append(len(text))
        return parse_yaml_node(text, *more)

    monkeypatch.setattr("burg_drake.experiment.trials.sheet_text.parse_yaml_node", counted)
    for number in range(1, 61):
        writer = other if number % 2 else book
        writer.record(number, outcome="lifted", note="so", placement={"mug": PLACE})
    assert len(lengths) <= 60 * 4 and max(lengths) < 1000
    assert load_trials(book.path) == book.sheet() == other.sheet()


def test_flow_style_can_be_changed_and_an_alias_is_refused(tmp_path: Path) -> None:
    path = write_sheet(tmp_path)
    text = path.read_text()
    at = text.index("  - number: 1")
    one, rest = text[at:].split("  - number: 2", 1)
    keys = [line.strip(" -") for line in one.strip().splitlines()]
    path.write_text(text[:at] + "  - {" + ", ".join(keys) + "} # so\n  - number: 2" + rest)
    book = TrialBook(path)
    assert book.record(1, note="a: b, {c}").note == "a: b, {c}"
    assert "# so" in path.read_text()
    path.write_text(
        text.replace("simulated: slipped", "simulated: &s slipped", 1).replace(
            "number: 3", "note: *s\n    number: 3"
        )
    )
    with pytest.raises(DocumentError, match=r"trials.yaml:\d+: trial 3 is written in a way"):
        TrialBook(path).record(3, correct=True, note="x")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("note_", "notes", r":\d+: trials\[0\]: unknown key 'notes'; did you mean 'note'\?"),
        ("number: 2", "number: 1", r":\d+: number 1 is used twice, by entries 1 and 2"),
        ("stratum: mug", "stratum: mag", r":\d+: there is no stratum 'mag'; did you mean 'mug'\?"),
        (
            "run: two\n    gr",
            "run: too\n    gr",
            r":\d+: there is no run 'too'; did you mean 'two'",
        ),
        ("number: 1", "number: 0", r":\d+: trials\[0\]: number is 0; it must be at least 1"),
        ("block: 1", "time: lunch", r":\d+: trials\[0\]: time is 'lunch'; write it as in 2026"),
        ("block: 1", "outcome: sliped", r":\d+: .*'sliped' is not valid; did you mean 'slipped'"),
        (
            "population: 4",
            "population: 3",
            r":\d+: strata.mug: population 3 is smaller than selected,",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = write_sheet(tmp_path)
    text = path.read_text().replace("number: 1\n", "number: 1\n    note_: x\n", 1)
    text = text if old == "note_" else path.read_text()
    keep = "block: 1\n    " if old.startswith("block") else ""
    path.write_text(text.replace(old, keep + new, 1))
    with pytest.raises(DocumentError, match=message):
        load_trials(path)


def test_wrong_calls_are_refused_and_leave_nothing(tmp_path: Path) -> None:
    path = write_sheet(tmp_path)
    book, text = TrialBook(path), path.read_text()
    with pytest.raises(InvalidInputError, match="no outcome 'sliped'; did you mean 'slipped'"):
        book.record(1, outcome="sliped")
    with pytest.raises(UnknownNameError, match="no entry 'notes'; did you mean 'note'"):
        book.record(1, notes="x")
    with pytest.raises(InvalidInputError, match=r"trials.yaml: .* no trial 9"):
        book.record(9, outcome="lifted")
    with pytest.raises(InvalidInputError, match="NUL"):
        book.record(1, note="a\0b")
    with pytest.raises(InvalidInputError, match="below 0"):
        book.record(1, robot={"width_mm": -1.0})
    assert path.read_text() == text and book.entries() == []
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".jsonl")]


def test_the_example_of_the_document_is_a_sheet() -> None:
    page = Path(__file__).resolve().parents[2] / "docs/reference/trials.md"
    example = page.read_text(encoding="utf-8").split("```yaml\n", 1)[1].split("```", 1)[0]
    trial = parse_document(example, TrialSheet, "docs/reference/trials.md").trial(17)
    assert trial.outcome is RealOutcome.SLIPPED and trial.placement["mug"].turn_deg == 0.8
