"""Coarse convex pieces: a thin ring, which the default cut fills by half again."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from burg_drake.objects import Decomposition, union_mesh
from burg_drake.pipeline import ObjectSource, build_library, check_library


@pytest.fixture(scope="module")
def ring() -> trimesh.Trimesh:
    return trimesh.creation.annulus(r_min=0.049, r_max=0.05, height=0.06, sections=24)


def test_a_finer_cut_by_itself(tmp_path: Path, ring: trimesh.Trimesh) -> None:
    source = ObjectSource(name="ring", mesh=ring, mass=0.05, contact="pieces")
    report = build_library([source], tmp_path, confirm=False)
    entry = report.library.entry("ring")
    pieces = [report.library.mesh(piece) for piece in entry.pieces]
    assert union_mesh(pieces).volume < 1.1 * ring.volume
    assert entry.decomposition == Decomposition(threshold=0.02)
    (note,) = report.notes["ring"]
    assert note.startswith("cut again with decomposition.threshold 0.02 instead of 0.05, as the ")
    assert not [i for i in check_library(report.library) if "coarse" in i.message]
    heavier = ObjectSource(name="ring", mesh=ring, mass=0.06, contact="pieces", friction=0.3)
    again = build_library([heavier], tmp_path, confirm=False)
    assert again.library.entry("ring").decomposition == entry.decomposition
    assert "pieces" not in again.seconds["ring"]  # but those of the first build


@pytest.mark.thorough
def test_a_threshold_that_was_asked_for_stays(tmp_path: Path, ring: trimesh.Trimesh) -> None:
    """Build and check say the same of what comes of it."""
    source = ObjectSource(
        name="ring", mesh=ring, mass=0.05, decomposition=Decomposition(threshold=0.06)
    )
    report = build_library([source], tmp_path, confirm=False)
    (note,) = report.notes["ring"]
    assert note.startswith("the convex pieces do not fit well: ")
    assert note in [issue.message for issue in check_library(report.library)]
