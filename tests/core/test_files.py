from __future__ import annotations

import os
from pathlib import Path

import pytest

from burg_drake.core import (
    InvalidInputError,
    atomic_folder,
    atomic_write,
    atomic_write_all,
    ensure_writable_folder,
    require_writable,
    try_lock,
)


def test_writes_text_and_bytes_into_folders_that_do_not_exist_yet(tmp_path: Path):
    atomic_write(tmp_path / "a" / "b" / "text.yaml", "größe: 1\n")
    atomic_write(str(tmp_path / "a" / "data.bin"), b"\x00\xff")
    assert (tmp_path / "a" / "b" / "text.yaml").read_bytes() == "größe: 1\n".encode()
    assert (tmp_path / "a" / "data.bin").read_bytes() == b"\x00\xff"


@pytest.mark.parametrize("step", ["fsync", "replace"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_at_any_step_leaves_the_old_file_and_no_rest(tmp_path, monkeypatch, step, error):
    path = tmp_path / "results.csv"
    path.write_text("old")

    def fail(*_):
        raise error

    monkeypatch.setattr(os, step, fail)
    with pytest.raises((InvalidInputError, KeyboardInterrupt)) as caught:
        atomic_write(path, "new and longer")
    if isinstance(error, OSError):
        assert str(caught.value) == (
            f"cannot write {path}: No space left on device; choose a writable place"
        )
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_permissions_are_those_of_an_ordinary_new_file(tmp_path: Path):
    previous = os.umask(0o027)
    try:
        atomic_write(tmp_path / "written", "x")
        (tmp_path / "plain").write_text("x")
    finally:
        os.umask(previous)
    assert (tmp_path / "written").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_file_that_is_replaced_keeps_its_permissions_and_its_links(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    real = tmp_path / "there" / "file"
    real.write_text("old")
    for mode in (0o600, 0o664, 0o444):
        real.chmod(mode)
        atomic_write(real, f"{mode:o}")
        assert real.read_text() == f"{mode:o}" and real.stat().st_mode & 0o777 == mode
    link = tmp_path / "link"
    link.symlink_to("there/file")
    atomic_write(link, "through the link")
    assert link.is_symlink() and real.read_text() == "through the link"
    assert list(real.parent.iterdir()) == [real]
    dangling = tmp_path / "dangling"
    dangling.symlink_to("there/new")
    atomic_write(dangling, "new")
    assert dangling.is_symlink() and (tmp_path / "there" / "new").read_text() == "new"


def test_permissions_of_the_process_are_never_touched(tmp_path, monkeypatch):
    """They are of all threads: what others write at that moment would be open to everyone."""

    def refuse(mask: int) -> int:
        raise AssertionError(f"umask {mask:o}")

    monkeypatch.setattr(os, "umask", refuse)
    atomic_write(tmp_path / "written", "x")
    assert (tmp_path / "written").read_text() == "x"


def test_unwritable_places_are_named(tmp_path: Path):
    file = tmp_path / "file"
    file.write_text("in the way")
    for write in (
        lambda: atomic_write(file / "x.csv", "x"),
        lambda: ensure_writable_folder(file / "run"),
    ):
        with pytest.raises(InvalidInputError, match=r"^cannot write .*choose a writable place$"):
            write()
    with pytest.raises(InvalidInputError, match=r"cannot write to folder .*: it is a file;"):
        ensure_writable_folder(file)
    assert file.read_text() == "in the way"


@pytest.mark.parametrize("name", [".", "..", "/", "", "folder", "pipe"])
@pytest.mark.parametrize("write", [require_writable, lambda path: atomic_write(path, "x")])
def test_what_is_no_file_is_not_written_to(tmp_path: Path, monkeypatch, name: str, write):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    kind = "a pipe or a device" if name == "pipe" else "a folder"
    with pytest.raises(InvalidInputError, match=f"^cannot write .*: it is {kind}, not a file;"):
        write(name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "pipe"]


def test_a_file_that_could_be_written_is_not_made(tmp_path: Path):
    (tmp_path / "file").write_text("in the way")
    require_writable(tmp_path / "new" / "x.csv")
    require_writable(tmp_path / "file")
    for path in (tmp_path / "file" / "x.csv", tmp_path / "file" / "deep" / "x.csv", tmp_path):
        with pytest.raises(InvalidInputError, match=r"^cannot write .*choose a writable place$"):
            require_writable(path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "in the way"


def test_writable_folder_is_made_and_left_empty(tmp_path: Path):
    assert ensure_writable_folder(tmp_path / "runs" / "first") == tmp_path / "runs" / "first"
    assert not list((tmp_path / "runs" / "first").iterdir())


def test_a_name_that_is_too_long_is_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"cannot write .*too long"):
        atomic_write(tmp_path / ("x" * 250), "")
    assert not list(tmp_path.iterdir())


def test_files_that_belong_together_are_replaced_together(tmp_path: Path) -> None:
    table, beside = tmp_path / "a.csv", tmp_path / "a.json"
    atomic_write_all({table: "1", beside: b"2"})
    assert (table.read_text(), beside.read_text()) == ("1", "2")
    with pytest.raises(InvalidInputError, match=r"cannot write .*a\.csv/below"):
        atomic_write_all({beside: "new", table / "below": "new"})
    assert (table.read_text(), beside.read_text()) == ("1", "2")
    assert sorted(tmp_path.iterdir()) == [table, beside]


def test_a_folder_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder"
    with pytest.raises(KeyError), atomic_folder(target) as fresh:
        (fresh / "half").write_text("")
        raise KeyError
    assert [*(tmp_path / "new").iterdir()] == []
    with atomic_folder(target) as fresh:
        (fresh / "one").write_text("")
    with pytest.raises(InvalidInputError, match="not empty"), atomic_folder(target) as fresh:
        (fresh / "two").write_text("")
    assert [path.name for path in target.iterdir()] == ["one"]
    with atomic_folder(target, replace=True) as fresh:
        (fresh / "two").write_text("")
    assert [path.name for path in target.iterdir()] == ["two"]
    assert [path.name for path in target.parent.iterdir()] == ["folder"]


def test_a_lock_is_for_one_or_shared(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.touch()
    with path.open() as one, path.open() as other, path.open() as third:
        assert try_lock(one.fileno()) and not try_lock(other.fileno())
        assert not try_lock(other.fileno(), shared=True)
        one.close()
        assert try_lock(other.fileno(), shared=True) and try_lock(third.fileno(), shared=True)
    with path.open() as again:
        assert try_lock(again.fileno())
