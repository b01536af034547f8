"""The report: one file, nothing from elsewhere, nothing unescaped, numbers of the run."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from known_judge import JUDGE_FACTORY, TOPPLED, CrashingJudge, Make
from page_reading import part, read_page

from burg_drake.core import Outcome
from burg_drake.evaluation import (
    GROUP_CLASSES,
    STEP_LOSSES,
    EvaluationSettings,
    Run,
    evaluate,
    report_page,
    style_sheet,
    summarize,
)
from burg_drake.visualization import (
    HistogramSeries,
    Html,
    element,
    join,
    mirrored_histogram,
    nice_step,
)


@pytest.fixture
def run(known_run: Run, known_judge: None) -> Run:
    return known_run


def test_the_page_is_whole_and_stands_alone(run: Run) -> None:
    page = run.report_path.read_text()
    text = read_page(page).text
    assert page == report_page(run)
    total = summarize(run).total
    for expected in (
        "three on panda_tabletop",
        f"of {total.executed} executed",
        run.best()[0],
        f"--seed 0 -o {run.path}",
        run.document.scene.content[:12],
        "drake",
    ):
        assert expected in " ".join(text.split()), expected
    assert "not complete" not in text


def test_the_command_is_the_one_that_was_run(run: Run) -> None:
    page = read_page(run.report_path.read_text())
    words = part(page, "How to repeat it").find("pre")[0].text.split()
    assert words == [
        *("burg-drake", "evaluate", run.document.scene.path, "--station", "panda_tabletop"),
        *("--mode", "reach"),
        *("--grasps-per-object", "30", "--approach-angle", "75.0", "--blind"),
        *("--engine", "standard", "--seed", "0"),
        *("-o", str(run.path)),
    ]


def test_failures_are_listed_and_escaped(
    scene, station, tmp_path: Path, judged_here: None, monkeypatch, run: Run
) -> None:
    judge = Make(CrashingJudge(how=((run.candidates.id[0], "error"),)))
    monkeypatch.setattr(JUDGE_FACTORY, lambda *_: judge)
    name = "<script>alert(1)</script> & co"
    moved = dataclasses.replace(scene, path=tmp_path / f"{name}.yaml")
    failed = evaluate(
        moved,
        station,
        tmp_path / "f",
        settings=EvaluationSettings(grasps_per_object=3, blind=True),
        workers=1,
        progress=False,
    )
    text = read_page(failed.report_path.read_text()).text
    assert name in text
    assert "RuntimeError: the solver did not converge" in text


def table_of(page: str, title: str) -> dict[str, list[str]]:
    """Cells of the table under a heading by the first one of each row."""
    part = page[page.index(f"<h2>{title}</h2>") :]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", part[: part.index("</section>")])
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in rows]
    return {first: rest for first, *rest in cells}


def test_blockers_are_listed_with_their_depth(run: Run) -> None:
    found = table_of(report_page(run), "Start collisions")
    collides = run.results["outcome"] == Outcome.COLLISION_TABLE
    depth = run.results["overlap"][collides] * 1e3
    count = str(collides.sum())
    expected = [count, "·", count, f"{np.median(depth):.1f} mm", f"{depth.max():.1f} mm"]
    assert found["table"] == expected and list(found) == ["body", "table"]


def test_the_stages_tell_what_stopped_every_grasp() -> None:
    told = [outcome for outcomes in STEP_LOSSES.values() for outcome in outcomes]
    assert sorted(told) == sorted(set(Outcome) - {Outcome.LIFTED})
    assert Outcome.BLOCKED in STEP_LOSSES["held"]


def test_what_was_disturbed_is_told(run: Run) -> None:
    found = table_of(report_page(run), "What was disturbed")
    pushed = run.results["outcome"] == Outcome.LIFTED_DISTURBED
    far = run.results["others_moved"] * 1e3
    assert "over 10 mm" in found["object"]
    for name, others in (("bar", ("left", "right")), ("left", ("bar",))):
        of_others = np.isin(run.results["instance"], others)
        executed = of_others & np.isfinite(far)
        count = str((pushed & of_others).sum())
        by = max(others, key=lambda i: (pushed & (run.results["instance"] == i)).sum())
        times = (pushed & (run.results["instance"] == by)).sum()
        assert found[name] == [
            str(executed.sum()),
            count,
            count,
            f"{np.median(far[pushed & of_others]):.1f} mm",
            f"{far[pushed & of_others].max():.1f} mm",
            f"{np.degrees(50.0 * far[pushed & of_others].max() / 1e3):.1f}°",
            str((far[pushed & of_others] > TOPPLED * 1e3).sum() or "·"),
            f"on {by} ({times})",
        ]


def test_a_custom_engine_is_told_apart_from_its_preset(run: Run) -> None:
    engine = dataclasses.replace(run.document.engine, time_step=0.004)
    document = dataclasses.replace(run.document, engine=engine)
    text = read_page(report_page(Run(run.path, document))).text
    assert "engine standard (custom)" in text and "The engine is not a preset" in text
    text = read_page(report_page(run)).text
    assert "(custom)" not in text and "not a preset" not in text


def test_an_unfinished_run_says_so(own_run: Run) -> None:
    run = own_run
    journal = run.path / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:10]))
    text = read_page(report_page(Run(run.path, run.document))).text
    assert "not complete: 10 of 90 grasps are judged" in text
    journal.write_bytes(b"")
    read_page(report_page(Run(run.path, run.document)))


def test_numbers_stand_out_from_every_colour() -> None:
    """Contrast of WCAG 2.2, of light and dark pages; `.part` has no colour of its own."""

    def luminance(color: str) -> float:
        parts = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    rule = r"\.(g\d+) {[^}]*background: (#\w{6});[^}]*[^-]color: (#\w{6});"
    rules = re.findall(rule, style_sheet())
    assert {name for name, _, _ in rules} == set(GROUP_CLASSES.values())
    for name, background, text in rules:
        dark, light = sorted((luminance(background), luminance(text)))
        assert (light + 0.05) / (dark + 0.05) >= 4.5, (name, background, text)


def test_histogram_bars_hold_every_value() -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.exponential(2.0, 500), [1e3, 1e4]])
    chart = mirrored_histogram(HistogramSeries(values, "g0", "all"), [], title="x", unit="mm")
    counts = [int(n) for n in re.findall(r"<title>all: (\d+),", chart)]
    assert sum(counts) == 502
    heights = [float(h) for h in re.findall(r'height="([\d.]+)" class="g0"', chart)]
    np.testing.assert_allclose(
        np.array(heights) / max(heights), np.array(counts) / max(counts), atol=2e-4
    )
    empty = mirrored_histogram(HistogramSeries(np.empty(0), "g0", "all"), [], title="x", unit="")
    assert "NaN" not in empty and "<rect" not in empty


def test_axis_steps_are_round() -> None:
    assert [nice_step(v) for v in (0.011, 0.2, 3.0, 7.0)] == [0.02, 0.2, 5.0, 10.0]


def test_texts_are_escaped_and_markup_is_not() -> None:
    assert element("p", "a < b", element("b", "&"), None, 3, class_='"') == (
        '<p class="&quot;">a &lt; b<b>&amp;</b>3</p>'
    )
    assert join("<", Html("<i>")) == "&lt;<i>"
