"""Pictures of what commands serve to a browser, taken in a Chromium without a display."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

COLORS = 256
COMMAND = "import sys; from burg_drake.apps.cli import main; sys.exit(main())"
PATIENCE = 60.0
"""For anything that the page has to do [s]."""


@contextlib.contextmanager
def served(words: list[str], size: tuple[int, int]) -> Iterator[Any]:
    """The page that a command serves, open in a browser.

    Args:
        words: the command without its name.
        size: of the window [pixels].
    """
    program = [sys.executable, "-u", "-c", COMMAND, *words]
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            lines = (re.search(r"http://\S+", line) for line in process.stdout)
            address = next(found[0] for found in lines if found)
            with (
                sync_playwright() as playwright,
                playwright.chromium.launch(
                    executable_path=browser_path, args=["--no-sandbox", "--hide-scrollbars"]
                ) as browser,
            ):
                tab = browser.new_page(viewport={"width": size[0], "height": size[1]})
                tab.set_default_timeout(1e3 * PATIENCE)
                tab.goto(address)
                yield tab
        finally:
            process.terminate()


def photograph(tab: Any, path: Path) -> None:
    """Takes a picture of a page."""
    image = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
    few = image.quantize(COLORS, kmeans=16, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def overlay_page(photo: Path, intrinsics: Path, path: Path) -> None:
    """The page of `burg-drake ar` after a placement check."""
    words = f"ar tabletop_six --camera {photo} --intrinsics {intrinsics} -o {photo.parent}"
    with served(words.split(), (1180, 760)) as tab:
        tab.locator("#check").click()
        tab.locator("#checked:not(:empty)").wait_for()
        tab.wait_for_timeout(2000)
        photograph(tab, path)


def lab_page(trials: Path, path: Path) -> None:
    """The page of `burg-drake trials serve` at a trial."""
    words = f"trials serve {trials} --camera sim:panda_tabletop/board"
    with served(words.split(), (1180, 840)) as tab:
        tab.locator("#outcomes button").first.wait_for()
        tab.wait_for_timeout(2000)
        tab.locator("#operator").fill("Ada")
        tab.locator("#making").wait_for(state="hidden")
        tab.wait_for_timeout(5000)
        photograph(tab, path)
