"""Paths in files: told from where the file is, and found again from there."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from burg_drake.core import (
    data_root,
    is_resolved,
    shareable_reference,
    with_resolved_references,
    with_shareable_references,
)


@pytest.mark.parametrize(
    ("path", "folder", "expected"),
    [
        ("/home/ann/work/lib", "/home/ann/work/out", "../lib"),
        ("/home/ann/work/out/a.yaml", "/home/ann/work/out", "a.yaml"),
        ("/home/ann/lib", "/home/ann/work/out/far", "../../../lib"),
        ("/home/ann/lib", "/tmp/out", "lib"),
        ("/home/bob/lib", "/home/ann/out", "lib"),
        ("/home/ann/lib/mug/mesh.obj", "/tmp/out", "mug/mesh.obj"),
        ("/home/ann/mesh.obj", "/tmp/out", "mesh.obj"),
        ("/data/sets/lib", "/data/out", "../sets/lib"),
        ("/data/sets/lib", "/home/ann", "sets/lib"),
    ],
)
def test_nothing_above_what_is_shared_is_told(
    path: str, folder: str, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", "/home/ann")
    assert shareable_reference(Path(path), Path(folder)) == expected


def test_references_are_found_again_where_all_has_moved(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    for name in ("lib/mug/mesh.obj", "scenes/a.yaml"):
        (here / name).parent.mkdir(parents=True)
        (here / name).touch()
    station = data_root() / "stations" / "panda_tabletop.yaml"

    def values(root: Path) -> dict[str, Any]:
        return {
            "scene": str(root / "scenes" / "a.yaml"),
            "station": str(station),
            "content": {"scene": "d4c57cccf83b"},
            "parts": [{"object_files": {"mug": {"file": str(root / "lib/mug/mesh.obj")}}}, 5, None],
            "name": "/is/no/path",
        }

    told = with_shareable_references(values(here), here / "out")
    assert told == {
        "scene": "../scenes/a.yaml",
        "station": "package://burg_drake/stations/panda_tabletop.yaml",
        "content": {"scene": "d4c57cccf83b"},
        "parts": [{"object_files": {"mug": {"file": "../lib/mug/mesh.obj"}}}, 5, None],
        "name": "/is/no/path",
    }
    shutil.copytree(here, there)
    (there / "out").mkdir()
    assert with_resolved_references(told, there / "out") == values(there.resolve())
    shutil.rmtree(here)
    (here / "out").mkdir(parents=True)
    assert with_resolved_references(told, here / "out") == {**told, "station": str(station)}


@pytest.mark.parametrize("text", ["", "~nosuchuser/x", "a\0b", "x" * 5000, "package://x/y", "a\nb"])
def test_what_is_no_path_stays(tmp_path: Path, text: str) -> None:
    assert with_resolved_references({"scene": text}, tmp_path) == {"scene": text}


def test_what_was_not_found_is_not_looked_for_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lib").mkdir()
    monkeypatch.chdir(tmp_path)
    (told,) = with_resolved_references({"library": "lib"}, tmp_path / "elsewhere").values()
    assert not is_resolved(told, "models")
    assert is_resolved(str(tmp_path / "lib")) and is_resolved("household", "models")
    assert is_resolved("package://burg_drake/scenes/tabletop_six.yaml")
