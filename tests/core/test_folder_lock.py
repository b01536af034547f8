"""The lock of a folder: one holder at a time, whose end releases it."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.core import FolderLock, InvalidInputError

HELD = """
import sys
from pathlib import Path
from burg_drake.core import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def test_one_process_holds_it_until_it_is_killed(tmp_path: Path) -> None:
    root = str(Path(__file__).parents[2])
    holder = subprocess.Popen(
        [sys.executable, "-c", HELD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": root},
    )
    try:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        with pytest.raises(InvalidInputError) as refused:
            FolderLock(tmp_path)
    finally:
        holder.kill()
        holder.communicate()
    assert str(refused.value) == (
        f"{tmp_path} is being written by another process; wait for it, or choose another folder"
    )
    assert refused.value.arguments == ("folder",)
    lock = FolderLock(tmp_path)
    lock.release()
    lock.release()
    FolderLock(tmp_path).release()
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"cannot open .*lost: No such file"):
        FolderLock(tmp_path / "lost")


def test_a_file_system_without_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(file: int, kind: int) -> None:
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with pytest.raises(InvalidInputError, match="file system without file locks"):
        FolderLock(tmp_path)
