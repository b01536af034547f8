"""Whose folder it is, and that it is replaced whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError, atomic_folder, load_document
from burg_drake.export import (
    ExportRecord,
    export_scene,
    require_own_folder,
    write_record,
)
from burg_drake.scene import Scene

RECORD = ExportRecord(format="sdf", scene="s", scene_content="", main="a", software="x")


def export(path: Path, **files: str) -> None:
    with atomic_folder(require_own_folder(path), replace=True) as fresh:
        for name, text in files.items():
            (fresh / name).write_text(text)
        write_record(fresh, RECORD)


def names(folder: Path) -> set[str]:
    return {p.name for p in folder.iterdir()}


def test_a_new_folder_and_an_empty_one_are_taken(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("new", "empty", "deep/er"):
        export(tmp_path / name, a="1")
        assert names(tmp_path / name) == {"a", "export.yaml"}
    assert names(tmp_path) == {"new", "empty", "deep"}


def test_an_earlier_export_is_replaced_whole(tmp_path: Path) -> None:
    export(tmp_path / "out", a="1", b="1")
    export(tmp_path / "out", a="2")
    assert names(tmp_path / "out") == {"a", "export.yaml"}
    assert (tmp_path / "out" / "a").read_text() == "2"
    assert names(tmp_path) == {"out"}


def test_somebody_elses_folder_stays(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    with pytest.raises(InvalidInputError, match="has files in it and is not an earlier export"):
        export(tmp_path / "out", a="1")
    assert names(tmp_path / "out") == {"thesis.tex"}


def test_what_somebody_put_into_an_export_stays(tmp_path: Path) -> None:
    export(tmp_path / "out", a="1")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInputError, match=r"did not write \(notes.txt\); move them away"):
        export(tmp_path / "out", a="2")
    assert (tmp_path / "out" / "a").read_text() == "1"


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(InvalidInputError, match="out is a file; name a folder"):
        export(tmp_path / "out")


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    export(tmp_path / "link", a="1")
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path / "real") == {"a", "export.yaml"}


def test_what_fails_half_way_leaves_everything_as_it_was(tmp_path: Path) -> None:
    export(tmp_path / "out", a="1")
    with (
        pytest.raises(ZeroDivisionError),
        atomic_folder(require_own_folder(tmp_path / "out"), replace=True) as fresh,
    ):
        (fresh / "a").write_text("2")
        raise ZeroDivisionError
    assert (tmp_path / "out" / "a").read_text() == "1"
    assert names(tmp_path) == {"out"}


def test_where_nothing_can_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"cannot write to folder .*/file: it is a file"):
        export(tmp_path / "file" / "out")


def test_the_record_says_what_the_folder_is_of(scene: Scene, tmp_path: Path) -> None:
    exported = export_scene(scene, tmp_path / "out", "sdf")
    record = load_document(tmp_path / "out" / "export.yaml", ExportRecord)
    assert (record.format, record.scene, record.station, record.main) == (
        *("sdf", "all", ""),
        exported.main.name,
    )
    assert record.scene_content == scene.content
    present = {p.relative_to(tmp_path / "out") for p in (tmp_path / "out").rglob("*")}
    files = {p for p in present if (tmp_path / "out" / p).is_file()}
    assert {Path(f) for f in record.files} == files - {Path("export.yaml")}
