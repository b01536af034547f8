"""The leaderboard page in a browser: sorted by clicks, with every outcome, readable by everyone."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.benchmark import (
    LeaderboardExtras,
    compare_methods,
    failed_grasps,
    write_leaderboard,
)
from tests.benchmark.judged import COLLIDES, LIFTED, SLIPPED, judged, result

sync_api = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")
pytestmark = pytest.mark.thorough

WCAG = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]}
"""What the Web Content Accessibility Guidelines 2.1 demand at level AA."""
LIFTS = {"good": 12, "fair": 11, "poor": 3}
"""Scenes of 13 in which the best grasp of each method lifts its object. In the last scene they
have an error, no grasp, and no verdict."""
PICTURE = b"\xff\xd8\xff\xd9"


@pytest.fixture(scope="module")
def leaderboard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of three methods, on which the first failure of each is replayed."""
    last = {
        "good": judged("s12", [], error="TypeError: no colour image"),
        "fair": judged("s12", []),
        "poor": judged("s12", [None]),
    }
    results = []
    for name, lifted in LIFTS.items():
        verdicts = [LIFTED if k < lifted else COLLIDES if k == 11 else SLIPPED for k in range(12)]
        answers = [judged(f"s{k}", [verdict]) for k, verdict in enumerate(verdicts)]
        results.append(result([*answers, last[name]], name, grasps=1))
    comparison = compare_methods(results)
    folder = tmp_path_factory.mktemp("leaderboard")
    extras = LeaderboardExtras(
        replays={key: folder / "replay.html" for key in failed_grasps([comparison], 1)},
        pictures={("0" * 16, f"s{k}"): PICTURE for k in range(13)},
    )
    return write_leaderboard([comparison], folder / "page.html", extras=extras)


def section(page: sync_api.Page, title: str) -> sync_api.Locator:
    return page.locator("section", has=page.get_by_role("heading", name=title))


def column(rows: sync_api.Locator, number: int) -> list[str]:
    return [row.locator("> *").nth(number).inner_text() for row in rows.all()]


def test_columns_are_sorted_by_their_numbers(page: sync_api.Page, leaderboard: Path) -> None:
    page.goto(leaderboard.as_uri())
    differences = section(page, "Differences")
    rows = differences.locator("tbody tr")
    heads = differences.locator("thead button")
    for sign in (-1.0, 1.0):
        heads.nth(2).click()
        values = [float(text.split()[0]) for text in column(rows, 2)]
        assert len(set(map(len, column(rows, 2)))) > 1  # the order of the texts is another one
        assert values == sorted(values, key=lambda value: sign * value)
    heads.first.click()
    assert column(rows, 0) == sorted(column(rows, 0), reverse=True)


def test_cells_tell_what_became_of_the_best_grasp(page: sync_api.Page, leaderboard: Path) -> None:
    page.goto(leaderboard.as_uri())
    scenes = section(page, "The best grasp in each scene")
    last = scenes.locator("tbody tr").last.locator("td")
    assert last.all_inner_texts() == ["no answer", "no grasp", "not judged"]
    scenes.get_by_text("no answer").click()
    assert scenes.get_by_text("TypeError: no colour image").is_visible()
    assert scenes.locator("small").first.inner_text().startswith("mug-")
    assert scenes.locator("img").count() == 13
    assert scenes.get_by_role("link", name="replay").count() == 2  # of `good` none failed


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_page_is_accessible(
    leaderboard: Path, browser: sync_api.Browser, width: int, scheme: str
) -> None:
    with browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme) as page:
        page.goto(leaderboard.as_uri())
        found = axe.Axe().run(page, options=WCAG).response["violations"]
        assert [(one["id"], one["nodes"][0]["html"]) for one in found] == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
