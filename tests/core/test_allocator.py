"""Workers start with a faster allocator, if there is one that works, and nobody else does."""

from __future__ import annotations

import logging
import resource
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
import worker_jobs as jobs

from burg_drake.core import (
    AllocatorSettings,
    WorkerPool,
    installed_allocators,
    worker_preload,
    worker_processes,
)
from tests.hang_guard import HANG_GUARD

linux = pytest.mark.skipif(sys.platform != "linux", reason="nothing is preloaded elsewhere")


@pytest.fixture(autouse=True)
def nothing_given(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (AllocatorSettings.variable, AllocatorSettings.preload_variable):
        monkeypatch.delenv(name, raising=False)
    worker_processes._warn_unusable.cache_clear()


@pytest.fixture
def library() -> Path:
    """An allocator of this machine that works."""
    if not any(map(can_be_opened, installed_allocators())):
        pytest.skip("there is no allocator that works on this machine")
    return Path(worker_preload({})[AllocatorSettings.preload_variable])


def can_be_opened(path: Path) -> bool:
    """By a process of its own, into which it stays."""
    program = f"import ctypes; ctypes.CDLL({str(path)!r})"
    return subprocess.run([sys.executable, "-c", program], capture_output=True).returncode == 0


@pytest.fixture
def maths() -> str:
    """A library of the system that is no allocator."""
    import math  # noqa: F401

    found = [file for file in jobs.mapped_files() if Path(file).name.startswith("libm.so")]
    if not found:
        pytest.skip("this Python does not use the system's libm")
    return found[0]


def of(path: Path | str, **environment: str) -> dict[str, str]:
    return worker_preload({AllocatorSettings.variable: str(path), **environment})


# --- what is found --------------------------------------------------------------------------------


def test_the_package_comes_first_and_the_best_of_the_system_then(tmp_path: Path) -> None:
    places = [tmp_path / "one", tmp_path / "two"]
    packages = [tmp_path / "none", tmp_path / "packages"]
    system = [
        places[1] / AllocatorSettings.system_libraries[0],
        *(places[0] / name for name in AllocatorSettings.system_libraries[1:]),
    ]
    for path in [packages[1] / AllocatorSettings.wheel_library, *system]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    found = installed_allocators(["", *map(str, packages)], [*map(str, places)])
    assert list(found) == [packages[1] / AllocatorSettings.wheel_library, *system]


@linux
def test_the_first_that_works_is_taken(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "libmimalloc.so"
    broken.write_text("GROUP ( libmimalloc.so.3 )")
    monkeypatch.setattr(worker_processes, "installed_allocators", lambda: iter([broken, library]))
    assert worker_preload({}) == {AllocatorSettings.preload_variable: str(library)}
    monkeypatch.setattr(worker_processes, "installed_allocators", lambda: iter([broken]))
    assert worker_preload({}) == {}


@linux
def test_the_package_has_its_library_where_it_is_looked_for() -> None:
    try:
        distribution = metadata.distribution("cmeel-mimalloc")
    except metadata.PackageNotFoundError:
        pytest.skip("cmeel-mimalloc is not installed")
    assert next(installed_allocators()) == Path(
        str(distribution.locate_file(AllocatorSettings.wheel_library))
    )


# --- what is refused ------------------------------------------------------------------------------


@linux
def test_what_cannot_be_used_is_told_once_and_nothing_is_preloaded(
    library: Path,
    maths: str,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    cut, text = tmp_path / "libcut.so", tmp_path / "libtext.so"
    cut.write_bytes(library.read_bytes()[:2000])
    text.write_text("mimalloc")
    spaced = tmp_path / "a b" / "libmimalloc.so"
    spaced.parent.mkdir()
    spaced.write_bytes(library.read_bytes())
    unsuitable = "is not an allocator that can be preloaded on this system"
    unnamed = "has a space or a colon in its path and so cannot be preloaded"
    absent = tmp_path / "absent.so"
    expected = dict.fromkeys((cut, text, tmp_path, Path(maths)), unsuitable)
    for path, why in (expected | {spaced: unnamed, absent: "cannot be found"}).items():
        caplog.clear()
        with caplog.at_level(logging.WARNING, "burg_drake"):
            assert of(path) == of(path) == {}
        assert caplog.messages == [
            f"{AllocatorSettings.variable}: {path} {why}; workers run without it"
        ]
    assert capfd.readouterr() == ("", "")


@linux
def test_an_allocator_that_ends_the_process_is_refused(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "libmimalloc.so"
    copy.write_bytes(library.read_bytes())
    monkeypatch.setattr(
        worker_processes, "ALLOCATOR_PROBE", "import os, signal; os.kill(os.getpid(), 11)"
    )
    assert of(copy) == {}


@linux
def test_it_is_tried_in_the_environment_that_is_given(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoilt = "import os\nif 'SPOILT' in os.environ: raise SystemExit(1)\n"
    monkeypatch.setattr(
        worker_processes, "ALLOCATOR_PROBE", spoilt + worker_processes.ALLOCATOR_PROBE
    )
    monkeypatch.setenv("SPOILT", "1")
    assert of(library, MARK="1") == {AllocatorSettings.preload_variable: str(library)}
    monkeypatch.delenv("SPOILT")
    assert of(library, SPOILT="1") == {}


@linux
def test_one_that_was_replaced_is_tried_again(library: Path, tmp_path: Path) -> None:
    copy = tmp_path / "libmimalloc.so"
    copy.write_bytes(library.read_bytes()[:2000])
    assert of(copy) == {}
    copy.write_bytes(library.read_bytes())
    assert of(copy) == {AllocatorSettings.preload_variable: str(copy)}


# --- what the user says ---------------------------------------------------------------------------


def test_it_can_be_turned_off() -> None:
    assert of("none") == of(" None ") == {}


def test_nothing_is_done_on_macos(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert worker_preload({}) == {}


@linux
def test_nothing_is_done_where_address_space_is_limited(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1 << 33, 1 << 33))
    assert worker_preload({}) == of(library) == {}


@linux
def test_what_the_user_preloads_stays(library: Path, maths: str) -> None:
    assert of(library, **{AllocatorSettings.preload_variable: maths}) == {
        AllocatorSettings.preload_variable: f"{maths}:{library}"
    }


@linux
def test_the_users_own_allocator_stays_alone(library: Path, tmp_path: Path) -> None:
    own = tmp_path / "libmine.so"
    own.write_bytes(library.read_bytes())
    assert worker_preload({AllocatorSettings.preload_variable: str(own)}) == {}


# --- workers --------------------------------------------------------------------------------------


@linux
@pytest.mark.parametrize("preloaded", [False, True])
def test_workers_have_it_and_what_they_start_does_not(
    library: Path, maths: str, monkeypatch: pytest.MonkeyPatch, preloaded: bool
) -> None:
    if preloaded:
        monkeypatch.setenv(AllocatorSettings.preload_variable, maths)
    with WorkerPool(1) as pool:
        assert str(library) in pool.submit(jobs.mapped_files).result(HANG_GUARD)
        preload, files = pool.submit(jobs.preloaded_in_a_child).result(HANG_GUARD)
    assert preload == (maths if preloaded else None)
    assert str(library) not in files


@linux
def test_results_are_the_same_without(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [jobs.sums_of_many_arrays()]
    for given in (str(library), "none"):
        monkeypatch.setenv(AllocatorSettings.variable, given)
        with WorkerPool(1) as pool:
            files = pool.submit(jobs.mapped_files).result(HANG_GUARD)
            assert (str(library) in files) is (given != "none")
            found.append(pool.submit(jobs.sums_of_many_arrays).result(HANG_GUARD))
    assert len(set(found)) == 1


@linux
def test_a_process_that_is_no_worker_keeps_its_own(library: Path) -> None:
    with WorkerPool(1) as pool:
        pool.submit(jobs.square, 2).result(HANG_GUARD)
    assert str(library) not in jobs.mapped_files()
    assert (
        AllocatorSettings.preload_variable
        not in subprocess.run(["env"], capture_output=True, text=True).stdout
    )
