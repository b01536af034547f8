"""What the report tells first: figures, cascade, pictures, causes and margins of a known run."""

from __future__ import annotations

import math
import re
import shlex
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from known_judge import expected
from page_reading import Node, part, read_page
from statsmodels.stats.proportion import proportion_confint

from burg_drake.core import Outcome
from burg_drake.evaluation import (
    GROUP_CLASSES,
    MAX_DRAWN_GRASPS,
    MAX_PICTURED_INSTANCES,
    ResultRows,
    Run,
    drawn_rows,
    report_page,
)
from burg_drake.visualization import HistogramSeries, Limit, mirrored_histogram, outcome_group


@pytest.fixture
def run(known_run: Run) -> Run:
    return known_run


@pytest.fixture
def page(run: Run) -> Node:
    return read_page(run.report_path.read_text(encoding="utf-8"))


def outcomes(run: Run) -> Counter[Outcome]:
    """By the judge itself, not by the run."""
    return Counter(expected(id) for id in run.candidates.id)


def wilson(part: int, whole: int) -> str:
    low, high = proportion_confint(part, whole, method="wilson")
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def test_the_first_sentence_and_the_tiles_have_the_figures_of_the_run(run: Run, page: Node) -> None:
    found = outcomes(run)
    lifted, judged = found[Outcome.LIFTED], found.total()
    executed = judged - found[Outcome.COLLISION_TABLE] - found[Outcome.NO_IK]
    lead = page.find("p", "lead")[0].text.replace("\xa0", " ")
    assert lead.startswith(
        f"{lifted} of {judged} grasps lifted their object ({100 * lifted / judged:.1f} %,"
        f" 95 % interval {wilson(lifted, judged)})."
    )
    assert f"{100 * lifted / executed:.1f} %, interval {wilson(lifted, executed)}" in lead
    assert f"the open hand collides in {found[Outcome.COLLISION_TABLE]}" in lead
    assert f"hand or arm cannot reach the grasp in {found[Outcome.NO_IK]}" in lead
    tiles = {
        d.find("dt")[0].text: d.find("dd")[0].text for d in page.find(style="tiles")[0].find("div")
    }
    assert tiles["Grasps judged"].startswith(f"{judged} ")
    assert tiles["Executed"].startswith(f"{executed} ")
    assert tiles["Lifted"].startswith(f"{lifted} of {executed} executed; ")
    assert tiles["Success of all"].startswith(
        f"{100 * lifted / judged:.1f} % {wilson(lifted, judged)}"
    )


def test_the_cascade_loses_what_the_judge_took(run: Run, page: Node) -> None:
    found, passed = outcomes(run), len(run.candidates)
    taken = {
        "clear": Outcome.COLLISION_TABLE,
        "reachable": Outcome.NO_IK,
        "held": Outcome.SLIPPED,
        "lifted": Outcome.LIFTED_DISTURBED,
    }
    rows = part(page, "From candidates to lifts").find("li")
    assert [row.find("b")[0].text for row in rows] == [
        *("candidates", "clear", "reachable", "planned", "executed", "held", "lifted")
    ]
    for row in rows:
        outcome = taken.get(row.find("b")[0].text)
        bars = {b.style[0]: float(b.attributes["style"][6:-1]) for b in row.find("i")}
        if outcome:
            passed -= found[outcome]
            assert (
                f"lost {found[outcome]}: {found[outcome]} {outcome.replace('_', ' ')}" in row.text
            )
            lost = 100 * found[outcome] / len(run.candidates)
            assert bars[GROUP_CLASSES[outcome_group(outcome).name]] == pytest.approx(lost, abs=0.01)
        assert row.find("span", "passed")[0].text == str(passed)
        assert bars["pass"] == pytest.approx(100 * passed / len(run.candidates), abs=0.01)


def test_every_grasp_is_drawn_once_in_the_colour_of_its_outcome(run: Run, page: Node) -> None:
    drawn = {}
    for picture in part(page, "The grasps").find("svg"):
        success, failure = (g for g in picture.children if isinstance(g, Node))
        for panel, side in ((success, True), (failure, False)):
            for group in panel.find("g", "grasp"):
                for path in group.find("path"):
                    id = path.find("title")[0].text
                    assert id not in drawn
                    drawn[id] = group.style[1], side
                    assert len(re.findall("[ML]", path.attributes["d"])) == 6
    assert drawn == {
        id: (GROUP_CLASSES[outcome_group(expected(id)).name], expected(id) is Outcome.LIFTED)
        for id in run.candidates.id
    }


def test_the_picture_of_an_object_is_that_of_its_grasps(run: Run, page: Node) -> None:
    figures = part(page, "The grasps").find("figure")
    assert [f.find("b")[0].text for f in figures] == ["left", "right", "bar"]
    for figure in figures:
        name = figure.find("b")[0].text
        ids = [t.text for g in figure.find("g", "grasp") for t in g.find("title")]
        assert {id.rsplit("-", 1)[0] for id in ids} == {name}
        lifted = sum(expected(id) is Outcome.LIFTED for id in ids)
        assert f"{lifted} of 30 lifted" in figure.text
        best = run.best(only=[name])[0]
        assert figure.find("code")[0].text == best


def test_each_cause_has_a_command_for_a_typical_grasp(run: Run, page: Node) -> None:
    found = outcomes(run)
    entries = part(page, "Why grasps fail").find("article")
    names = [e.find("h3")[0].text for e in entries]
    failed = [(n, o) for o, n in found.items() if o is not Outcome.LIFTED]
    assert len(names) == len(failed)
    counts = [int(re.search(r"(\d+) \(", name)[1]) for name in names]
    assert counts == sorted((n for n, _ in failed), reverse=True)
    results = run.results
    for entry in entries:
        words = shlex.split(entry.find("pre")[0].text)
        assert words[:-1] == ["burg-drake", "replay", str(run.path), "--grasp"]
        outcome = expected(words[-1])
        assert entry.find("h3")[0].text.startswith(outcome.value.replace("_", " "))
        margin = {Outcome.COLLISION_TABLE: "overlap", Outcome.SLIPPED: "slip"}.get(outcome)
        if margin:  # as many are milder as are worse, or one fewer, of equal ones any
            values = results[margin][results["outcome"] == outcome]
            own = results[margin][results["id"] == words[-1]][0]
            assert own == np.quantile(values, 0.5, method="lower")


def test_margins_have_the_medians_of_both_sides(run: Run, page: Node) -> None:
    section, results = part(page, "Margins"), run.results
    executed = results["stage"] == "executed"
    lifted = results["outcome"] == Outcome.LIFTED
    slip = next(s for s in section.find("svg") if "slip" in s.attributes["aria-label"])
    for name, mask in (("lifted", lifted), ("not lifted", executed & ~lifted)):
        median = 1e3 * np.median(results["slip"][mask])
        assert f"{name}: {mask.sum()}, median {median:.2f} mm" in slip.text
    moved = next(s for s in section.find("svg") if "other objects" in s.attributes["aria-label"])
    assert "limit 10 mm" in moved.text


def test_a_run_of_failures_alone(run: Run, tmp_path: Path) -> None:
    """And an incomplete one, and an empty one."""
    journal = (run.path / "journal.jsonl").read_text().splitlines(keepends=True)
    failed = [line for line in journal if '"lifted' not in line]
    assert failed and len(failed) < len(journal)
    for lines, said in (
        (failed, f"None of {len(failed)} grasps lifted its object."),
        ([], "No grasp is judged yet."),
    ):
        folder = tmp_path / str(len(lines))
        shutil.copytree(run.path, folder)
        (folder / "journal.jsonl").write_text("".join(lines))
        part_run = Run(folder, run.document)
        root = read_page(report_page(part_run))
        assert root.find("p", "lead")[0].text.startswith(said)
        assert f"{len(lines)} of {len(journal)} grasps are judged" in root.text
        titles = [section.find("h2")[0].text for section in root.find("section")]
        assert ("The grasps" in titles) == ("Why grasps fail" in titles) == bool(lines)
        assert "nan" not in root.text.lower().replace("pregrasp", "")


def test_many_grasps_are_drawn_in_part_and_the_page_stays_small(run: Run) -> None:
    times = 300
    verdicts = [run.verdicts[id] for id in run.candidates.id]
    large = Run(run.path, run.document)
    large.__dict__["_rows"] = ResultRows.of(
        run.candidates,
        np.tile(np.arange(len(verdicts)), times),
        lambda rows: [verdicts[row] for row in rows],
        **run.table_settings,
    )
    text = report_page(large)
    grasps = [p for g in read_page(text).find("g", "grasp") for p in g.find("path")]
    assert 0.9 * MAX_DRAWN_GRASPS <= len(grasps) <= MAX_DRAWN_GRASPS + 10 * MAX_PICTURED_INSTANCES
    assert len(text.encode()) < 1_000_000
    assert f"of {times * len(run.candidates):,} grasps, from all outcomes" in text


def test_the_grasps_that_are_drawn_are_in_the_shares_of_all() -> None:
    groups = np.repeat(np.array([0, 2, 6, 9], dtype=np.int8), [6000, 2000, 1999, 1])
    np.random.default_rng(0).shuffle(groups)
    assert drawn_rows(groups, len(groups)).tolist() == list(range(len(groups)))
    chosen = drawn_rows(groups, 100)
    assert len(set(chosen.tolist())) == len(chosen) <= 104
    counts = np.bincount(groups[chosen], minlength=10)[[0, 2, 6, 9]]
    assert abs(counts - [60, 20, 20, 1]).max() <= 2 and counts[-1] == 1


def test_mirrored_bars_hold_every_value_on_their_side() -> None:
    rng = np.random.default_rng(0)
    good, bad = rng.exponential(2.0, 400), np.append(rng.exponential(4.0, 50), 1e3)
    series = [HistogramSeries(bad[:30], "g2", "lost"), HistogramSeries(bad[30:], "g3", "never")]
    chart = mirrored_histogram(
        HistogramSeries(good, "g0", "lifted"),
        series,
        title="slip",
        unit="mm",
        limit=Limit(3.0, "limit"),
    )
    root = read_page(chart)
    axis = float(next(line for line in root.find("line", "axis")).attributes["y1"])
    held: Counter[str] = Counter()
    for bar in root.find("rect"):
        name, number = re.match(r"(\w+): (\d+),", bar.find("title")[0].text).groups()
        held[name] += int(number)
        top, height = float(bar.attributes["y"]), float(bar.attributes["height"])
        above = top + height <= axis + 0.02
        assert above is (name == "lifted") and (above or top >= axis - 0.02)
    assert held == {"lifted": 400, "lost": 30, "never": 21}
    ticks = {t.text: float(t.attributes["x"]) for t in root.find("text", "middle")}
    scale = (ticks["4"] - ticks["0"]) / 4
    lines = [float(line.attributes["x1"]) for line in root.find("line", "median")]
    expected_places = [ticks["0"] + scale * np.median(values) for values in (good, bad)]
    np.testing.assert_allclose(lines, expected_places, atol=0.1)
    (limit,) = root.find("line", "limit")
    assert math.isclose(float(limit.attributes["x1"]), ticks["0"] + 3 * scale, abs_tol=0.1)
