"""Comparison of two runs: real runs by two engines, and invented runs with known figures."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import cohen_kappa_score
from statsmodels.stats.proportion import proportion_confint

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import GraspSet, InvalidInputError, Verdict, grasp_from_axes, make_pose
from burg_drake.evaluation import (
    MEASURE_NUMBERS,
    EvaluationSettings,
    Input,
    Run,
    evaluate,
    settings_numbers,
)
from burg_drake.experiment import (
    TRIAL_SETTING_UNITS,
    RunAgreement,
    compare,
    comparison_json,
    comparison_page,
)
from burg_drake.simulation import NO_GRIP_LIMITS, ShakeSettings, TrialSettings
from burg_drake.station import ENGINES, GraspMotion
from tests.evaluation.inline_executor import Inline
from tests.experiment import known_runs
from tests.experiment.test_comparison import Page

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
HELD = ("lifted", "lifted_disturbed", "lifted_turned")
MEASURED = ("clearance", "slip", "tilt", "pad_force", "patch_area", "lift")


@pytest.fixture(scope="module")
def engines(no_pose_mistakes: None, tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Run]:
    """The same grasps by `screening` and by `standard`: along the box's upper edge, up to where
    nothing is gripped any more; within it; above it."""
    folder = tmp_path_factory.mktemp("engines")
    scene = known_runs.make_scene(folder)
    along = np.stack([ABOVE @ make_pose(p_AB=(0.0, y, 0.0)) for y in np.linspace(-0.09, 0.09, 13)])
    high, low = (ABOVE @ make_pose(p_AB=(0.0, 0.0, z)) for z in (-0.1, 0.1))
    grasps = GraspSet.create(np.concatenate([along, [high, low]]), object="box", width=0.06)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("burg_drake.evaluation.run_preparation.write_report", lambda run: None)
        found = [
            evaluate(
                scene,
                "panda_tabletop",
                folder / engine,
                settings=EvaluationSettings(engine=engine, mode="hand"),
                grasps={"box": grasps},
                executor=Inline(),
                progress=False,
            )
            for engine in ("screening", "standard")
        ]
    return found[0], found[1]


def agreement_of(first: Run, second: Run) -> RunAgreement:
    found = compare(first, second).agreement
    assert found is not None
    return found


def test_two_engines_on_the_same_grasps(engines: tuple[Run, Run]) -> None:
    one, other = (run.results for run in engines)
    assert one["id"].tolist() == other["id"].tolist()
    held = [np.isin(rows["outcome"], HELD) for rows in (one, other)]
    assert 0 < held[0].sum() < len(held[0])
    found = agreement_of(*engines)
    alike = held[0] == held[1]
    assert found.alike.value == pytest.approx(alike.mean())
    bounds = proportion_confint(alike.sum(), len(alike), method="wilson")
    assert (found.alike.low, found.alike.high) == pytest.approx(bounds)
    assert found.kappa.value == pytest.approx(cohen_kappa_score(*held))
    assert sum(n for row in found.stages.values() for n in row.values()) == len(alike)
    assert sum(n for row in found.apart.values() for n in row.values()) == (~alike).sum()
    both = (one["stage"] == "executed") & (other["stage"] == "executed")
    assert found.stages["executed"]["executed"] == both.sum() > 10
    assert set(MEASURED) <= {d.name for d in found.differences}
    for d in found.differences:
        apart = other[d.name][both] - one[d.name][both]
        apart = apart[np.isfinite(apart)]
        assert d.grasps == len(apart)
        expected = np.median(apart), np.median(abs(apart)), np.quantile(abs(apart), 0.9)
        assert (d.median, d.median_size, d.within) == pytest.approx(expected)
    by_name = {d.name: d for d in found.differences}
    assert by_name["clearance"].within == 0.0  # no engine has a part in it
    assert by_name["slip"].within > 0.0


def test_a_run_agrees_with_itself(engines: tuple[Run, Run]) -> None:
    found = agreement_of(engines[0], engines[0])
    assert found.alike.value == found.kappa.value == 1.0 and found.apart == {}
    assert {(d.median, d.within) for d in found.differences} == {(0.0, 0.0)}
    assert all(b.share.value == 1.0 for c in found.margins for b in c.bins)


def test_the_order_of_two_runs_turns_the_table_and_the_signs(engines: tuple[Run, Run]) -> None:
    one, other = agreement_of(*engines), agreement_of(*reversed(engines))
    assert one.alike == other.alike
    turned = {(b, a): n for a, row in other.stages.items() for b, n in row.items()}
    assert {(a, b): n for a, row in one.stages.items() for b, n in row.items()} == turned
    for d, back in zip(one.differences, other.differences, strict=True):
        assert (d.name, d.within) == (back.name, back.within)
        assert d.median == pytest.approx(-back.median, abs=1e-15)


def test_all_of_it_is_told(
    engines: tuple[Run, Run], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", *(str(run.path) for run in engines)]
    page = tmp_path / "compare.html"
    assert main([*words, "--html", str(page)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "Held in both or in neither: " in out
    assert "First: engine screening; second: engine standard." in out
    assert "along the margins of the first run" in out and "second run minus first" in out
    text = page.read_text(encoding="utf-8")
    assert Page(text).open == []
    assert "First: engine screening; second: engine standard." in text
    for title in ("Agreement on holding", "Where the runs disagree", "How much margins"):
        assert f"<h2>{title}" in text
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["agreement"]["stages"] == agreement_of(*engines).stages
    assert {d["name"] for d in told["agreement"]["differences"]} >= set(MEASURED)
    assert (told["first"]["engine"], told["reference"]["engine"]) == ("screening", "standard")


def test_neither_of_two_runs_is_called_the_truth(
    engines: tuple[Run, Run], capsys: pytest.CaptureFixture[str]
) -> None:
    page = comparison_page(compare(*engines))
    assert main(["compare", *(str(run.path) for run in engines)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    for text in (re.sub("<[^>]*>", " ", page.split("</style>")[-1]), out):
        for word in ("truth", "actual success", "elected trials", "redicted", "happened:"):
            assert word not in text, word
        assert "success in the second" in text and "Verdicts of both runs" in text
    assert "Figures of the first run, with the second run in the place of what happened" in page
    assert "<dt>first run</dt>" in page and "<dt>second run</dt>" in page


def made_up(folder: Path, *outcomes: list[Verdict | None], **fields: object) -> tuple[Run, Run]:
    """Two runs of the mug by verdicts, of which the second has other fields in its document."""
    scene = known_runs.make_scene(folder)
    made = [
        known_runs.make_run(folder / name, scene, {"mug": list(told)}, **more)  # type: ignore[arg-type]
        for name, told, more in zip(("a", "b"), outcomes, ({}, fields), strict=True)
    ]
    return made[0], made[1]


def test_disagreement_at_small_margins_is_seen_there(tmp_path: Path) -> None:
    """The second run drops the ten of forty grasps with the least pad force."""
    force = np.random.default_rng(1).permutation(np.arange(1.0, 41.0))
    first = [known_runs.ended("lifted", pad_force=f, slip=0.001) for f in force]
    second = [
        known_runs.ended("slipped" if f <= 10 else "lifted", pad_force=f + (1 if f > 38 else 0.25))
        for f in force
    ]
    found = agreement_of(*made_up(tmp_path, first, second))
    (margin,) = found.margins  # the second run has no slip
    assert margin.name == "pad_force"
    assert [(b.low, b.high, b.share.value) for b in margin.bins] == [
        (1.0, 10.0, 0.0),
        (11.0, 20.0, 1.0),
        (21.0, 30.0, 1.0),
        (31.0, 40.0, 1.0),
    ]
    (difference,) = found.differences
    assert (difference.grasps, difference.median, difference.within) == (40, 0.25, 0.25)
    assert found.apart == {"executed": {"executed": 10}} and found.alike.value == 0.75
    page = comparison_page(compare(tmp_path / "a", tmp_path / "b"))
    assert "10 of 10 trials, 11 to 20" in page and "0 of 10 trials, 1 to 10" in page


def sure(outcome: str, confidence: float | None, **more: str) -> Verdict:
    return dataclasses.replace(known_runs.ended(outcome), confidence=confidence, **more)  # type: ignore[arg-type]


def test_grasps_that_part_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of sixty grasps every contested one is dropped by the second run, and one of no confidence;
    on the bounds the middle group begins and ends."""
    confidence = [*np.linspace(0.5, 0.89, 52), 0.9, 0.92, 0.95, 0.951, 0.98, 1.0, None, None]
    first = [sure("lifted", c) for c in confidence]
    ends = ["slipped"] * 52 + ["lifted_turned"] + ["lifted"] * 5 + ["dropped", "lifted"]
    runs = made_up(tmp_path, list(first), [known_runs.ended(end) for end in ends])
    comparison = compare(*runs)
    found = comparison.agreement
    assert found is not None
    expected = [k for k, end in enumerate(ends) if not end.startswith("lifted")]
    ids = [runs[0].candidates.id[k] for k in expected]
    assert [one.grasp for one in found.parted] == ids and len(ids) == 53
    assert [one.confidence for one in found.parted] == [confidence[k] for k in expected]
    last = found.parted[-1]
    assert (last.scene, last.object, last.first, last.second) == ("two", "mug", "lifted", "dropped")
    for k, run in enumerate(runs):
        assert last.replays[k] == f"burg-drake replay {run.path} --grasp {last.grasp}"
    groups = {g.name: (g.agreement.trials, g.agreement.accuracy.value) for g in found.confidence}
    assert groups == {"below 0.9": (52, 0.0), "0.9 to 0.95": (3, 1.0), "above 0.95": (3, 1.0)}
    assert list(groups) == ["below 0.9", "0.9 to 0.95", "above 0.95"]

    page = comparison_page(comparison)
    listed = page[page.index("<h2>Grasps that only one of the runs holds") :]
    listed = listed[: listed.index("</table>")]
    assert [id in listed for id in ids] == [True] * 50 + [False] * 3
    commands = re.sub("<[^>]*>", "", listed)
    assert all(f"burg-drake replay {run.path} --grasp {ids[0]}" in commands for run in runs)
    assert "<h2>Do the runs disagree on contested grasps?" in page
    words = ["compare", *(str(run.path) for run in runs)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert [id in out for id in ids] == [True] * 10 + [False] * 43
    assert "43 more in the JSON" in out
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["agreement"]
    assert [one["grasp"] for one in told["parted"]] == ids
    assert told["parted"][-1]["confidence"] is None


def test_verdicts_of_a_second_engine_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = {"judged_again": "reference", "outcome_before": "slipped"}
    first = [sure("lifted", 0.97, **again) for _ in range(3)] + [known_runs.ended("lifted")] * 2
    # of what is left out of the comparison nobody has a verdict to count
    first.append(dataclasses.replace(known_runs.failed(), judged_again="reference"))
    second = [known_runs.ended("lifted")] * 4 + [sure("lifted", 0.99, judged_again="mujoco")]
    runs = made_up(tmp_path, list(first), [*second, known_runs.ended("lifted")])
    found = compare(*runs)
    assert found.coverage.compared == 5
    assert (found.first.judged_again, found.reference.judged_again) == (
        {"reference": 3},
        {"mujoco": 1},
    )
    words = [
        "engine standard, 3 grasps judged again by reference",
        "engine standard, 1 grasp judged again by mujoco",
    ]
    assert main(["compare", *(str(run.path) for run in runs)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"First: {words[0]}; second: {words[1]}." in out
    page = comparison_page(found)
    assert all(f"mode hand, {text}, station" in page for text in words)
    assert json.loads(comparison_json(found))["first"]["judged_again"] == {"reference": 3}
    # the order of the runs turns it, and a run without such verdicts says nothing of them
    assert compare(*reversed(runs)).first.judged_again == {"mujoco": 1}
    assert "judged again" not in compare(*made_up(tmp_path / "c", LIFTED, LIFTED)).first.engines


def test_stages_and_objects(tmp_path: Path) -> None:
    scene = known_runs.make_scene(tmp_path)
    told = {
        "first": {"mug": ["lifted", "collision_target", "slipped"], "box": ["lifted", "lifted"]},
        "second": {"mug": ["lifted_turned", "lifted", "slipped"], "box": ["no_ik", "dropped"]},
    }
    runs = [
        known_runs.make_run(
            tmp_path / name,
            scene,
            {o: [known_runs.ended(v) for v in outcomes] for o, outcomes in by_object.items()},
        )
        for name, by_object in told.items()
    ]
    found = agreement_of(*runs)
    assert found.stages == {"clear": {"executed": 1}, "executed": {"reachable": 1, "executed": 3}}
    assert found.apart == {"clear": {"executed": 1}, "executed": {"reachable": 1, "executed": 1}}
    assert {g.name: g.agreement.accuracy.value for g in found.objects} == {
        "mug": pytest.approx(2 / 3),
        "box": 0.0,
    }
    assert found.alike.value == pytest.approx(2 / 5) and found.margins == found.differences == ()
    # what counts as success elsewhere says nothing of what is held
    assert compare(*runs, success="held").agreement == found


LIFTED: list[Verdict | None] = [known_runs.ended("lifted"), known_runs.ended("slipped")]


USUAL = GraspMotion()


def recorded(motion: GraspMotion = USUAL, **changes: float) -> dict[str, float]:
    """Settings of trials that a present run records."""
    return settings_numbers(TrialSettings(motion=motion, **changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("trial", "told"),
    [
        (recorded(GraspMotion(lift_height=0.2)), "lift 0.3 m and 0.2 m"),
        (recorded(GraspMotion(standoff=0.05)), "standoff 0.1 m and 0.05 m"),
        (recorded(GraspMotion(retreat=0.05)), "retreat 0 m and 0.05 m"),
        (recorded(GraspMotion(least_lift=0.1)), "least lift none and 0.1 m"),
        (
            recorded(GraspMotion(lift_direction=(0.0, 3.0, 4.0))),
            "lift direction [0, 0, 1] and [0, 0.6, 0.8]",
        ),
        (recorded(tilt_limit=math.radians(15)), "tilt limit 30 degrees and 15 degrees"),
        (recorded(slip_limit=0.01), "slip limit 0.02 m and 0.01 m"),
        (recorded(approach=True), "approach no and yes"),
        (recorded(hold_time=1.0), "hold time 0.5 s and 1 s"),
        (recorded(tilt_limit=math.pi, slip_limit=math.inf), "slip limit 0.02 m and none"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_other_phases_are_refused(trial: dict[str, float], told: str, tmp_path: Path) -> None:
    scene = known_runs.make_scene(tmp_path)
    runs = [
        known_runs.make_run(tmp_path / name, scene, {"mug": LIFTED}, trial=values)
        for name, values in (("a", recorded()), ("b", trial))
    ]
    with pytest.raises(InvalidInputError) as refused:
        compare(*runs)
    start = f"{tmp_path / 'a'} and {tmp_path / 'b'} were made with different phases: "
    assert str(refused.value).startswith(start)
    assert told in str(refused.value)
    assert compare(runs[1], runs[1]).coverage.compared == 2


def test_every_setting_of_a_trial_is_compared(tmp_path: Path) -> None:
    """Also those that will be added; and those that are lengths have a unit in messages."""
    scene = known_runs.make_scene(tmp_path)
    default = TrialSettings(motion=GraspMotion())
    run = known_runs.make_run(tmp_path / "a", scene, {"mug": LIFTED}, trial=recorded())
    names = [f.name for f in dataclasses.fields(TrialSettings) if f.name != "motion"]
    for name in names:
        value = getattr(default, name)
        changed = not value if isinstance(value, bool) else 0.9 * (value or 0.0)
        changed = ShakeSettings() if name == "shake" else changed
        other = settings_numbers(dataclasses.replace(default, **{name: changed}))
        made = known_runs.make_run(tmp_path / name, scene, {"mug": LIFTED}, trial=other)
        with pytest.raises(InvalidInputError, match=f"different phases: {name.replace('_', ' ')} "):
            compare(run, made)
        assert name in (*TRIAL_SETTING_UNITS, "shake") or isinstance(value, bool)


def test_all_that_differs_is_named_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = made_up(
        tmp_path,
        LIFTED,
        LIFTED,
        trial=recorded(GraspMotion(lift_height=0.2), disturbance=0.02),
        station=Input(name="other", path="other.yaml", content="f" * 64),
    )
    own = first.document.station
    assert main(["compare", str(first.path), str(second.path)]) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: {first.path} and {second.path} were made with different phases:"
        " lift 0.3 m and 0.2 m; disturbance 0.01 m and 0.02 m; tilt limit none and 30 degrees;"
        " slip limit none and 0.02 m; and on different stations:"
        f" panda_tabletop ({own.content[:12]}) and other ({'f' * 12}); evaluate the grasps of one"
        f" (folder {first.path}) again as those of the other\n"
    )


def test_what_was_not_recorded_is_what_it_was(tmp_path: Path) -> None:
    """Runs from before limits were recorded, and lift directions that are not normalized."""
    first, second = made_up(tmp_path, LIFTED, LIFTED, trial=recorded(**NO_GRIP_LIMITS))
    assert first.document.trial == {}
    assert compare(first, second).coverage.compared == 2
    scene = known_runs.make_scene(tmp_path)
    up = recorded(GraspMotion(lift_direction=(0.0, 0.0, 2.5)), **NO_GRIP_LIMITS)
    longer = known_runs.make_run(tmp_path / "c", scene, {"mug": LIFTED}, trial=up)
    assert compare(first, longer).coverage.compared == 2


def test_engines_may_differ_and_are_named(tmp_path: Path) -> None:
    found = compare(*made_up(tmp_path, LIFTED, LIFTED, engine=ENGINES["screening"]))
    assert (found.first.engine, found.reference.engine) == ("standard", "screening")
    assert found.settings == ("engine is standard in the first, screening in the second",)


def test_of_two_modes_only_what_both_executed_is_compared(tmp_path: Path) -> None:
    outcomes = ["lifted", "slipped", "lifted", "collision_target"]
    by_hand: list[Verdict | None] = [known_runs.ended(v) for v in outcomes]
    with_arm: list[Verdict | None] = [
        known_runs.ended(v) for v in ("lifted", "lifted", "no_ik", "collision_target")
    ]
    found = compare(*made_up(tmp_path, by_hand, with_arm, mode="reach"))
    assert found.coverage.compared == 2
    assert found.coverage.left_out == {"not executed in both runs, which have different modes": 2}
    assert found.agreement is not None and found.agreement.alike.value == 0.5
    scene = known_runs.make_scene(tmp_path)
    nothing: list[Verdict | None] = [known_runs.ended("no_ik")] * 4
    out_of_reach = known_runs.make_run(tmp_path / "c", scene, {"mug": nothing}, mode="arm")
    with pytest.raises(InvalidInputError, match=r"different modes \(hand and arm\), and no grasp"):
        compare(tmp_path / "a", out_of_reach)


def test_the_whole_arm_approaches_anyway(tmp_path: Path) -> None:
    """What was done counts, not what was asked: with the arm nobody asks for the approach."""
    scene = known_runs.make_scene(tmp_path)
    arm, still, going = (
        known_runs.make_run(
            tmp_path / name, scene, {"mug": LIFTED}, mode=mode, trial=recorded(approach=approach)
        )
        for name, mode, approach in (
            ("arm", "arm", False), ("still", "reach", False), ("going", "hand", True)
        )
    )  # fmt: skip
    assert compare(going, arm).notes == ()
    note = "the hand alone did not approach in the first run; the whole arm did in the second"
    assert compare(still, arm).notes == (note,)
    assert compare(arm, still).notes[0].startswith("the hand alone did not approach in the second")
    with pytest.raises(InvalidInputError, match="different phases: approach no and yes"):
        compare(still, going)


def test_how_others_were_watched_is_told(tmp_path: Path) -> None:
    measured = {**recorded(), **MEASURE_NUMBERS}
    first, second = made_up(tmp_path, LIFTED, LIFTED, trial=measured)
    first = known_runs.make_run(tmp_path / "c", first.scene(), {"mug": LIFTED}, trial=recorded())
    (told,) = compare(first, second).settings
    assert told == (
        "motion of others is of centres of mass in the first, of farthest points in the second"
    )


def test_against_trials_phases_may_differ(tmp_path: Path) -> None:
    """Against trials the robot is the reference, so one run may lift higher than the other."""
    first, second = made_up(tmp_path, LIFTED, LIFTED, trial=recorded(GraspMotion(lift_height=0.2)))
    sheet = burg.trials.plan_trials(first, out=tmp_path / "trials.yaml")
    for trial in sheet.trials:
        burg.trials.TrialBook(tmp_path / "trials.yaml").record(trial.number, outcome="lifted")
    found = compare(first, second, tmp_path / "trials.yaml")
    assert found.agreement is None and found.coverage.compared == 2
    assert any(text.startswith("motion is ") for text in found.settings)


def test_verdicts_of_a_second_engine_are_told_beside_trials(tmp_path: Path) -> None:
    verdicts = [sure("lifted", 0.8, judged_again="reference"), known_runs.ended("slipped")]
    first, second = made_up(tmp_path, list(verdicts), LIFTED)
    sheet = burg.trials.plan_trials(first, out=tmp_path / "trials.yaml")
    for trial in sheet.trials:
        burg.trials.TrialBook(tmp_path / "trials.yaml").record(trial.number, outcome="lifted")
    note = f"{first.path}: engine standard, 1 grasp judged again by reference"
    for found in (
        compare(first, tmp_path / "trials.yaml"),
        compare(first, second, tmp_path / "trials.yaml"),
    ):
        assert [text for text in found.notes if "judged again" in text] == [note]
    assert "judged again" not in " ".join(compare(second, tmp_path / "trials.yaml").notes)
