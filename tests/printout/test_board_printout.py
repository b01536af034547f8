"""Printed boards: rasterised by PDFium, detected by OpenCV, measured."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.printout import (
    OUTLINE_RESOLUTION,
    Printout,
    PrintSettings,
    object_drawings,
    print_board,
)
from burg_drake.scene import (
    Board,
    Instance,
    MarkerLayout,
    Markers,
    Scene,
    load_scene,
    marker_dictionary,
)
from tests.printout.paper import rasterised, words
from tests.thorough import thorough

BURG = Board(markers=Markers(dictionary="4X4_250", side=0.057, spacing=0.019, count=(7, 5)))


@pytest.fixture(scope="module", autouse=True)
def _coarse_outlines() -> Iterator[None]:
    """Outlines of objects along pixels of 0.4 mm, which are traced in a tenth of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(object_drawings, "OUTLINE_RESOLUTION", 4 * OUTLINE_RESOLUTION)
        yield


@functools.cache
def printed(scene: str, page: str) -> Printout:
    """A scene on a page; `burg` is on a board of BURG-Toolkit."""
    return print_board(loaded(scene), PrintSettings(page=page))


@functools.cache
def loaded(scene: str) -> Scene:
    if scene == "burg":
        return changed(load_scene("tabletop_six"), board=BURG)
    return load_scene(scene)


def changed(scene: Scene, **changes: object) -> Scene:
    """The scene with another document."""
    document = dataclasses.replace(scene.document, **changes)
    return Scene(document, scene.library, scene.path)


def detect(image: np.ndarray, layout: MarkerLayout) -> dict[int, np.ndarray]:
    """Corners (4, 2) [px] by id; pixel centres at whole numbers."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(marker_dictionary(layout.dictionary), parameters)
    corners, ids, _ = detector.detectMarkers(image)
    pairs = zip(ids.reshape(-1).tolist(), corners, strict=True)
    return {i: c.reshape(4, 2).astype(float) for i, c in pairs if i in layout.ids}


def measured_corners(image: np.ndarray, layout: MarkerLayout, dpi: int) -> dict[int, np.ndarray]:
    """Corners (4, 2) [m] from the page's lower left corner."""
    up = image.shape[0] - 0.5
    return {
        i: np.column_stack([uv[:, 0] + 0.5, up - uv[:, 1]]) * 0.0254 / dpi
        for i, uv in detect(image, layout).items()
    }


@pytest.mark.parametrize(
    ("scene", "page", "dpi", "tolerance"),
    [
        thorough("tabletop_twelve", "A4", 200, 1.5e-4),
        ("tabletop_six", "letter", 150, 2e-4),
        thorough("burg", "A3", 150, 2e-4),
    ],
)
def test_every_marker_of_every_page(scene: str, page: str, dpi: int, tolerance: float) -> None:
    """Each marker is on one page, is found, is where it belongs and as long as it should be; so
    pages that are laid over each other by their alignment marks make the board."""
    printout, layout = printed(scene, page), loaded(scene).board.layout
    seen: list[int] = []
    images = rasterised(printout.pdf, dpi)
    assert len(images) == len(printout.tiling.tiles)
    for number, image in enumerate(images, start=1):
        for i, p_PQ in measured_corners(image, layout, dpi).items():
            seen.append(i)
            expected = printout.p_PQ(number, layout.p_SQ[layout.ids == i][0])
            assert np.linalg.norm(p_PQ - expected, axis=1).max() < tolerance
            sides = np.linalg.norm(p_PQ - np.roll(p_PQ, 1, axis=0), axis=1)
            assert np.abs(sides - layout.side).max() < tolerance / 2
    assert sorted(seen) == layout.ids.tolist()


@pytest.mark.thorough
def test_a_printer_that_scales() -> None:
    """What is drawn larger by 100/98 along x and 100/99 along y has its true size when the printer
    makes it smaller by as much; rulers, too."""
    scene, dpi = load_scene("tabletop_six"), 300
    settings = PrintSettings(page="A3", measured=(0.098, 0.099))
    printout, shrink = print_board(scene, settings), np.array([0.98, 0.99])
    (image,) = rasterised(printout.pdf, dpi, only=[1])
    found = measured_corners(image, scene.board.layout, dpi)
    assert len(found) >= 12
    for p_PQ in found.values():
        sides = np.linalg.norm((p_PQ - np.roll(p_PQ, 1, axis=0)) * shrink, axis=1)
        assert np.abs(sides - 0.045).max() < 5e-5
    dark = image < 140
    lower = dark[int(0.93 * len(dark)) :]  # the ruler along x; the one along y stands above
    row = max(lower, key=longest_run)
    column = max(dark[:, : dpi // 2].T, key=longest_run)
    for line, factor in ((row, 0.98), (column, 0.99)):
        assert abs(longest_run(line) / dpi * 0.0254 * factor - 0.1) < 3e-4


def longest_run(line: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def test_height_map_on_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under the mug's body the paper is darker than under its handle, and white beside both; white
    cells stay far brighter than black ones everywhere. Outlines are as fine as for users."""
    monkeypatch.setattr(object_drawings, "OUTLINE_RESOLUTION", OUTLINE_RESOLUTION)
    scene, dpi = load_scene("tabletop_six"), 100
    printout = print_board(scene, PrintSettings(page="A1", names=False))
    (image,) = rasterised(printout.pdf, dpi)
    X_SO = scene.X_SO("mug")

    def grey(x: float, y: float, z: float = 0.0) -> int:
        u, v = printout.p_PQ(1, (X_SO @ [x, y, z, 1.0])[:3]) / 0.0254 * dpi
        return int(image[image.shape[0] - round(v), round(u)])

    surface = scene.library.surface("mug").vertices
    tip = surface[np.argmax(np.linalg.norm(surface[:, :2], axis=1))][:2]
    along = tip / np.linalg.norm(tip)
    gaps = [s for s in np.linspace(0.0, 1.0, 200) if grey(*(s * tip)) not in (0, 255)]
    body = [grey(*(s * tip)) for s in gaps if s * np.linalg.norm(tip) < 0.035]
    handle = [grey(*(s * tip)) for s in gaps if s * np.linalg.norm(tip) > 0.05]
    assert np.median(body) + 15 < np.median(handle) < 250
    assert grey(*(1.2 * np.linalg.norm(tip) * along)) in (0, 255)
    for corners, black in zip(scene.board.layout.p_SQ, scene.board.layout.black, strict=True):
        cells = scene.board.layout.cells
        step = scene.board.layout.side / cells
        for (r, c), is_black in np.ndenumerate(black):
            p = corners[0] + [(c + 0.5) * step, -(r + 0.5) * step, 0.0]
            u, v = printout.p_PQ(1, p) / 0.0254 * dpi
            value = np.median(
                image[
                    image.shape[0] - round(v) - 3 : image.shape[0] - round(v) + 4,
                    round(u) - 3 : round(u) + 4,
                ]
            )
            assert value < 30 if is_black else value > 165


def test_words_on_every_page() -> None:
    scene = load_scene("tabletop_twelve")
    printout = printed("tabletop_twelve", "A4")
    texts = words(printout.pdf)
    for k, text in enumerate(texts, start=1):
        assert f"page {k} of {len(texts)}" in text and "tabletop_twelve" in text
        assert "Print at 100 %, not fitted to the page: both rulers must measure 100 mm" in text
        assert (
            "ARUCO_MIP_36h12, ids 0 to 53, 45 mm with gaps of 15 mm." in text
            and f"594 x 420 mm, content {scene.content[:8]}" in text
        )
        assert "2 Cut along the lines that say CUT. 3 Glue each page onto the strips" in text
        assert "height above the sheet" in text
        assert ("CUT" in text.replace("say CUT", "")) == (k > 1)
    said = " ".join(texts).replace(scene.name, "")
    for name in scene.instances:
        assert re.search(rf"(?<!\w){name}(?!\w)", said)
    assert printout.warnings == ()
    bare = words(print_board(loaded("tabletop_six"), PrintSettings(names=False)).pdf)
    assert not re.search(r"\bmug\b", " ".join(bare))


def small(scene: Scene, size: tuple[float, float], **markers: object) -> Scene:
    return changed(scene, board=Board(size=size, markers=Markers(**markers)))


@pytest.mark.parametrize("page", ["A4", "A3", "letter"])
def test_ruler_its_labels_and_the_lines_at_the_foot_are_apart(page: str) -> None:
    """Below the board there are four rows of ink, with white between them."""
    printout = print_board(loaded("tabletop_six"), PrintSettings(page=page, height_map=False))
    paper, per_metre = printout.tiling.paper, 300 / 0.0254
    (image,) = rasterised(printout.pdf, 300, only=[1])
    left, right = (round(per_metre * (paper.lower[0] + x)) for x in (-1e-3, 0.101))
    foot = image[image.shape[0] - round(per_metre * (paper.lower[1] - 1e-3)) :, left:right]
    ink = np.flatnonzero((foot < 200).any(axis=1))
    gaps = np.diff(ink)[np.diff(ink) > 1] / per_metre
    assert len(gaps) == 3 and gaps[1] > 0.6e-3 and gaps.min() > 0.3e-3


def test_the_edge_is_told_and_the_origin_marked_where_they_are_on_paper() -> None:
    scene = small(load_scene("tabletop_six"), (0.297, 0.21), side=0.04)
    whole = print_board(scene, PrintSettings(page="A3", height_map=False))
    (text,) = words(whole.pdf)
    assert text.count("edge of the board") == 4 and "origin" in text.split("The board's")[0]
    (image,) = rasterised(whole.pdf, 300)

    def dark(x: float, y: float) -> bool:
        u, v = whole.p_PQ(1, np.array([x, y])) / 0.0254 * 300
        return bool(image[image.shape[0] - round(v), round(u)] < 120)

    assert dark(0.005, 0.0) and dark(0.0, 0.005)  # the axes start at (0, 0) of the scene
    assert not dark(0.005, 0.0012) and not dark(0.0012, 0.005) and not dark(-0.003, 0.0)
    same = print_board(scene, PrintSettings(page="A4", height_map=False))
    (text,) = words(same.pdf)
    assert "edge of the board" not in text and "lies" in text
    for page in ("A3", "A4"):
        printout = print_board(scene, PrintSettings(page=page, height_map=False))
        (image,) = rasterised(printout.pdf, 150)
        assert len(detect(image, scene.board.layout)) == len(scene.board.layout.ids)


def test_nothing_strays_beyond_what_a_page_shows() -> None:
    """Around the part of the board, but for cut lines and words, a page is white."""
    printout = printed("tabletop_six", "A4")
    dpi = 130
    (image,) = rasterised(printout.pdf, dpi, only=[5])
    tile = printout.tiling.tiles[4]
    low, high = (printout.p_PQ(5, np.array(p)) / 0.0254 * dpi for p in (tile.lower, tile.upper))
    rows = slice(image.shape[0] - int(high[1]) + 100, image.shape[0] - int(low[1]) - 100)
    edge = image[rows, round(high[0]) - 2 : round(high[0]) + 12]
    assert edge.min() > 250


def test_a_board_that_only_margins_spread_over_pages() -> None:
    """It fits on the page, less than the strips of rulers and words."""
    scene = small(load_scene("tabletop_six"), (0.297, 0.21), side=0.06, spacing=0.005)
    bare = PrintSettings(height_map=False)
    printout = print_board(scene, bare)
    assert len(printout.tiling.tiles) > 1
    (said,) = printout.warnings
    assert said.startswith("the board is no larger than the page, but takes 2 pages because of")
    margin, page = re.findall(r"a margin of (\S+) mm or page (\S+) would fit", said)[0]
    for changes in ({"margin": float(margin) * 1e-3}, {"page": page}):
        again = print_board(scene, dataclasses.replace(bare, **changes))
        assert len(again.tiling.tiles) == 1
        assert ["printer with a margin of 4.2 mm" in w for w in again.warnings] == [True] * (
            "margin" in changes
        )
    larger = print_board(changed(scene, board=Board()), bare)
    assert len(larger.tiling.tiles) > 1 and larger.warnings == ()


def test_the_same_bytes_and_no_scaling_by_the_viewer() -> None:
    scene = load_scene("tabletop_six")
    first = printed("tabletop_six", "letter").pdf
    second = print_board(scene, PrintSettings(page="letter")).pdf
    assert first == second
    assert first.startswith(b"%PDF-") and b"/PrintScaling /None" in first
    assert b"Board of tabletop_six" in first
    assert print_board(scene, PrintSettings(height_map=False)).pdf != first


def test_what_is_beyond_the_board() -> None:
    scene = load_scene("tabletop_six")
    away = Instance(name="stray", object="can", X_SO=Pose((3.0, 0.1, 0.0)))
    over = Instance(name="over", object="bowl", X_SO=Pose((0.3, 0.41, 0.0)))
    shelf = Instance(name="shelf", object="box", X_SO=Pose((-0.02, 0.2, 0.0)))
    fixed = changed(scene, instances=(away, over), background=(shelf,))
    printout = print_board(fixed, PrintSettings(page="A2"))
    stray, bowl, rest = printout.warnings
    assert "'stray' is off the board: 2.44 m over the right edge" in stray
    assert "'over' is off the board: 70.0 mm over the upper edge" in bowl
    assert "of 'shelf' lie in the margin of the page; larger pages have room" in rest
    (text,) = words(printout.pdf)
    for said in ("stray: 2.44 m beyond the edge", "over: 70 mm beyond the edge", "shelf (fixed)"):
        assert said in text
    (image,) = rasterised(printout.pdf, 150, grey=False)
    assert len(detect(image, fixed.board.layout)) == 54
    # The arrow to the bowl, in the only red of the sheet, points up at the place it names.
    u, v = printout.p_PQ(1, np.array([0.3, 0.42 - 0.0235])) / 0.0254 * 150
    blue, green, red = image[image.shape[0] - round(v), round(u)].astype(int)
    assert red > 150 and green < 60 and blue < 60


def test_what_stands_wholly_on_another() -> None:
    """A can over a bowl has its name, and an outline: a circle across the bowl's tints."""
    scene, at, height = load_scene("tabletop_twelve"), (0.3, 0.21), 0.1
    below = Instance(name="below", object="bowl", X_SO=Pose((*at, 0.0)))
    above = Instance(name="above", object="can", X_SO=Pose((*at, height)))
    dpi, images = 200, {}
    for instances in ((below,), (below, above)):
        printout = print_board(changed(scene, instances=instances), PrintSettings(page="A2"))
        (image,) = rasterised(printout.pdf, dpi)
        images[len(instances)] = image.astype(int)
    (text,) = words(printout.pdf)
    assert f"above (on below, {1e3 * height:.0f} mm up)" in text
    rows, columns = np.nonzero(np.abs(images[2] - images[1]) > 20)
    u, v = printout.p_PQ(1, np.array(at)) / 0.0254 * dpi
    distance = np.hypot(columns - u, image.shape[0] - rows - v) * 0.0254 / dpi
    radius = scene.entry("can").upper[0]
    drawn = np.abs(distance - radius) < 1.5e-3
    assert drawn.sum() > 100
    angle = np.arctan2(image.shape[0] - rows - v, columns - u)[drawn]
    assert len(np.unique(np.round(angle / 0.2))) > 20  # all around


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"measured": (0.0985, 9.85)},
            "the measured length of the 100 mm ruler is 9850 mm; it must be 80 to 125",
        ),
        ({"margin": 0.2}, "margin is 200 mm; it must be 0 to 50 mm"),
        ({"margin": float("nan")}, "margin is nan mm"),
    ],
)
def test_settings_that_cannot_be(settings: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        PrintSettings(**settings)


def test_markers_at_the_edge_lack_white_around_them() -> None:
    tiny = changed(
        loaded("tabletop_six"),
        instances=(),
        board=Board(size=(0.1, 0.1), markers=Markers(side=0.1, count=(1, 1))),
    )
    assert print_board(tiny).warnings == (
        "markers are 0.0 mm from the edge of the board, but detectors need a white border of"
        " 10.0 mm around them; give a larger board or smaller markers",
    )
    larger = changed(tiny, board=Board(size=(0.12, 0.12), markers=tiny.board.markers))
    assert not print_board(larger).warnings
