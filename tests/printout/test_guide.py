"""The first page of a printout, as PDFium sees it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator

import pypdfium2
import pypdfium2.raw as pdfium
import pytest

from burg_drake.printout import (
    OUTLINE_RESOLUTION,
    Printout,
    PrintSettings,
    object_drawings,
    print_board,
)
from burg_drake.scene import Board, Markers, Scene, load_scene
from tests.printout.paper import rasterised, words
from tests.thorough import thorough

CAPITALS = 0.718
"""Height of Helvetica's capitals as a share of its size (Adobe's font metrics)."""


@pytest.fixture(scope="module", autouse=True)
def _coarse_outlines() -> Iterator[None]:
    """Outlines of objects along pixels of 0.4 mm, which are traced in a tenth of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(object_drawings, "OUTLINE_RESOLUTION", 4 * OUTLINE_RESOLUTION)
        yield


def with_guide(scene: Scene | str, **settings: object) -> Printout:
    return print_board(scene, PrintSettings(instructions=True, **settings))  # type: ignore[arg-type]


def on_board(**board: object) -> Scene:
    scene = load_scene("tabletop_six")
    document = dataclasses.replace(scene.document, board=Board(**board), instances=())  # type: ignore[arg-type]
    return Scene(document, scene.library, scene.path)


def capitals(pdf: bytes, page: int) -> list[float]:
    """Heights of the capitals of a page [points]."""
    with pypdfium2.PdfDocument(pdf) as document:
        text = document[page].get_textpage()
        boxes = [
            text.get_charbox(k)
            for k in range(text.count_chars())
            if chr(pdfium.FPDFText_GetUnicode(text, k)) in "ABDEFHIKLMNPRT"
        ]
    return [top - bottom for _, bottom, _, top in boxes]


@pytest.mark.parametrize("page", ["A4", thorough("letter"), thorough("A3"), "A2"])
def test_one_page_tells_it_all_in_letters_that_people_read(page: str) -> None:
    printout = with_guide("tabletop_six", page=page)
    texts = words(printout.pdf)
    pages = len(printout.tiling.tiles)
    assert printout.first == 1 and len(texts) == 1 + pages
    headings = ["Print", "Measure", "Keep it flat", "Light", "Camera", "Place the objects"]
    if pages > 1:
        headings[2:2] = ["Plan of pages", "Cut", "Glue"]
    at = [texts[0].index(f"{k} {heading}") for k, heading in enumerate(headings, start=1)]
    assert at == sorted(at)
    assert "0.5 to 1.0 m" in texts[0] and "100 mm" in texts[0] and "100 %" in texts[0]
    assert ("Plan" in texts[0]) == (pages > 1)
    assert min(capitals(printout.pdf, 0)) > 10.0 * CAPITALS * 0.97


def test_the_board_s_own_pages_stay_as_they_are() -> None:
    """Instructions change neither where things are nor the size of pages."""
    plain, told = print_board("tabletop_six"), with_guide("tabletop_six")
    assert plain.first == 0 and plain.tiling.tiles == told.tiling.tiles
    with pypdfium2.PdfDocument(plain.pdf) as before, pypdfium2.PdfDocument(told.pdf) as after:
        assert {page.get_size() for page in after} == {page.get_size() for page in before}
    (page,) = rasterised(plain.pdf, 60, only=[5])
    (same,) = rasterised(told.pdf, 60, only=[6])
    foot = round(0.022 / 0.0254 * 60)  # where words about printing are
    assert (page[:-foot] == same[:-foot]).all()


def test_words_go_on_on_another_page_where_one_is_too_small() -> None:
    printout = with_guide("tabletop_six", page="180x140")
    texts = words(printout.pdf)
    assert printout.first > 1 and len(texts) == printout.first + len(printout.tiling.tiles)
    steps = [k for text in texts[: printout.first] for k in re.findall(r"(\d) [A-Z]", text)]
    assert [int(k) for k in steps if int(k)] == list(range(1, 10))
    assert min(capitals(printout.pdf, 0)) > 10.0 * CAPITALS * 0.97


def test_what_a_printer_cuts_off_is_told_with_its_page() -> None:
    """Markers that reach into the rim of 4.2 mm on a page with a margin of 2 mm."""
    scene = on_board(size=(0.21, 0.297), markers=Markers(side=0.05, spacing=0.02, count=(2, 2)))
    assert with_guide(scene).warnings == ()
    wide = on_board(size=(0.2, 0.297), markers=Markers(side=0.131, spacing=0.016, count=(1, 2)))
    printout = with_guide(wide, margin=2e-3, height_map=False)
    (said,) = [w for w in printout.warnings if "printer" in w]
    number, lost = re.findall(
        r"page (\d): a printer with a margin of 4.2 mm, as most .* cuts off (\S+) mm of markers",
        said,
    )[0]
    top = printout.p_PQ(int(number), wide.board.layout.p_SQ.max(axis=(0, 1)))[1]
    assert abs(float(lost) - 1e3 * (top - (0.297 - 4.23e-3))) < 0.06
    assert said.replace("page", "Page", 1) in words(printout.pdf)[0]


def test_an_object_has_its_name_on_every_page_that_shows_it() -> None:
    """The screwdriver of `tabletop_six` lies across a cut between two pages of A4."""
    printout = print_board("tabletop_six", PrintSettings(page="letter"))
    scene = load_scene("tabletop_six")
    texts = words(printout.pdf)
    for name in scene.instances:
        points = scene.library.surface(scene.instance(name).object).vertices
        X_SO = scene.X_SO(name)
        p_SV = points @ X_SO[:3, :3].T + X_SO[:3, 3]
        for tile, text in zip(printout.tiling.tiles, texts, strict=True):
            (left, bottom), (right, top) = tile.visible_corners
            inset = 8e-3
            inside = (p_SV[:, 0] > left + inset) & (p_SV[:, 0] < right - inset)
            inside &= (p_SV[:, 1] > bottom + inset) & (p_SV[:, 1] < top - inset)
            if inside.sum() > 30:
                told = re.search(rf"(?<!\w){name}(?!\w)", text)
                assert told or f"there is no room to print '{name}' on page {tile.number}" in (
                    printout.warnings
                )
