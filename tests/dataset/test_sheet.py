"""The contact sheet: each picture where it belongs, names that can be read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.dataset import contact_sheet, place_name_tag
from tests.dataset.exported_files import image
from tests.dataset.polyhedra import COLORS, InMemory


def test_sheet_shows_colour_depth_and_labels(samples: InMemory, tmp_path: Path) -> None:
    contact_sheet(samples, tmp_path / "sheet.png", rows=2, columns=2)
    sheet = image(tmp_path / "sheet.png")[..., ::-1]
    panel, height = 320, 240
    assert sheet.shape == (2 * (height + 26) + 6, 2 * (3 * panel + 18) + 6, 3)
    first = sheet[26 : 26 + height, 6:]
    sample = samples[0]
    labels = cv2.resize(sample.images.labels, (panel, height), interpolation=cv2.INTER_NEAREST)
    inner = cv2.erode((labels == 1).astype(np.uint8), np.ones((9, 9))).astype(bool)
    assert (first[:, :panel][inner] == COLORS["box"]).all()
    depth = cv2.resize(sample.images.depth, (panel, height), interpolation=cv2.INTER_NEAREST)
    brightness = first[:, panel + 6 : 2 * panel + 6].mean(axis=-1)
    there = depth > 0
    assert np.corrcoef(depth[there], brightness[there])[0, 1] < -0.9  # bright is near
    beside = first[:, 2 * panel + 12 : 3 * panel + 12].astype(int)
    assert np.ptp(beside[inner], axis=-1).min() > 10  # tinted, and the rest is grey
    assert np.ptp(beside[labels == 0], axis=-1).min() == 0
    contact_sheet(samples, tmp_path / "sheet.html", title="Two <scenes>")
    page = (tmp_path / "sheet.html").read_text()
    assert page.count("data:image/png;base64,") == 4 and "Two &lt;scenes&gt;" in page
    assert "000005_001, camera sphere, 3 of 3 seen" in page


def test_sheet_shows_the_sensor_s_depth_in_the_same_colours(
    samples: InMemory, tmp_path: Path
) -> None:
    exact = samples[0].images.depth
    half = np.where(np.arange(exact.shape[1]) % 2 == 1, exact, 0.0).astype(np.float32)
    contact_sheet([replace(samples[0], sensor_depth=half)], tmp_path / "sheet.png")
    panels = image(tmp_path / "sheet.png")[26:266, 6:].astype(int)
    assert panels.shape[1] == 4 * 320 + 3 * 6 + 6
    one, other = panels[:, 326:646], panels[:, 652:972]
    shown = (other != 70).any(axis=-1)
    assert 0.3 < shown.mean() < 0.6
    np.testing.assert_array_equal(one[shown], other[shown])


def test_names_on_a_sheet_stay_in_it_and_beside_each_other() -> None:
    corners = [(100.0, 100.0), (110.0, 104.0), (128.0, 98.0), (104.0, 118.0)]
    boxes = [np.array([*corner, 40.0, 30.0]) for corner in corners]
    boxes += [np.array([300.0, 230.0, 40.0, 30.0]), np.array([-20.0, -20.0, 30.0, 30.0])]
    taken: list[NDArray] = []
    for box in boxes:
        place = place_name_tag(box, np.array([55, 15]), (320, 240), taken)
        assert (place[2:] - place[:2]).tolist() == [55, 15]
        assert (place[:2] >= 0).all() and (place[2:] <= [320, 240]).all()
        for other in taken:
            assert (place[:2] >= other[2:]).any() or (place[2:] <= other[:2]).any()
        taken.append(place)
