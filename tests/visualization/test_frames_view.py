"""Drawn frames are those of the registry, one hand a convention."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from recording import RecordingMeshcat

from burg_drake.core.frames import inverse
from burg_drake.formats.common.convention import grouped
from burg_drake.formats.common.grasp_format import PANDA
from burg_drake.formats.grasp_files import FORMATS
from burg_drake.station.document.gripper_document import locate_hand
from burg_drake.station.world.gripper import gripper_of
from burg_drake.visualization.gallery.grasp_frames import ROOT, THEIRS, show_frames
from burg_drake.visualization.page import save_html


@pytest.mark.parametrize("name", FORMATS)
def test_drawn_triads_are_those_of_the_registry(recorder: RecordingMeshcat, name: str) -> None:
    hand, model, _ = locate_hand("panda_hand")
    show_frames(hand, model, PANDA, [FORMATS[name]], recorder)  # type: ignore[arg-type]
    X_WG, X_WF = (recorder.X_WP(f"{ROOT}/{frame}/{name}") for frame in "GF")
    assert inverse(X_WG) @ X_WF == pytest.approx(FORMATS[name].X_GF(PANDA), abs=1e-12)
    for k, axis in enumerate("xyz"):  # the tip of each arrow is on its axis
        tip = recorder.X_WP(f"{ROOT}/F/{name}/{axis}/head")[:3, 3]
        assert tip == pytest.approx(X_WF[:3, 3] + THEIRS.length * X_WF[:3, k], abs=1e-12)


def test_hands_hold_their_frames_and_are_apart(recorder: RecordingMeshcat) -> None:
    """The hand's first visual has the same place in every G; neighbours are a hand apart."""
    hand, model, path = locate_hand("wsg_50")
    gripper = gripper_of(hand, model, path)
    groups = grouped(FORMATS.values(), gripper)
    show_frames(hand, model, gripper, list(FORMATS.values()), recorder)  # type: ignore[arg-type]
    names = [group[0].name for group in groups]
    assert 3 <= len(names) < len(FORMATS)
    at_G = [
        inverse(recorder.X_WP(f"{ROOT}/G/{n}")) @ recorder.X_WP(f"{ROOT}/hands/{n}/0")
        for n in names
    ]
    assert all(pytest.approx(at_G[0]) == X for X in at_G)
    places = [recorder.X_WP(f"{ROOT}/G/{n}")[:3, 3] for n in names]
    for a, b in itertools.combinations(places, 2):
        assert np.linalg.norm(a - b) > 0.15
    shown = {name for name in FORMATS if recorder.HasPath(f"{ROOT}/F/{name}")}
    assert shown == set(names)


def test_approach_is_down_and_the_page_complete(recorder: RecordingMeshcat, tmp_path: Path) -> None:
    hand, model, _ = locate_hand("panda_hand")
    legend = show_frames(hand, model, PANDA, [FORMATS["burg"]], recorder)  # type: ignore[arg-type]
    assert recorder.X_WP(f"{ROOT}/G/burg")[:3, 2] == pytest.approx([0.0, 0.0, -1.0])
    assert {path for entry in legend for path in entry.paths} == {
        f"{ROOT}/{part}" for part in ("F", "G", "hands", "objects", "labels")
    }
    for entry in legend:
        assert all(recorder.HasPath(path) for path in entry.paths)
    page = tmp_path / "frames.html"
    save_html(recorder.meshcat, page, title="Grasp frames", legend=legend)
    assert page.stat().st_size > 1e6
    assert 'src="http' not in page.read_text()
