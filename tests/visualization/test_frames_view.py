"""Drawn frames are those of the registry, one hand a convention."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from recording import RecordingMeshcat

from burg_drake.core import inverse
from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER, group_by_convention
from burg_drake.station import gripper_of, locate_hand
from burg_drake.visualization import FORMAT_TRIAD, FRAMES_PATH, save_html, show_frames


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_drawn_triads_are_those_of_the_registry(recorder: RecordingMeshcat, name: str) -> None:
    hand, model, _ = locate_hand("panda_hand")
    show_frames(hand, model, PANDA_GRIPPER, [GRASP_FORMATS[name]], recorder)  # type: ignore[arg-type]
    X_WG, X_WF = (recorder.X_WP(f"{FRAMES_PATH}/{frame}/{name}") for frame in "GF")
    assert inverse(X_WG) @ X_WF == pytest.approx(GRASP_FORMATS[name].X_GF(PANDA_GRIPPER), abs=1e-12)
    for k, axis in enumerate("xyz"):  # the tip of each arrow is on its axis
        tip = recorder.X_WP(f"{FRAMES_PATH}/F/{name}/{axis}/head")[:3, 3]
        assert tip == pytest.approx(X_WF[:3, 3] + FORMAT_TRIAD.length * X_WF[:3, k], abs=1e-12)


def test_hands_hold_their_frames_and_are_apart(recorder: RecordingMeshcat) -> None:
    """The hand's first visual has the same place in every G; neighbours are a hand apart."""
    hand, model, path = locate_hand("wsg_50")
    gripper = gripper_of(hand, model, path)
    groups = group_by_convention(GRASP_FORMATS.values(), gripper)
    show_frames(hand, model, gripper, list(GRASP_FORMATS.values()), recorder)  # type: ignore[arg-type]
    names = [group[0].name for group in groups]
    assert 3 <= len(names) < len(GRASP_FORMATS)
    at_G = [
        inverse(recorder.X_WP(f"{FRAMES_PATH}/G/{n}")) @ recorder.X_WP(f"{FRAMES_PATH}/hands/{n}/0")
        for n in names
    ]
    assert all(pytest.approx(at_G[0]) == X for X in at_G)
    places = [recorder.X_WP(f"{FRAMES_PATH}/G/{n}")[:3, 3] for n in names]
    for a, b in itertools.combinations(places, 2):
        assert np.linalg.norm(a - b) > 0.15
    shown = {name for name in GRASP_FORMATS if recorder.HasPath(f"{FRAMES_PATH}/F/{name}")}
    assert shown == set(names)


def test_approach_is_down_and_the_page_complete(recorder: RecordingMeshcat, tmp_path: Path) -> None:
    hand, model, _ = locate_hand("panda_hand")
    legend = show_frames(hand, model, PANDA_GRIPPER, [GRASP_FORMATS["burg"]], recorder)  # type: ignore[arg-type]
    assert recorder.X_WP(f"{FRAMES_PATH}/G/burg")[:3, 2] == pytest.approx([0.0, 0.0, -1.0])
    assert {path for entry in legend for path in entry.paths} == {
        f"{FRAMES_PATH}/{part}" for part in ("F", "G", "hands", "objects", "labels")
    }
    for entry in legend:
        assert all(recorder.HasPath(path) for path in entry.paths)
    page = tmp_path / "frames.html"
    save_html(recorder.meshcat, page, title="Grasp frames", legend=legend)
    assert page.stat().st_size > 1e6
    assert 'src="http' not in page.read_text()
