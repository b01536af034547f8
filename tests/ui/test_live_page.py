"""The page of the live view in a real browser: what it says of what is not certain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from burg_drake.apps import ViewServer
from burg_drake.cameras import (
    CheckedImage,
    CheckedScene,
    EventLog,
    FrameProcessor,
    LiveSession,
    Placement,
    PlacementCheck,
    ViewActions,
)
from burg_drake.core import Pose
from burg_drake.scene import load_scene
from tests.apps.ar_views import photo
from tests.cameras.live_views import CAMERA, Pictures
from tests.hang_guard import HANG_GUARD


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ViewServer]:
    """Of one photograph."""
    live = LiveSession(FrameProcessor("tabletop_six", CAMERA), Pictures(photo()), events=EventLog())
    server = ViewServer(live, ViewActions(live, tmp_path), port=0)
    live.start()
    server.start()
    yield server
    live.close()
    server.close()


def test_a_doubtful_object_looks_doubtful(page: Page, server: ViewServer) -> None:
    assert server.live.next_picture(0, HANG_GUARD) is not None
    sure = Placement(
        object="mug",
        status="measured",
        target=Pose(),
        displacement=(3e-4, 4e-4),
        displacement_sd=(3e-5, 4e-5),
    )
    doubtful = replace(sure, status="uncertain", reason="two poses fit equally well")
    server.live.placement = PlacementCheck(
        scene=CheckedScene(name="tabletop_six", content=load_scene("tabletop_six").content),
        method="silhouette",
        image=CheckedImage(content=""),
        intrinsics=CAMERA,
        taken="2026-01-02T03:04:05+00:00",
        instances={"mug": sure, "bowl": doubtful},
    )
    page.goto(server.url)
    expect(page.locator("#checked")).to_contain_text("1 of 2 objects measured, 1 uncertain by silh")
    mug, bowl = (page.locator("#objects tr", has_text=name) for name in ("mug", "bowl"))
    expect(mug).to_contain_text("✓ 0.50± 0.05")
    expect(bowl).to_contain_text("? 0.50± 0.05")
    expect(bowl).to_contain_text("two poses fit equally well")
    colors = [
        row.locator(".number").first.evaluate("cell => getComputedStyle(cell).color")
        for row in (mug, bowl)
    ]
    assert colors[0] != colors[1]


def test_a_photograph_cannot_be_recorded_and_the_page_says_why(
    page: Page, server: ViewServer
) -> None:
    page.goto(server.url)
    record = page.locator("#record")
    expect(record).to_be_disabled()
    expect(record).to_have_attribute(
        "title", "The source has ended; a snapshot (S) saves this picture"
    )
    page.keyboard.press("r")
    expect(page.locator("#events .bad")).to_have_text(
        "pictures has no more frames to record; take a snapshot to keep the picture that is shown"
    )
