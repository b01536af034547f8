"""What pages put together without a browser: footprints, board, names of scenes, keys, pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import BoardPicture
from burg_drake.compose import AddObject, ComposeSession
from burg_drake.core import make_pose, rot_z
from burg_drake.scene import Board
from burg_drake.station import load_station
from burg_drake.ui import (
    SHORTCUTS,
    LivePicture,
    footprint,
    html_table,
    issues_html,
    notice_html,
    paragraph,
    scene_names,
    sheet_picture,
    shortcut_list_html,
)
from tests.hang_guard import HANG_GUARD


def test_a_footprint_is_the_outline_with_a_rounded_margin() -> None:
    box = np.stack(np.meshgrid([-0.05, 0.05], [-0.02, 0.02], [0.0, 0.1]), axis=-1).reshape(-1, 3)
    X_SO = make_pose(rot_z(0.7), (0.2, 0.3, 0.5))
    line = footprint(box, X_SO, 0.001, margin=0.01)
    np.testing.assert_array_equal(line[:, 1], np.roll(line[:, 0], -1, axis=0))
    assert (line[..., 2] == 0.001).all()
    corners = line[:, 0, :2].astype(np.float32)
    rounded = 0.10 * 0.04 + 0.01 * 2 * (0.10 + 0.04) + np.pi * 0.01**2
    assert abs(cv2.contourArea(corners.reshape(-1, 1, 2)) - rounded) < 0.01 * rounded
    np.testing.assert_allclose(corners.mean(axis=0), (0.2, 0.3), atol=1e-3)


def test_the_boards_picture_has_its_markers_where_they_are_printed() -> None:
    board = Board()
    picture = sheet_picture(board)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_ARUCO_MIP_36h12)
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
    assert sorted(ids.ravel()) == sorted(board.layout.ids)
    scale = picture.shape[1] / board.size[0]
    for found, number in zip(corners, ids.ravel(), strict=True):
        p_SQ = board.layout.p_SQ[list(board.layout.ids).index(number), :, :2]
        expected = np.stack([p_SQ[:, 0], board.size[1] - p_SQ[:, 1]], axis=-1) * scale
        np.testing.assert_allclose(found[0], expected, atol=2.0)


@pytest.mark.thorough
def test_a_live_picture_is_the_board_rectified_until_there_is_no_more(tmp_path: Path) -> None:
    board = Board()
    corners = np.array([[300, 250], [1100, 180], [1200, 720], [180, 800]], dtype=np.float32)
    sheet = sheet_picture(board)
    height, width = sheet.shape[:2]
    edges = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32)
    H = cv2.getPerspectiveTransform(edges, corners)
    photo = cv2.warpPerspective(sheet, H, (1400, 950), flags=cv2.INTER_AREA, borderValue=(90,) * 3)
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    found: list[BoardPicture | str] = []
    live = LivePicture(str(tmp_path / "photo.png"), board, found.append)
    live.wait(HANG_GUARD)
    live.close()
    assert len(found) == 1 and isinstance(found[0], BoardPicture), found
    assert found[0].error < 1e-3 and len(found[0].ids) == len(board.layout.ids)


def test_what_cannot_be_checked_is_not_called_sound(tmp_path: Path) -> None:
    with ComposeSession.open("household", load_station("wsg_tabletop"), folder=tmp_path) as session:
        view = session.do(AddObject("mug"))
    assert "free and supported" in paragraph(*issues_html(view))
    text = paragraph(*issues_html(replace(view, status={"mug": "unknown"})))
    assert "cannot be checked: mug" in text and "supported" not in text


def test_only_files_that_name_a_library_are_offered_as_scenes(tmp_path: Path) -> None:
    (tmp_path / "b.yaml").write_text("version: 1\nname: b\nlibrary: household\n")
    (tmp_path / "a.yaml").write_text("name: a\nlibrary: x\n")
    (tmp_path / "station.yaml").write_text("version: 1\nname: s\nhand: panda_hand\n")
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "gone.yaml").symlink_to(tmp_path / "nowhere")
    assert scene_names(tmp_path) == ("a", "b")
    assert scene_names(tmp_path / "nothing") == ()


def test_no_two_actions_have_the_same_key_and_all_are_listed() -> None:
    pressed = [(s.key, s.modifier) for s in SHORTCUTS]
    assert len(set(pressed)) == len(pressed)
    text = shortcut_list_html()
    assert all(shortcut.label in text for shortcut in SHORTCUTS)


def test_names_from_files_are_no_markup() -> None:
    assert "<img" not in notice_html("<img src=x>") + html_table(["a"], [["<img src=x>"]])
