"""`burg-drake camera placement`: from files to a table, a document and a picture."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.cameras import Intrinsics, load_placement, save_intrinsics
from burg_drake.core import make_pose
from burg_drake.scene import load_scene
from burg_drake.system_libraries import missing_render_libraries
from tests.cameras.placement_views import looking
from tests.cameras.synthetic import board_image

Capture = pytest.CaptureFixture[str]
INTRINSICS = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
SCENE = """\
version: 1
name: two
library: household
instances:
  - object: mug
    X_SO: {translation: [0.20, 0.21, 0.0]}
  - object: can
    X_SO: {translation: [0.38, 0.21, 0.0]}
"""


def run(*words: str | Path) -> int:
    return main(["camera", "placement", *map(str, words)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene of two objects, and intrinsics."""
    (tmp_path / "two.yaml").write_text(SCENE)
    save_intrinsics(INTRINSICS, tmp_path / "K.yaml")
    return tmp_path


@pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)
def test_a_photo_becomes_a_table_a_document_and_a_picture(folder: Path, capsys: Capture) -> None:
    from tests.cameras.placement_photo import ScenePhotographer

    scene = load_scene(folder / "two.yaml")
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.29, 0.21, 0.7))  # straight down
    moved = scene.X_SO("can") @ make_pose(p_AB=(0.01, 0.0, 0.0))
    photo = ScenePhotographer(scene).take(X_SC, INTRINSICS, {"can": moved})
    cv2.imwrite(str(folder / "photo.png"), photo.color[..., ::-1])
    files = (folder / "placement.yaml", folder / "check.png")
    words = (folder / "two.yaml", folder / "photo.png", "--intrinsics", folder / "K.yaml")
    assert run(*words, "-o", files[0], "--overlay", files[1]) == 0
    printed = capsys.readouterr().out
    rows = {line.split()[0]: line.split()[1:] for line in printed.splitlines() if line}
    assert 0.0 <= float(rows["mug"][0]) < 1.0
    assert 9.5 <= float(rows["can"][0]) < 11.0
    assert rows["can"][4:] == ["-", "-"]  # it looks the same however it is turned
    assert "(scene frame S)" in printed
    check = load_placement(files[0])
    assert check.image.file == "photo.png"
    assert check.scene.content == scene.content
    assert check.instances["can"].displacement == pytest.approx((0.01, 0.0), abs=4e-4)
    picture = cv2.imread(str(files[1]))
    assert picture.shape == (480, 640, 3)
    assert (picture != photo.color[..., ::-1]).any()


def test_a_photo_without_a_board_says_so(folder: Path, capsys: Capture) -> None:
    cv2.imwrite(str(folder / "grey.png"), np.full((480, 640, 3), 128, np.uint8))
    words = (folder / "two.yaml", folder / "grey.png", "--intrinsics", folder / "K.yaml")
    assert run(*words, "-o", folder / "placement.yaml") == 2
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert "grey.png: the board was not found" in line
    assert printed.out == ""
    assert not (folder / "placement.yaml").exists()


@pytest.mark.thorough
def test_a_scaled_print_is_told_or_doubted(folder: Path, capsys: Capture) -> None:
    can = SCENE.replace(SCENE[SCENE.index("  - object: mug") : SCENE.index("  - object: can")], "")
    (folder / "two.yaml").write_text(can)
    scene = load_scene(folder / "two.yaml")
    X_SC = looking(np.array([0.3, 0.1, 0.7]), np.array([0.29, 0.2, 0.0]))
    drawn = board_image(scene.board, INTRINSICS, X_SC, scale=(0.97, 0.98))
    cv2.imwrite(str(folder / "scaled.png"), drawn[..., ::-1])
    words = (folder / "two.yaml", folder / "scaled.png", "--intrinsics", folder / "K.yaml")
    files = (folder / "plain.yaml", folder / "told.yaml")
    assert run(*words, "-o", files[0]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: warning: {folder / 'scaled.png'}: ")
    assert "times as long along y" in line
    assert run(*words, "--measured-mm", "97,98", "-o", files[1]) == 1
    assert capsys.readouterr().err == ""
    p_SC = [load_placement(file).camera.X_SC.translation for file in files]  # type: ignore[union-attr]
    assert np.linalg.norm(p_SC[0] - X_SC[:3, 3]) > 0.01
    assert np.linalg.norm(p_SC[1] - X_SC[:3, 3]) < 5e-4


@pytest.mark.thorough
def test_few_markers_are_doubted(folder: Path, capsys: Capture) -> None:
    scene = load_scene(folder / "two.yaml")
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.117, 0.12, 0.08))
    drawn = board_image(scene.board, INTRINSICS, X_SC)
    cv2.imwrite(str(folder / "near.png"), drawn[..., ::-1])
    words = (folder / "two.yaml", folder / "near.png", "--intrinsics", folder / "K.yaml")
    assert run(*words) == 1
    assert re.search(r"near\.png: only [1-3] of 54 markers are seen", capsys.readouterr().err)


def test_an_overlay_of_no_format_is_refused_at_once(folder: Path, capsys: Capture) -> None:
    words = (folder / "two.yaml", folder / "none.png", "--intrinsics", folder / "K.yaml")
    assert run(*words, "--overlay", folder / "check.txt") == 2
    assert "check.txt: the name of an image must end in .png or .jpg" in capsys.readouterr().err


def test_markers_that_do_not_fit_name_their_file(folder: Path, capsys: Capture) -> None:
    (folder / "large.yaml").write_text(SCENE + "board: {markers: {side: 0.5}}\n")
    cv2.imwrite(str(folder / "grey.png"), np.full((480, 640, 3), 128, np.uint8))
    for verb in ("placement", "locate"):
        words = [folder / "large.yaml", folder / "grey.png", "--intrinsics", folder / "K.yaml"]
        assert main(["camera", verb, *map(str, words)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"{folder / 'large.yaml'}: board.markers: markers of 500 mm" in line


def test_files_that_cannot_be_used_are_named(folder: Path, capsys: Capture) -> None:
    cv2.imwrite(str(folder / "small.png"), np.zeros((240, 320, 3), np.uint8))
    (folder / "text.png").write_text("hello")
    end = ("--intrinsics", folder / "K.yaml")
    for name, message in (
        ("small.png", "small.png has 320 x 240 pixels, but the intrinsics are for 640 x 480"),
        ("text.png", "text.png cannot be read as an image"),
        ("none.png", "cannot read image"),
    ):
        assert run(folder / "two.yaml", folder / name, *end) == 2
        assert message in capsys.readouterr().err
