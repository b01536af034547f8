"""Printed boards, measured: where their markers are on paper, and whether they are found.

    python benchmarks/printout.py [--dpi 300]

Prints scenes on pages, rasterises the PDF with PDFium (pypdfium2), detects the markers with OpenCV,
and compares every corner and side with the scene's layout. Beside it: what a detector finds of the
whole board in pictures of a camera: on our sheet, on one without objects, and on one that is
painted the way of BURG-Toolkit, with an opaque height map over the markers.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time

import cv2
import numpy as np
import pypdfium2
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.printout import Printout, PrintSettings, height_map, print_board
from burg_drake.scene import Board, MarkerLayout, Markers, Scene, load_scene, marker_dictionary

SCENES = ("tabletop_six", "tabletop_twelve")
PAGES = ("A4", "A3", "A2", "letter")
BURG_MARKERS = Markers(dictionary="4X4_250", side=0.057, spacing=0.019, count=(7, 5))
CAMERA_PIXELS = (0.5e-3, 0.7e-3, 1.0e-3, 1.4e-3)
"""Sides of a camera's pixels on the sheet [m]: 640 pixels over an A2 sheet are 0.93 mm."""
VIEWS = 4

Image = NDArray[np.uint8]


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dpi", type=int, default=300)
    dpi = parser.parse_args().dpi
    cv2.setNumThreads(1)
    scenes = [load_scene(name) for name in SCENES]
    boards = [("default", s) for s in scenes]
    boards += [("BURG", with_markers(s, BURG_MARKERS)) for s in scenes]
    print(
        f"{'scene':<16} {'board':<8} {'page':<7} pages  markers found, worst side and corner [mm]"
    )
    for kind, scene in boards:
        for page in PAGES:
            report_print(kind, scene, page, dpi)
    print("\nshare of all markers found in pictures, by side of a pixel on the sheet")
    print(
        f"{'scene':<16} {'board':<8} {'sheet':<14}"
        + "".join(f"{1e3 * p:>8g} mm" for p in CAMERA_PIXELS)
    )
    for kind, scene in boards:
        report_views(kind, scene)


def with_markers(scene: Scene, markers: Markers) -> Scene:
    """The scene on a board with other markers."""
    board = Board(size=scene.board.size, markers=markers)
    return Scene(dataclasses.replace(scene.document, board=board), scene.library, scene.path)


def report_print(kind: str, scene: Scene, page: str, dpi: int) -> None:
    """Prints a row about one PDF: markers found, worst errors [mm], time, size."""
    start = time.process_time()
    printout = print_board(scene, PrintSettings(page=page))
    seconds = time.process_time() - start
    layout, found = scene.board.layout, set[int]()
    side, corner = [0.0], [0.0]
    for number, image in enumerate(pages_of(printout.pdf, dpi), start=1):
        for marker, uv in detected(image, layout).items():
            p_PQ = (
                np.stack([uv[:, 0] + 0.5, image.shape[0] - uv[:, 1] - 0.5], axis=1) * 0.0254 / dpi
            )
            true = printout.p_PQ(number, layout.p_SQ[marker])
            found.add(marker)
            corner.append(float(np.linalg.norm(p_PQ - true, axis=1).max()))
            sides = np.linalg.norm(p_PQ - np.roll(p_PQ, 1, axis=0), axis=1)
            side.append(float(np.abs(sides - layout.side).max()))
    print(
        f"{scene.name:<16} {kind:<8} {page:<7} {len(printout.tiling.tiles):>5}"
        f" {len(found):>3} of {len(layout.ids)} {1e3 * max(side):>7.3f} {1e3 * max(corner):>7.3f}"
        f"  {seconds:.2f} s CPU, {len(printout.pdf) / 1e3:.0f} kB",
        flush=True,
    )


def pages_of(pdf: bytes, dpi: int) -> list[Image]:
    """Pages of a PDF in grey, lower left corners of page and pixels alike."""
    per_point, images = dpi / 72, []
    with pypdfium2.PdfDocument(pdf) as document:
        for page in document:
            # PDFium stretches a page to whole pixels; a page of as many is not stretched.
            pixels = [math.ceil(side * per_point) for side in page.get_size()]
            page.set_mediabox(0, 0, *((side - 1e-3) / per_point for side in pixels))
            images.append(page.render(scale=per_point, grayscale=True).to_numpy().copy())
    return images


def detected(image: Image, layout: MarkerLayout) -> dict[int, Array]:
    """Corners (4, 2) [px] by index in the layout, refined to a part of a pixel."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(marker_dictionary(layout.dictionary), parameters)
    corners, ids, _ = detector.detectMarkers(image)
    known = {int(i): k for k, i in enumerate(layout.ids)}
    numbers = [] if ids is None else ids.reshape(-1).tolist()
    pairs = zip(numbers, corners, strict=True)
    return {known[i]: c.reshape(4, 2).astype(float) for i, c in pairs if i in known}


def report_views(kind: str, scene: Scene) -> None:
    """Prints what is found of a board in pictures of it."""
    dpi, layout = 150, scene.board.layout
    bare = print_board(scene, PrintSettings(page="A2", height_map=False))
    sheets = {
        "without objects": pages_of(bare.pdf, dpi)[0],
        "ours": pages_of(print_board(scene, PrintSettings(page="A2")).pdf, dpi)[0],
        "BURG-Toolkit's": opaque_sheet(scene, bare, dpi),
    }
    for name, sheet in sheets.items():
        shares = []
        for pixel in CAMERA_PIXELS:
            rng = np.random.default_rng(0)
            views = [photo(sheet, 0.0254 / dpi, pixel, rng) for _ in range(VIEWS)]
            shares.append(np.mean([len(detected(v, layout)) for v in views]) / len(layout.ids))
        row = "".join(f"{100 * share:>9.1f} %" for share in shares)
        print(f"{scene.name:<16} {kind:<8} {name:<15}{row}", flush=True)


def opaque_sheet(scene: Scene, bare: Printout, dpi: int) -> Image:
    """A sheet on which objects cover the markers in grey of min(800 sqrt(z), 200), z in metres: as
    BURG-Toolkit paints them, its mean over a triangle taken at each pixel."""
    sheet = pages_of(bare.pdf, dpi)[0].copy()
    heights = height_map(scene, 0.0254 / dpi).height
    corner = bare.p_PQ(1, np.array([0.0, scene.board.size[1]])) / (0.0254 / dpi)
    rows, columns = heights.shape
    top, left = round(sheet.shape[0] - corner[1]), round(corner[0])
    part = sheet[top : top + rows, left : left + columns]
    z = heights[: part.shape[0], : part.shape[1]]
    over = np.isfinite(z)
    part[over] = np.minimum(800 * np.sqrt(np.maximum(z[over], 0.0)), 200).astype(np.uint8)
    return sheet


def photo(sheet: Image, fine: float, pixel: float, rng: np.random.Generator) -> Image:
    """A picture of a sheet: slanted, blurred, in uneven light, with noise of 4 grey levels.

    Args:
        sheet: pixels of it.
        fine: their side [m].
        pixel: side of a pixel of the picture on the sheet [m].
        rng: of slant and noise.
    """
    scale = fine / pixel
    width, height = (round(n * scale) for n in sheet.shape[::-1])
    soft = cv2.GaussianBlur(sheet, (0, 0), 0.5 / scale)
    flat = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    inward = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    slanted = (flat + inward * rng.uniform(0.0, 0.08, (4, 2))) * [width, height]
    whole = flat * np.array(sheet.shape[::-1], dtype=np.float32)
    M = cv2.getPerspectiveTransform(whole, slanted.astype(np.float32))
    view = cv2.warpPerspective(soft, M, (width, height), borderValue=255) / 255.0
    light = (0.12 + 0.75 * view) * np.linspace(0.6, 1.0, width)
    return np.clip(255 * light + rng.normal(0.0, 4.0, light.shape), 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
