"""The door, by real requests and a real browser."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from burg_drake.ui.door import Door, serve


@pytest.fixture(scope="module")
def door() -> Iterator[Door]:
    with serve(port=0) as door:
        door.server.gui.add_markdown("Nothing here yet.")
        yield door


def test_the_page_opens_in_a_browser(door: Door, page) -> None:
    page.goto(door.url)
    page.get_by_text("Nothing here yet.").wait_for()
    assert page.title() == "burg_drake"
