"""The report of a run over many scenes: its figures, its order, its links, its size."""

from __future__ import annotations

import dataclasses
import shlex
import time
from collections import Counter
from pathlib import Path

import known_judge
import numpy as np
import pytest
from known_judge import expected
from known_scene import write_scene
from page_reading import Node, part, read_page

from burg_drake.core import Outcome, Pose, clustered_interval, wilson_interval
from burg_drake.evaluation import (
    GROUP_CLASSES,
    Campaign,
    EvaluationSettings,
    OutcomeCounts,
    StoredRows,
    campaign_page,
    evaluate,
    find_causes,
    load_campaign,
    rows_of_run,
    summarize,
    worst_first,
    write_campaign_report,
)
from burg_drake.scene import Scene
from burg_drake.visualization import RankedShare, outcome_group, ranked_chart

pytestmark = pytest.mark.usefixtures("judged_here")

pytest.importorskip("pyarrow")
PER_OBJECT = 8


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three scenes, with the judge whose verdicts are known."""
    folder = tmp_path_factory.mktemp("many")
    first = write_scene(folder)
    scenes = [first]
    for k, keep in enumerate(((0, 1), (2,))):
        moved = [
            dataclasses.replace(first.document.instances[i], X_SO=Pose((0.2 + 0.1 * i, 0.3, 0.025)))
            for i in keep
        ]
        document = dataclasses.replace(first.document, name=f"part_{k}", instances=tuple(moved))
        scenes.append(Scene(document, first.library, folder / f"part_{k}.yaml"))
    with pytest.MonkeyPatch.context() as patch:
        known_judge.install(patch.setattr)
        evaluate(
            scenes,
            "panda_tabletop",
            folder / "run",
            settings=EvaluationSettings(grasps_per_object=PER_OBJECT, blind=True),
            workers=1,
            progress=False,
        )
    return folder / "run"


@pytest.fixture
def campaign(path: Path) -> Campaign:
    return load_campaign(path)


@pytest.fixture
def page(campaign: Campaign) -> Node:
    links = tuple(f"scenes/{n}/report.html" for n in campaign.names)
    return read_page(campaign_page(campaign), links)


def outcomes(campaign: Campaign) -> dict[str, Counter[Outcome]]:
    """By scene, from the judge itself."""
    return {
        name: Counter(expected(id) for id in run.candidates.id)
        for name, run in zip(campaign.names, campaign.runs, strict=True)
    }


def executed(found: Counter[Outcome]) -> int:
    return found.total() - found[Outcome.COLLISION_TABLE] - found[Outcome.NO_IK]


def test_the_figures_are_those_of_the_scenes_together(campaign: Campaign, page: Node) -> None:
    total = sum(outcomes(campaign).values(), Counter())
    lead = page.find("p", "lead")[0].text
    assert lead.startswith(f"{total[Outcome.LIFTED]} of {total.total()} grasps lifted their object")
    tiles = page.find(style="tiles")[0].text
    assert f"Executed {executed(total)} " in tiles and "in 3 scenes" in tiles
    rows = part(page, "From candidates to lifts").find("li")
    assert rows[-1].find("span", "passed")[0].text == str(total[Outcome.LIFTED])
    assert page.find("h1")[0].text == "3 scenes on panda_tabletop"


def test_scenes_stand_worst_first_and_lead_to_their_reports(campaign: Campaign, page: Node) -> None:
    found = outcomes(campaign)
    section = part(page, "Outcomes by scene")
    rows = section.find("tbody")[0].find("tr")
    shares = []
    for row in rows:
        own = found[row.find("a")[0].text]
        assert row.find("a")[0].attributes["href"].split("/")[1] == row.find("a")[0].text
        assert f"{own[Outcome.LIFTED]} / {executed(own)}" in row.text
        shares.append(own[Outcome.LIFTED] / executed(own))
    assert shares == sorted(shares) and len(shares) == 3
    dots = section.find("svg", "ranked")[0].find("circle")
    heights = [float(dot.attributes["cy"]) for dot in dots]
    np.testing.assert_allclose(np.diff(heights) / np.diff(shares), -156, rtol=0.01)


def test_every_grasp_is_drawn_on_its_object_in_its_colour(campaign: Campaign, page: Node) -> None:
    drawn = Counter(
        (figure.find("b")[0].text, path.find("title")[0].text, group.style[1])
        for figure in part(page, "The grasps").find("figure")
        for group in figure.find("g", "grasp")
        for path in group.find("path")
    )
    assert drawn == Counter(
        (candidates.grasps.object[k], id, GROUP_CLASSES[outcome_group(expected(id)).name])
        for candidates in (run.candidates for run in campaign.runs)
        for k, id in enumerate(candidates.id)
    )


def test_causes_are_those_of_the_runs_and_their_commands_exist(
    campaign: Campaign, page: Node
) -> None:
    counts: Counter[Outcome] = Counter()
    for run in campaign.runs:
        for cause in find_causes(rows_of_run(run.rows(), str(run.path))):
            counts[cause.outcome] += cause.number
    entries = part(page, "Why grasps fail").find("article")
    assert len(entries) == len(counts)
    for entry in entries:
        *_, folder, _, id = words = shlex.split(entry.find("pre")[0].text)
        assert words[:2] == ["burg-drake", "replay"]
        outcome = load_run_outcome(campaign, Path(folder).name, id)
        assert entry.find("h3")[0].text.startswith(outcome.replace("_", " "))
        assert f"{counts[Outcome(outcome)]} (" in entry.find("h3")[0].text


def load_run_outcome(campaign: Campaign, scene: str, id: str) -> str:
    return str(campaign.run(scene).row(id)["outcome"])


def test_without_its_report_a_scene_has_a_command(campaign: Campaign) -> None:
    worst = worst_first(summarize(campaign).scenes)[0].name
    report = campaign.folder(worst) / "report.html"
    kept = report.read_bytes()
    report.unlink()
    try:
        text = campaign_page(campaign)
    finally:
        report.write_bytes(kept)
    links = [f"scenes/{n}/report.html" for n in campaign.names if n != worst]
    section = part(read_page(text, tuple(links)), "Outcomes by scene")
    line = section.find("pre")[0].text
    assert line == f"burg-drake report {campaign.folder(worst)}"


@pytest.mark.thorough
def test_a_thousand_scenes_stay_a_readable_page(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And cost about as much as three."""
    import pyarrow

    scenes, each = 1000, campaign.rows(None).counts
    mine = campaign.document.assigned_scenes
    entries = [dataclasses.replace(mine[k % 3], name=f"scene_{k:04d}") for k in range(scenes)]
    many = Campaign(campaign.path, dataclasses.replace(campaign.document, scenes=tuple(entries)))
    counts, rows_of_three = np.resize(each, scenes), Campaign.rows

    def rows(self: Campaign, names=None) -> StoredRows:
        once = rows_of_three(campaign, names).table
        tables = [once] * (scenes // 3) + [once.slice(0, int(each[: scenes % 3].sum()))]
        return StoredRows(pyarrow.concat_tables(tables).combine_chunks(), counts)

    monkeypatch.setattr(Campaign, "rows", rows)
    monkeypatch.setattr(Campaign, "complete", True)
    begun = time.process_time()
    text = campaign_page(many)
    assert time.process_time() - begun < 5.0
    assert len(text.encode()) < 2_000_000
    root = read_page(text)
    section = part(root, "Outcomes by scene")
    shown, listed = section.find("tbody")
    assert len(shown.find("tr")) == 20 and len(listed.find("tr")) == scenes
    assert "screen" in section.find("details")[0].style
    assert (
        section.find("svg", "ranked")[0].attributes["aria-label"].count("1000 scenes: from 50.0 %")
    )


def test_nothing_judged_and_shares_are_said(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = Campaign.rows
    monkeypatch.setattr(
        Campaign,
        "rows",
        lambda self, names=None: StoredRows(
            rows(self, names).table.slice(0, 0), np.zeros(3, dtype=int)
        ),
    )
    document = dataclasses.replace(campaign.document, shard="1/1")
    empty = Campaign(campaign.path, document)
    links = tuple(f"scenes/{n}/report.html" for n in campaign.names)
    root = read_page(campaign_page(empty), links)
    assert root.find("p", "lead")[0].text == "No grasp is judged yet."
    assert "This is shard 1 of 1" in root.find("p", "notice")[0].text


def test_the_report_is_written_where_it_belongs(campaign: Campaign) -> None:
    campaign.report_path.unlink()
    write_campaign_report(campaign)
    assert campaign.report_path == campaign.path / "report.html"
    assert campaign.report_path.read_text(encoding="utf-8") == campaign_page(campaign)


def test_scenes_without_trials_come_first_and_have_no_dot() -> None:
    def group(name: str, lifted: int, slipped: int, clear: int) -> OutcomeCounts:
        counts = {Outcome.LIFTED: lifted, Outcome.SLIPPED: slipped, Outcome.COLLISION_TABLE: clear}
        decided: Counter = Counter({"executed": lifted + slipped, "clear": clear})
        return OutcomeCounts(name, sum(counts.values()), Counter(counts), decided, Counter())

    groups = [group("good", 9, 1, 0), group("none", 0, 0, 7), group("bad", 1, 9, 3)]
    ranked = worst_first(groups)
    assert [g.name for g in ranked] == ["none", "bad", "good"]
    shares = [RankedShare(g.name, g.lifted, g.executed, g.interval) for g in ranked]
    chart = read_page(ranked_chart(shares))
    tips = [title.text for title in chart.find("title")]
    assert tips == ["bad: 1 of 10, 10.0 %", "good: 9 of 10, 90.0 %"]


def test_intervals_of_clusters_are_those_of_a_regression() -> None:
    """Of ones and zeros on a constant, with errors that are alike within clusters."""
    linear_model = pytest.importorskip("statsmodels.regression.linear_model")
    rng = np.random.default_rng(0)
    trials = rng.integers(5, 40, 30)
    lifted = rng.binomial(trials, rng.beta(3, 1, 30))
    pairs = zip(lifted, trials, strict=True)
    y = np.concatenate([np.r_[np.ones(k), np.zeros(n - k)] for k, n in pairs])
    fit = linear_model.OLS(y, np.ones_like(y)).fit(
        cov_type="cluster", cov_kwds={"groups": np.repeat(np.arange(30), trials)}, use_t=True
    )
    np.testing.assert_allclose(clustered_interval(lifted, trials), fit.conf_int()[0], rtol=1e-9)
    assert clustered_interval([5, 5], [10, 10]) == wilson_interval(10, 20)
    assert clustered_interval([3], [4]) == wilson_interval(3, 4)
    assert clustered_interval([0, 0], [0, 0]) == (0.0, 1.0)
