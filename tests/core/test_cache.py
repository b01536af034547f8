"""The cache gives back the bits that were computed, and never stands in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import Arrays, InvalidInputError, cache, cache_folder, cached

KEY = "0123456789abcdef" * 4
ARRAYS = {"x": np.array([0.1, np.nan, -0.0]), "k": np.arange(6).reshape(2, 3), "b": np.array(True)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("BURG_DRAKE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def compute() -> Arrays:
    return ARRAYS


def never() -> Arrays:
    raise AssertionError("computed once more")


def assert_same(found: Arrays) -> None:
    assert set(found) == set(ARRAYS)
    for name, values in ARRAYS.items():
        assert (found[name].dtype, found[name].shape) == (values.dtype, values.shape)
        assert found[name].tobytes() == values.tobytes()


def entry(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def test_what_is_kept_is_not_computed_again(folder: Path) -> None:
    assert_same(cached("thing", KEY, compute))
    assert_same(cached("thing", KEY, never))
    for other in (("thing", KEY[::-1]), ("another", KEY)):
        with pytest.raises(AssertionError, match="once more"):
            cached(*other, never)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:300])


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[data.index(np.arange(6).tobytes()) + 9] ^= 1
    path.write_bytes(data)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def objects(path: Path) -> None:
    np.savez(path, made_by=np.array([{}], dtype=object))


@pytest.mark.parametrize("damage", [cut, flip, empty, objects])
def test_a_damaged_entry_is_told_and_replaced(
    folder: Path, damage: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    cached("thing", KEY, compute)
    damage(entry(folder))
    assert_same(cached("thing", KEY, compute))
    (line,) = caplog.messages
    assert str(entry(folder)) in line and line.endswith(
        "; this was only a cached copy, so the result is computed again"
    )
    assert_same(cached("thing", KEY, never))


def test_an_entry_of_another_version_is_told_and_replaced(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = ("thing", "another")
    for kind in kinds:
        cached(kind, KEY, compute)
    monkeypatch.setattr(cache, "_code_version", lambda: ("another",))
    for kind in kinds:
        assert_same(cached(kind, KEY, compute))
    (line,) = caplog.messages
    assert line.startswith(f"burg-drake: the cache in {folder} was made with another version")
    assert line.endswith("You need not do anything")
    for kind in kinds:
        assert_same(cached(kind, KEY, never))


def test_another_version_is_told_once_by_all_processes_of_one_version(folder: Path) -> None:
    program = (
        "import sys; from burg_drake.core import cache; import numpy as np\n"
        "cache._code_version = lambda: (sys.argv[1],)\n"
        "cache.cached(sys.argv[2], '0' * 64, lambda: {'x': np.zeros(3)})"
    )

    def told(version: str, *kinds: str) -> int:
        """How often, by processes of a version that run at once."""
        running = [
            subprocess.Popen([sys.executable, "-c", program, version, kind], stderr=subprocess.PIPE)
            for kind in kinds
        ]
        return b"".join(process.communicate()[1] for process in running).count(b"another version")

    kinds = ("a", "b")
    assert [told(version, *kinds) for version in ("1", "2", "2", "1")] == [0, 1, 0, 1]
    assert len(list(folder.glob(".told-*"))) == 1


def test_a_package_without_metadata_is_no_obstacle(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "VERSIONED_PACKAGES", ("numpy", "built-from-source"))
    monkeypatch.setattr(cache, "_code_version", cache._code_version.__wrapped__)
    assert_same(cached("thing", KEY, compute))
    assert_same(cached("thing", KEY, never))


def test_a_folder_that_cannot_be_written_costs_nothing_but_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("not a folder")
    for place in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/none")):
        monkeypatch.setenv("BURG_DRAKE_CACHE", str(place))
        assert_same(cached("thing", KEY, compute))
    monkeypatch.setenv("BURG_DRAKE_CACHE", "off")
    assert_same(cached("thing", KEY, compute))
    assert (tmp_path / "file").read_text() == "not a folder"
    assert not caplog.messages


def test_the_entries_longest_unused_go_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir()
    (folder / "notes.txt").write_text("somebody's")
    killed = folder / ".thing.npz.0123456789abcdef"
    killed.write_text("unfinished")
    os.utime(killed, (1.0, 1.0))
    for k in range(4):
        cached(f"thing-{k}", KEY, compute)
        os.utime(folder / f"thing-{k}-{KEY[:32]}.npz", (100.0 * k, 100.0 * k))
    size = (folder / f"thing-0-{KEY[:32]}.npz").stat().st_size
    cached("thing-0", KEY, never)  # marks it as in use
    monkeypatch.setattr(cache, "MAX_CACHE_BYTES", 3 * size)
    cached("thing-4", KEY, compute)
    left = {path.name.removesuffix(f"-{KEY[:32]}.npz") for path in folder.iterdir()}
    assert left == {"thing-0", "thing-3", "thing-4", "notes.txt"}


def test_several_processes_at_once(folder: Path) -> None:
    program = (
        "import numpy as np; from burg_drake.core.cache import cached\n"
        "for k in range(30):\n"
        "    x = cached('thing', f'{k % 5}' * 64, lambda: {'x': np.full(20_000, k % 5)})['x']\n"
        "    assert (x == k % 5).all() and len(x) == 20_000"
    )
    running = [
        subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE) for _ in range(3)
    ]
    assert [process.communicate()[1] for process in running] == [b""] * 3
    assert len(list(folder.iterdir())) == 5


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"BURG_DRAKE_CACHE": "/a/b", "XDG_CACHE_HOME": "/c"}, "/a/b"),
        ({"BURG_DRAKE_CACHE": "~/mine"}, "/home/me/mine"),
        ({"BURG_DRAKE_CACHE": "OFF", "XDG_CACHE_HOME": "/c"}, None),
        ({"XDG_CACHE_HOME": "/c"}, "/c/burg_drake"),
        ({}, "/home/me/.cache/burg_drake"),
        ({"platform": "darwin"}, "/home/me/Library/Caches/burg_drake"),
    ],
)
def test_the_folder_is_the_user_s(
    given: dict[str, str], expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("BURG_DRAKE_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/me")
    monkeypatch.setattr(sys, "platform", given.pop("platform", "linux"))
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    assert cache_folder() == (None if expected is None else Path(expected))


def test_the_home_of_nobody_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BURG_DRAKE_CACHE", "~nobody_of_this_name/cache")
    with pytest.raises(
        InvalidInputError, match=r"^BURG_DRAKE_CACHE: ~nobody_of.*write the whole path"
    ):
        cache_folder()
