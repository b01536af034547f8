"""Snapshots come back as they were taken."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from burg_drake.cameras import (
    BoardEstimate,
    Intrinsics,
    Snapshot,
    describe_snapshot,
    load_intrinsics,
    load_snapshot,
    next_free_path,
    save_snapshot,
)
from burg_drake.core import DocumentError, InvalidInputError, make_pose, rotation_from_rpy
from burg_drake.scene import load_scene

LENS = Intrinsics(
    width=64,
    height=48,
    focal=(60.25, 60.5),
    center=(31.5, 23.5),
    distortion=(0.1, -0.05, 0.001, -0.002),
)
X_SC = make_pose(rotation_from_rpy((2.8, 0.1, 0.7)), (0.3, -0.2, 0.6))
SEEN = BoardEstimate(
    X_SC=X_SC,
    valid=True,
    reprojection_error=0.07,
    covariance=np.diag(np.arange(1.0, 7.0)) * 1e-9,
    ids=(3, 4, 17),
)


def snapshot(
    estimate: BoardEstimate,
    depth: np.ndarray | None = None,
    X_SC_drawn: np.ndarray | None = None,
) -> Snapshot:
    rng = np.random.default_rng(0)
    image, overlay = rng.integers(0, 256, (2, 48, 64, 3), dtype=np.uint8)
    document = describe_snapshot(
        load_scene("tabletop_six"),
        LENS,
        estimate,
        source="camera 0",
        taken="2026-01-02T03:04:05+00:00",
        time=1.25,
        X_SC_drawn=X_SC_drawn,
    )
    return Snapshot(document=document, image=image, overlay=overlay, depth=depth)


def test_comes_back(tmp_path: Path) -> None:
    depth = np.full((48, 64), 0.7)
    depth[3, 4] = np.nan
    taken = snapshot(SEEN, depth)
    save_snapshot(taken, tmp_path / "a" / "first")
    back = load_snapshot(tmp_path / "a" / "first")
    assert np.array_equal(back.image, taken.image)
    assert np.array_equal(back.overlay, taken.overlay)
    assert back.depth is not None
    assert np.allclose(back.depth, depth, equal_nan=True)
    assert back.document == taken.document
    board = back.document.board
    assert board.X_SC is not None
    assert np.allclose(board.X_SC.matrix(), X_SC, atol=1e-12)
    assert np.allclose(board.covariance, SEEN.covariance)
    assert board.markers == SEEN.ids
    assert back.document.scene.content == load_scene("tabletop_six").content
    assert load_intrinsics(tmp_path / "a" / "first" / "intrinsics.yaml") == LENS
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["first"]


def test_without_a_pose(tmp_path: Path) -> None:
    save_snapshot(snapshot(BoardEstimate(reason="no marker")), tmp_path / "s")
    board = load_snapshot(tmp_path / "s").document.board
    assert board.X_SC is None and board.reprojection_error is None and board.covariance == ()
    assert board.reason == "no marker"


def test_bad_places_and_folders(tmp_path: Path) -> None:
    save_snapshot(snapshot(SEEN), tmp_path / "s")
    with pytest.raises(InvalidInputError, match="exists already; choose another name"):
        save_snapshot(snapshot(SEEN), tmp_path / "s")
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="choose a writable place"):
        save_snapshot(snapshot(SEEN), tmp_path / "file" / "s")
    with pytest.raises(DocumentError, match=r"snapshot.yaml is missing"):
        load_snapshot(tmp_path)
    picture = tmp_path / "s" / "image.png"
    picture.write_bytes(picture.read_bytes()[:100])
    with pytest.raises(InvalidInputError, match=r"image\.png .*; take the snapshot again"):
        load_snapshot(tmp_path / "s")


def test_damaged_depth(tmp_path: Path) -> None:
    save_snapshot(snapshot(SEEN, np.full((48, 64), 0.7)), tmp_path / "s")
    file = tmp_path / "s" / "depth.npy"
    whole = file.read_bytes()
    for broken in (whole[:-5], b"", b"no array", b"\x80\x04N."):
        file.write_bytes(broken)
        with pytest.raises(InvalidInputError, match=r"depth\.npy is .*; take the snapshot again"):
            load_snapshot(tmp_path / "s")
    np.save(file, np.zeros((48, 63)))
    with pytest.raises(InvalidInputError, match=r"has shape \(48, 63\); expected \(48, 64"):
        load_snapshot(tmp_path / "s")


def test_the_pose_that_was_drawn_is_told_where_it_is_another(tmp_path: Path) -> None:
    assert snapshot(SEEN, X_SC_drawn=X_SC).document.X_SC_drawn is None
    elsewhere = X_SC @ make_pose(np.eye(3), (0.0, 0.0, 1e-4))
    save_snapshot(snapshot(SEEN, X_SC_drawn=elsewhere), tmp_path / "s")
    back = load_snapshot(tmp_path / "s").document
    assert back.X_SC_drawn is not None and back.board.X_SC is not None
    assert np.allclose(back.X_SC_drawn.matrix(), elsewhere, atol=1e-12)
    assert np.allclose(back.board.X_SC.matrix(), X_SC, atol=1e-12)


def test_permissions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of an ordinary new folder; those of the process, of which the server's threads are
    part, are not touched."""
    before = os.umask(0o027)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", lambda mask: pytest.fail(f"umask {mask:o}"))
            save_snapshot(snapshot(SEEN), tmp_path / "s")
    finally:
        os.umask(before)
    assert (tmp_path / "s").stat().st_mode & 0o777 == 0o750
    assert all(path.stat().st_mode & 0o777 == 0o640 for path in (tmp_path / "s").iterdir())


def test_numbers_of_snapshots(tmp_path: Path) -> None:
    (tmp_path / "a_001").mkdir()
    (tmp_path / "a_003.mp4").touch()
    assert next_free_path(tmp_path, "a") == tmp_path / "a_002"
    assert next_free_path(tmp_path, "a", ".mp4") == tmp_path / "a_001.mp4"
