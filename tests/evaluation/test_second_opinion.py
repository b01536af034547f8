"""Contested grasps are judged again by another engine, whose verdicts then count."""

from __future__ import annotations

from pathlib import Path

import pytest
from known_judge import KnownJudge, Make, SecondJudge, confidence, expected

from burg_drake.core import InvalidInputError, Outcome, Stage, UnknownNameError
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    evaluate,
    journal_lines,
    judge_again,
    load_run,
    read_status,
    summarize,
)

PLACE = "burg_drake.evaluation.second_opinion.StationJudgeFactory"


@pytest.fixture
def second(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PLACE, lambda *_: Make(SecondJudge()))


def doubtful(run: Run) -> list[str]:
    """Those that were executed, with little confidence."""
    executed = [id for id in run.candidates.id if expected(id).stage is Stage.EXECUTED]
    return [id for id in executed if confidence(id) < 0.9]


def test_the_contested_ones_are_known_and_counted(own_run: Run) -> None:
    assert own_run.contested == doubtful(own_run) != []
    total = summarize(own_run).total
    lifts = sum(expected(id) is Outcome.LIFTED for id in own_run.contested)
    assert 0 < lifts < total.contested == len(own_run.contested)
    assert total.contested_lifts == lifts
    assert total.surely_lifted + total.surely_lost + total.contested == total.executed
    page = own_run.report_path.read_text("utf-8")
    assert "How sure the verdicts are" in page and f"{lifts} lifted" in page


def test_the_second_engine_settles_them(own_run: Run, second: None) -> None:
    asked = own_run.contested
    run = judge_again(own_run, workers=1, progress=False)
    assert run.contested == []
    for id in run.candidates.id:
        verdict, before = run.verdicts[id], own_run.verdicts[id]
        if id not in asked:
            assert verdict == before
            continue
        assert verdict.outcome is Outcome.LIFTED
        assert (verdict.judged_again, verdict.outcome_before) == ("reference", before.outcome)
        # what the stages before the trial found is kept
        assert verdict.q_grasp == before.q_grasp != ()
        assert verdict.margins["overlap"] == 0.0 and verdict.margins["slip"] == 1e-4
        assert verdict.cpu[Stage.EXECUTED] >= before.cpu[Stage.EXECUTED]
    total = summarize(run).total
    assert (total.contested, total.settled) == (0, len(asked))
    assert summarize(run).total.lifted == summarize(own_run).total.lifted + sum(
        expected(id) is not Outcome.LIFTED for id in asked
    )


def test_a_second_session_counts_the_grasps_of_its_devices(
    own_run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PLACE, lambda *_: Make(KnownJudge(devices=("NVIDIA H100",))))
    run = judge_again(own_run, workers=1, progress=False)
    assert [session.executed for session in run.document.stretches] == [
        {},
        {"NVIDIA H100": len(own_run.contested)},
    ]


def test_the_status_counts_each_grasp_once(own_run: Run, second: None) -> None:
    run = judge_again(own_run, workers=1, progress=False)
    status, total = read_status(run.path), summarize(run).total
    assert status.judged == status.outcomes.total() == len(run.candidates)
    assert status.outcomes == {str(o): n for o, n in total.outcomes.items()}


def test_the_best_are_not_contested(own_run: Run) -> None:
    lifted = [id for id in own_run.candidates.id if expected(id) is Outcome.LIFTED]
    sure = [id for id in lifted if id not in own_run.contested]
    assert 0 < len(sure) < len(lifted)
    assert set(own_run.best(len(sure))) == set(sure)
    assert set(own_run.best(len(lifted))) == set(lifted)


def test_a_row_says_which_engine_gave_it(own_run: Run, second: None) -> None:
    run = judge_again(own_run, workers=1, progress=False)
    for id in run.candidates.id:
        row, again = run.row(id), id in own_run.contested
        assert row["engine"] == ("reference" if again else "standard")
        assert ("time_step=0.001" in row["engine_settings"]) is again
        assert row["outcome_before"] == (own_run.verdicts[id].outcome if again else "")


def test_it_is_asked_once(own_run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    failing = own_run.contested[0]
    monkeypatch.setattr(PLACE, lambda *_: Make(SecondJudge(failing)))
    before = own_run.verdicts[failing]
    run = judge_again(own_run, workers=1, progress=False)
    assert run.verdicts[failing] == before and run.contested == [failing]
    lines = len(list(journal_lines(run.path / "journal.jsonl")))
    monkeypatch.setattr(PLACE, lambda *_: Make(SecondJudge()))
    judge_again(run.path, workers=1, progress=False)
    judge_again(run.path, workers=1, progress=False)
    assert len(list(journal_lines(run.path / "journal.jsonl"))) == lines + 1


def test_evaluating_goes_on_from_what_is_settled(
    own_run: Run, second: None, scene, station
) -> None:
    judge_again(own_run, workers=1, progress=False)
    settings = EvaluationSettings(grasps_per_object=30, blind=True)
    run = evaluate(scene, station, own_run.path, settings=settings, workers=1, progress=False)
    assert sum(v.judged_again == "reference" for v in run.verdicts.values()) == len(
        own_run.contested
    )


def test_what_cannot_judge_again_is_said(own_run: Run, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"'standard' .* judged all grasps"):
        judge_again(own_run, engine="standard")
    with pytest.raises(UnknownNameError, match=r"engine .refrence. does not exist.*reference"):
        judge_again(own_run, engine="refrence")
    journal = own_run.path / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-1]))
    with pytest.raises(InvalidInputError, match="is not complete"):
        judge_again(load_run(own_run.path))
