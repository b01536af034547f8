"""The protocol has every trial once, hides simulated outcomes, and escapes all texts."""

from __future__ import annotations

import copy
import html
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from burg_drake.core import Outcome, RealOutcome, make_pose
from burg_drake.experiment import (
    MAIN_OUTCOMES,
    ProtocolOptions,
    RealTrial,
    RobotReport,
    TrialPictures,
    TriedRuns,
    approach_text,
    closing_text,
    protocol_page,
)

VOID = {"meta", "br", "img"}
SMALL = (260, 195)
NOTE = "<script>alert('1')</script> & \"co\""


class Pages(HTMLParser):
    """Checks that elements nest; collects articles and addresses."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.cards: dict[str, str] = {}
        self._card = ""
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "article":
            self._card = str(named["id"])
            assert self._card not in self.cards
            self.cards[self._card] = ""
        self.links += [str(v) for k, v in attrs if k in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        if tag == "article":
            self._card = ""

    def handle_data(self, data: str) -> None:
        if self._card:
            self.cards[self._card] += f" {data}"


class CachedPictures:
    """Makes each picture once for all pages of a test."""

    def __init__(self, pictures: TrialPictures) -> None:
        self._pictures, self._made = pictures, dict[str, bytes]()

    def grasp(self, trial: RealTrial) -> bytes:
        if trial.grasp not in self._made:
            self._made[trial.grasp] = self._pictures.grasp(trial, SMALL)
        return self._made[trial.grasp]

    def setup(self, trial: RealTrial) -> tuple[bytes, bytes]:
        return b"above", b"front"


def with_trials(runs: TriedRuns, change: object) -> TriedRuns:
    """The same runs with other trials."""
    other = copy.copy(runs)
    other.sheet = replace(runs.sheet, trials=tuple(map(change, runs.sheet.trials)))  # type: ignore
    return other


@pytest.fixture(scope="module")
def once(pictures: TrialPictures) -> TrialPictures:
    return CachedPictures(pictures)  # type: ignore[return-value]


def test_every_trial_is_there_once(runs: TriedRuns, once: TrialPictures) -> None:
    page = protocol_page(runs, once)
    pages = Pages(page)
    assert list(pages.cards) == [f"trial-{t.number}" for t in runs.sheet.trials]
    assert all(link.startswith("data:image/jpeg;base64,") for link in pages.links)
    assert not re.search(r"https?://|<script|@import|url\(", page)
    for trial in runs.sheet.trials:
        card = pages.cards[f"trial-{trial.number}"]
        assert trial.instance in card and trial.grasp in card and "40 mm" in card
        assert all(label in card for label, _ in MAIN_OUTCOMES.values()) and "✕" not in card
    assert len(page) < 60_000 * len(runs.sheet.trials) + 50_000
    assert page.count('class="block"') == 2 and "Block 2: two, trials 5 to 7" in page


def test_the_operator_cannot_know_what_was_simulated(runs: TriedRuns, once: TrialPictures) -> None:
    def other(trial: RealTrial) -> RealTrial:
        return replace(trial, simulated=Outcome.DROPPED, stratum=trial.stratum)

    changed = with_trials(runs, other)
    assert protocol_page(changed, once) == protocol_page(runs, once)
    shown = ProtocolOptions(show_simulated=True)
    assert protocol_page(changed, once, shown) != protocol_page(runs, once, shown)
    assert "simulated" not in protocol_page(runs, once)


def test_entries_are_filled_in_and_escaped(runs: TriedRuns, once: TrialPictures) -> None:
    def carried_out(trial: RealTrial) -> RealTrial:
        if trial.number == 1:
            return replace(
                trial,
                outcome=RealOutcome.SLIPPED,
                note=NOTE,
                operator="<AB>",
                time="2026-05-05T10:02:11+02:00",
                robot=RobotReport(width_mm=31.5),
            )
        return replace(trial, outcome=RealOutcome.NO_PATH) if trial.number == 2 else trial

    page = protocol_page(with_trials(runs, carried_out), once)
    cards = Pages(page).cards
    assert NOTE not in page and html.escape(NOTE) in page
    assert NOTE in cards["trial-1"] and "<AB>" in cards["trial-1"]
    assert "✕ slipped" in " ".join(cards["trial-1"].split())
    assert "31.5" in cards["trial-1"] and "2026-05-05 10:02" in cards["trial-1"]
    assert "✕ other: no path" in " ".join(cards["trial-2"].split())
    assert "✕" not in cards["trial-3"]
    assert "2 carried out so far" in page


def test_grasps_in_words() -> None:
    down = make_pose(np.diag([1.0, -1.0, -1.0]))
    assert approach_text(down) == "from straight above"
    assert closing_text(down) == "at 0° to x"
    c, s = np.cos(np.pi / 4), np.sin(np.pi / 4)
    # The hand moves down and towards +x: it comes from the left.
    leaning = make_pose(np.array([[0.0, c, s], [1.0, 0.0, 0.0], [0.0, s, -c]]))
    assert np.linalg.det(leaning[:3, :3]) == pytest.approx(1.0)
    assert approach_text(leaning) == "from above, 45° from the left"
    assert closing_text(leaning) == "at 90° to x"
    level = make_pose(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))
    assert approach_text(level) == "from the near side, level (90° from straight down)"
