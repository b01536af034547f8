"""Thumbnails: the object is there, whole, in the middle; pixels are the oracle."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from burg_drake.core import MissingDependencyError, UnknownNameError, distinct_colors
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.system_libraries import missing_render_libraries
from burg_drake.visualization import (
    MAX_FILLED_SHARE,
    THUMBNAIL_BACKGROUND,
    ObjectRenderer,
    Thumbnail,
    explosion_offsets,
    thumbnails,
)

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="Drake cannot render here"
)
NAMES = ["mug", "marble", "screwdriver", "box"]


@pytest.fixture(scope="module")
def library() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="module")
def renderer(library: ObjectLibrary) -> ObjectRenderer:
    return ObjectRenderer(library, NAMES)


def check_framing(picture: Thumbnail) -> None:
    """The object is inside margins, in the middle, and as large as it is meant to be."""
    height, width = picture.coverage.shape
    rows, columns = np.nonzero(picture.coverage > 0.02)
    left, right = columns.min(), width - 1 - columns.max()
    top, bottom = rows.min(), height - 1 - rows.max()
    assert min(left, right) >= (1 - MAX_FILLED_SHARE) / 2 * width - 2
    assert min(top, bottom) >= (1 - MAX_FILLED_SHARE) / 2 * height - 2
    assert abs(left - right) <= 0.02 * width + 2 and abs(top - bottom) <= 0.02 * height + 2
    fill = max(np.ptp(columns) / width, np.ptp(rows) / height)
    assert MAX_FILLED_SHARE - 0.06 < fill < MAX_FILLED_SHARE + 0.02


def check_ink(picture: Thumbnail) -> None:
    """Where the object is, pixels are not background; in the corners they are."""
    background = 255 * np.array(THUMBNAIL_BACKGROUND)
    inside = picture.pixels[picture.coverage == 1.0].astype(float)
    assert len(inside) > 500 or picture.coverage.size < 30_000
    assert (np.abs(inside - background).max(axis=1) > 12).mean() > 0.97
    assert np.ptp(inside, axis=0).max() > 30, "no shading"
    for row in (0, -1):
        for column in (0, -1):
            assert picture.pixels[row, column] == pytest.approx(background, abs=2)


@needs_renderer
@pytest.mark.parametrize("name", NAMES)
def test_portraits(renderer: ObjectRenderer, name: str) -> None:
    picture = renderer.portrait(name)
    assert picture.pixels.shape == (240, 320, 3)
    check_framing(picture)
    check_ink(picture)


@needs_renderer
def test_every_stable_pose(library: ObjectLibrary, renderer: ObjectRenderer) -> None:
    pictures = [
        renderer.portrait("mug", (160, 120), stable_pose=k)
        for k in range(len(library.entry("mug").stable_poses))
    ]
    for picture in pictures:
        check_framing(picture)
        check_ink(picture)
    assert len({picture.pixels.tobytes() for picture in pictures}) == len(pictures)


@needs_renderer
def test_pieces_are_seen_in_their_colours(renderer: ObjectRenderer) -> None:
    picture = renderer.pieces("screwdriver")
    check_framing(picture)
    inside = picture.pixels[picture.coverage == 1.0] / 255.0
    colors = np.array(distinct_colors(6))

    def chroma(values: np.ndarray) -> np.ndarray:
        return values / np.linalg.norm(values, axis=-1, keepdims=True)

    nearest = np.argmax(chroma(inside) @ chroma(colors).T, axis=1)
    assert set(nearest.tolist()) == set(range(6))


@needs_renderer
def test_only_one_object_is_in_a_picture(library: ObjectLibrary, renderer: ObjectRenderer) -> None:
    alone = ObjectRenderer(library, ["box"]).portrait("box")
    assert np.abs(alone.pixels.astype(int) - renderer.portrait("box").pixels).max() <= 1


@needs_renderer
def test_files_are_small_and_not_blank(renderer: ObjectRenderer) -> None:
    data = renderer.portrait("mug").png()
    assert len(data) < 16_000
    image = Image.open(io.BytesIO(data)).convert("RGB")
    assert image.size == (320, 240)
    assert np.asarray(image).std() > 20


@needs_renderer
def test_unknown_object(library: ObjectLibrary) -> None:
    with pytest.raises(UnknownNameError, match="'cup' is not in library"):
        ObjectRenderer(library, ["cup"])


def test_missing_system_libraries_are_named(
    library: ObjectLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(thumbnails, "missing_render_libraries", lambda: ["libEGL.so.1"])
    with pytest.raises(MissingDependencyError, match=r"Drake cannot render.*libEGL\.so\.1"):
        ObjectRenderer(library)


@pytest.mark.parametrize("count", [1, 2, 25, 65])
def test_piece_colours_are_distinct(count: int) -> None:
    colors = np.array(distinct_colors(count))
    assert colors.shape == (count, 3) and (colors >= 0.0).all() and (colors <= 1.0).all()
    distance = np.abs(colors[:, None] - colors[None]).max(axis=2) + 9.0 * np.eye(count)
    assert distance.min() > 0.06  # 15 of 255


def test_pieces_move_outward_in_proportion() -> None:
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    aside = np.array([3.0, 0.0, 0.0])
    left, right = explosion_offsets([square - aside, square + aside], 0.1)
    assert left == pytest.approx([-0.3, 0, 0]) and right == pytest.approx([0.3, 0, 0])
    assert explosion_offsets([square], 0.1)[0] == pytest.approx([0, 0, 0])
