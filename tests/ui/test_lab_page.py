"""The page of the lab in a real browser: what is clicked is never lost."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from burg_drake.core import RealOutcome
from burg_drake.experiment import journal_path, load_trials, read_entries, save_trials
from tests.apps.test_lab_server import free_port, kill, serve_again, start
from tests.experiment.pages.conftest import made as made, trials as trials


def test_clicks_survive_the_death_of_the_server(page: Page, trials: Path) -> None:
    port = free_port()
    process = start(trials, port)
    saved, number = page.locator("#saved"), page.locator("#number")
    page.clock.install()
    page.goto(f"http://127.0.0.1:{port}/")
    expect(saved).to_have_text("All saved")
    expect(number).to_have_text("1")
    page.fill("#operator", "AB")
    page.fill("#note", "<b>wet</b> & cold")
    page.clock.fast_forward(700)  # clicks right after a trial comes up do not count
    page.fill("#width", "abc")
    page.click('[data-outcome="slipped"]')
    expect(page.locator("#widthnote")).to_contain_text("not a width in mm")
    expect(page.locator("#width")).to_have_value("abc")
    expect(number).to_have_text("1")
    page.fill("#width", "500")
    expect(page.locator("#widthnote")).to_have_text("The hand opens only 80 mm. Is 500 mm right?")
    page.click('[data-outcome="slipped"]')
    expect(number).to_have_text("2")
    expect(saved).to_have_text("All saved")
    kill(process)
    trial = load_trials(trials).trial(1)
    assert (trial.outcome, trial.note) == (RealOutcome.SLIPPED, "<b>wet</b> & cold")
    assert trial.robot is not None and trial.robot.width_mm == 500.0

    page.clock.fast_forward(700)
    page.keyboard.press("1")  # lifted, with nobody to hear it
    expect(number).to_have_text("3")
    expect(saved).to_contain_text("1 entry is kept here")
    kept = page.evaluate("() => JSON.stringify(localStorage)")
    assert [
        json.loads(v)["entry"]["outcome"] for k, v in json.loads(kept).items() if " entry " in k
    ]
    assert load_trials(trials).trial(2).outcome is None

    server = serve_again(trials, port)
    try:
        expect(saved).to_have_text("All saved")
        trial = load_trials(trials).trial(2)
        assert (trial.outcome, trial.operator) == (RealOutcome.LIFTED, "AB")
        page.click("#undo")  # the last one, which is shown then
        expect(number).to_have_text("2")
        expect(page.locator("#entered")).to_have_text("How did it end?")
        expect(saved).to_have_text("All saved")
        assert load_trials(trials).trial(2).outcome is None
        told = [(e.number, e.after.get("outcome")) for e in read_entries(journal_path(trials))]
        assert told == [(1, "slipped"), (2, "lifted"), (2, None)]
        page.locator(".chips button").first.click()
        expect(page.locator("#entered")).to_contain_text("Entered: slipped, AB")
        expect(page.locator("#note")).to_have_value("<b>wet</b> & cold")
    finally:
        server.pictures.close()
        server.close()


UNCOVERED = """buttons => buttons.filter(button => {
  const { left, right, top, bottom, width, height } = button.getBoundingClientRect();
  const seen = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight
    && width >= 44 && height >= 44 && button.contains(seen)
    && button.scrollWidth <= button.clientWidth && button.scrollHeight <= button.clientHeight;
}).length"""


def test_outcomes_are_in_view_on_small_screens(page: Page, trials: Path) -> None:
    """At once, and wherever the trial is scrolled to; nothing covers them or is cut off in them."""
    server = serve_again(trials, free_port())
    page.clock.install()
    try:
        page.goto(server.url)
        buttons = page.locator("[data-outcome]")
        expect(buttons).to_have_count(10)
        sizes = [(390, 844), (360, 640), (844, 390), (768, 1024), (1024, 600)]
        for number, (width, height) in enumerate(sizes, 1):
            page.set_viewport_size({"width": width, "height": height})
            expect(page.locator("#saved")).to_have_text("All saved")
            for place in ("#number", "#entered", "#note", "#width"):
                page.locator(place).scroll_into_view_if_needed()
                assert buttons.evaluate_all(UNCOVERED) == 10, (width, height, place)
            page.clock.fast_forward(700)  # clicks right after a trial comes up do not count
            page.locator('[data-outcome="slipped"]').click()
            expect(page.locator("#saved")).to_have_text("All saved")
            expect(page.locator("#number")).to_have_text(str(number + 1))
            assert load_trials(trials).trial(number).outcome is RealOutcome.SLIPPED
    finally:
        server.pictures.close()
        server.close()


@pytest.mark.thorough
def test_what_is_refused_for_good_can_be_dropped(page: Page, trials: Path) -> None:
    """Somebody has removed another trial from the file; then it comes back."""
    port = free_port()
    server = serve_again(trials, port)
    text, sheet = trials.read_text(), load_trials(trials)
    troubles = page.locator("#troubles")
    page.clock.install()
    try:
        page.goto(f"http://127.0.0.1:{port}/")
        expect(page.locator("#number")).to_have_text("1")
        save_trials(replace(sheet, trials=sheet.trials[:-1]), trials)
        page.clock.fast_forward(700)
        page.click('[data-outcome="slipped"]')
        expect(page.locator("#saved")).to_contain_text("now holds other trials")
        expect(troubles).to_be_hidden()  # it may pass
        page.clock.fast_forward(10_000)
        expect(troubles).to_contain_text("Trial 1, slipped, cannot be saved yet: ")
        expect(troubles).to_contain_text("start the page again. It is sent again until")
        troubles.get_by_role("button", name="Discard").click()
        expect(troubles).to_be_hidden()
        trials.write_text(text)
        expect(page.locator("#saved")).to_have_text("All saved")
        assert load_trials(trials).trial(1).outcome is None
        assert read_entries(journal_path(trials)) == []
    finally:
        server.pictures.close()
        server.close()
