"""Entries of the lab page from several browsers, late, and repeated: none is lost."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import FrameProcessor, Intrinsics, LocatedFrame, PlacementCheck, open_source
from burg_drake.core import InvalidInputError, RealOutcome, make_pose
from burg_drake.experiment import (
    LabBook,
    LabCamera,
    LabEntry,
    RealTrial,
    TrialBook,
    TrialChanged,
    TriedRuns,
    entry_states,
    load_trials,
    plan_data,
    trial_state_hash,
)
from burg_drake.experiment.lab import lab_book
from tests.cameras.synthetic import board_image
from tests.hang_guard import HANG_GUARD

TIME = "2026-05-05T10:02:11+02:00"


@pytest.fixture
def lab(trials: Path) -> LabBook:
    return LabBook(TriedRuns(trials))


def entry(lab: LabBook, number: int, outcome: str | None, **more: object) -> LabEntry:
    """An entry by a browser that has seen the present file."""
    state = trial_state_hash(lab.sheet().trial(number))
    chosen = None if outcome is None else RealOutcome(outcome)
    made = LabEntry(number=number, replaces=state, outcome=chosen, time=TIME, operator="AB")
    return replace(made, **more)  # type: ignore[arg-type]


@pytest.mark.thorough
def test_the_same_entry_counts_once(lab: LabBook, trials: Path) -> None:
    slipped = entry(lab, 2, "slipped", note="wet", width_mm=12.5)
    for _ in range(3):  # the acknowledgement was lost twice
        found = lab.enter(slipped)
    assert found == load_trials(trials).trial(2)
    assert (found.outcome, found.note, found.time) == (RealOutcome.SLIPPED, "wet", TIME)
    assert found.robot is not None and found.robot.width_mm == 12.5
    assert len(lab.book.entries()) == 1


def test_a_late_copy_does_not_undo_a_correction(lab: LabBook, trials: Path) -> None:
    first = entry(lab, 3, "slipped")
    lab.enter(first)
    lab.enter(entry(lab, 3, "dropped", time="2026-05-05T10:03:00+02:00"))
    again = LabBook(TriedRuns(trials))  # the program was started again meanwhile
    assert again.enter(first).outcome is RealOutcome.DROPPED
    assert load_trials(trials).trial(3).outcome is RealOutcome.DROPPED


def test_two_browsers_that_disagree(lab: LabBook, trials: Path) -> None:
    mine, theirs = entry(lab, 1, "lifted"), entry(lab, 1, "slipped", operator="CD")
    lab.enter(theirs)
    with pytest.raises(TrialChanged, match="now has slipped by CD"):
        lab.enter(mine)
    assert load_trials(trials).trial(1).outcome is RealOutcome.SLIPPED
    lab.enter(replace(mine, replaces=trial_state_hash(load_trials(trials).trial(1))))
    assert load_trials(trials).trial(1).outcome is RealOutcome.LIFTED


def test_what_another_program_enters_in_between_is_not_replaced(
    lab: LabBook, trials: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes after the state was looked at: once a photo, which contradicts nothing."""
    others = iter([{"photo": "photos/001.png"}, {"outcome": "dropped"}])

    def seen(trial: RealTrial) -> str:
        state = trial_state_hash(trial)
        for other in others:
            TrialBook(trials).record(trial.number, **other)
            break
        return state

    mine = entry(lab, 1, "lifted")
    monkeypatch.setattr(lab_book, "trial_state_hash", seen)
    with pytest.raises(TrialChanged, match="changed by someone else: it now has dropped"):
        lab.enter(mine)
    trial = load_trials(trials).trial(1)
    assert (trial.outcome, trial.photo) == (RealOutcome.DROPPED, "photos/001.png")


def test_what_is_taken_back_is_as_before(lab: LabBook, trials: Path) -> None:
    before = trials.read_text()
    lab.enter(entry(lab, 4, "lifted", width_mm=3.0))
    lab.enter(entry(lab, 4, None))
    assert trials.read_text() == before
    assert [past.after.get("outcome") for past in lab.book.entries()] == ["lifted", None]


def test_entries_from_everywhere_at_once(lab: LabBook, trials: Path) -> None:
    other, book = LabBook(TriedRuns(trials)), TrialBook(trials)
    wanted = {
        1: "lifted",
        2: "slipped",
        3: "dropped",
        4: "no_path",
        5: "lifted",
        6: "not_attempted",
    }
    todo = [
        lambda n=n, by=by: by.enter(entry(by, n, wanted[n]))
        for n, by in ((1, lab), (2, other), (3, lab), (4, other))
    ]
    todo += [lambda n=n: book.record(n, outcome=wanted[n]) for n in (5, 6)]
    threads = [threading.Thread(target=one) for one in todo]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = {t.number: t.outcome for t in load_trials(trials).trials if t.outcome}
    assert found == {number: RealOutcome(outcome) for number, outcome in wanted.items()}
    assert {e["number"] for e in entry_states(lab)["entries"] if e["outcome"]} == set(wanted)


def test_a_file_that_is_being_edited(lab: LabBook, trials: Path) -> None:
    waiting, text = entry(lab, 2, "lifted"), trials.read_text()
    trials.write_text(text.replace("number: 2", "number: 2\n    outcom: lifted"))
    assert "outcom" in entry_states(lab)["problem"]
    with pytest.raises(InvalidInputError, match="outcom"):
        lab.enter(waiting)
    trials.write_text(text.replace("grasp: blue_mug", "grasp: other_mug"))
    assert "holds other trials" in entry_states(lab)["problem"]
    trials.write_text(text)
    assert lab.enter(waiting).outcome is RealOutcome.LIFTED
    with pytest.raises(InvalidInputError):
        lab.enter(replace(waiting, number=99))


def test_the_page_is_not_told_what_was_simulated(lab: LabBook) -> None:
    def keys(data: object) -> set[str]:
        if isinstance(data, dict):
            return {*data, *(k for value in data.values() for k in keys(value))}
        return {k for one in data for k in keys(one)} if isinstance(data, list) else set()

    assert not {"simulated", "stratum"} & (keys(plan_data(lab)) | keys(entry_states(lab)))
    told = LabBook(lab.runs, show_simulated=True)
    assert plan_data(told)["trials"][0]["simulated"] == lab.runs.sheet.trials[0].simulated


@pytest.fixture
def over(lab: LabBook, trials: Path) -> Iterator[LabCamera]:
    """A camera over an empty board."""
    camera = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
    board = lab.runs.of(lab.runs.sheet.trial(5)).scene.board
    photo = board_image(board, camera, make_pose(np.diag([1.0, -1.0, -1.0]), (0.3, 0.21, 0.6)))
    cv2.imwrite(str(trials.parent / "photo.png"), photo[..., ::-1])
    over = LabCamera(lab, lambda scene: open_source(trials.parent / "photo.png"), camera)
    yield over
    over.close()


def test_a_photo_and_the_placement_are_kept_before_a_trial(
    lab: LabBook, trials: Path, over: LabCamera
) -> None:
    over.watch(5)
    assert over.next_picture(0, 0, 30.0) is not None
    over.check(5, keep=True)
    over.wait_for_check()
    told = over.status()["check"]
    assert (told["number"], told["kept"], told["problem"]) == (5, True, "")
    trial = load_trials(trials).trial(5)
    assert trial.outcome is None and (trials.parent / trial.photo).is_file()
    assert trial.placement["bottle"].status == "not_seen"  # the board is empty
    lab.enter(entry(lab, 5, "lifted"))
    assert load_trials(trials).trial(5).photo == trial.photo
    over.check(5, keep=True)  # of what is there after the trial
    over.wait_for_check()
    told = over.status()["check"]
    assert not told["kept"] and "already has an outcome" in told["problem"] and told["objects"]
    assert load_trials(trials).trial(5).photo == trial.photo


def test_a_check_that_fails_says_why(
    over: LabCamera, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise cv2.error("no such matrix")

    monkeypatch.setattr(FrameProcessor, "check", broken)
    over.watch(4)
    assert over.next_picture(0, 0, 30.0) is not None
    over.check(4, keep=True)
    over.wait_for_check()
    told = over.status()["check"]
    assert (told["number"], told["kept"]) == (4, False)
    assert told["problem"] == "the check failed: error: no such matrix"
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.thorough
def test_an_outcome_that_comes_while_a_check_is_at_work(
    lab: LabBook, trials: Path, over: LabCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Photo and placement stay with the trial that was shown; the next one shows no offsets."""
    entered, check = threading.Event(), FrameProcessor.check

    def slow(session: FrameProcessor, sight: LocatedFrame) -> PlacementCheck:
        assert entered.wait(HANG_GUARD)
        return check(session, sight)

    monkeypatch.setattr(FrameProcessor, "check", slow)
    over.watch(5)
    assert over.next_picture(0, 0, 30.0) is not None
    over.check(5, keep=True)
    assert over.status()["measuring"] == {"number": 5, "keep": True}
    lab.enter(entry(lab, 5, "slipped", note="wet"))
    over.watch(6)  # on the same scene
    entered.set()
    over.wait_for_check()
    status = over.status()
    assert (status["check"]["number"], status["check"]["kept"], status["drawn"]) == (5, True, 0)
    done, following = (load_trials(trials).trial(number) for number in (5, 6))
    assert (done.outcome, done.note, done.time) == (RealOutcome.SLIPPED, "wet", TIME)
    assert (trials.parent / done.photo).is_file() and set(done.placement) == {"bottle"}
    assert not following.photo and not following.placement
    over.check(6, keep=False)
    over.wait_for_check()
    assert over.status()["drawn"] == 6
    over.watch(7)
    assert over.status()["drawn"] == 0
