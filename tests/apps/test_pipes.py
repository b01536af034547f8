"""Files that come through a pipe: where they work as files do, and what is said elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.apps.options import values
from burg_drake.core import GraspSet

INTRINSICS = "version: 1\nwidth: 640\nheight: 480\nfocal: [600, 610]\ncenter: [319.5, 239.5]\n"

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")


@pytest.fixture
def grasps(tmp_path: Path) -> Path:
    path = tmp_path / "grasps.h5"
    X_OG = np.tile(np.eye(4), (3, 1, 1))
    X_OG[:, 0, 3] = 0.0, 0.01, 0.02
    ids, score = np.array(["a", "b", "c"]), np.ones(3)
    GraspSet(
        X_OG=X_OG, width=np.full(3, 0.03), object=np.array(["box"] * 3), id=ids, score=score
    ).save(path)
    return path


@pytest.fixture
def piped() -> Iterator[Callable[[bytes], str]]:
    """Gives the name that a shell's `<(...)` stands for; the content fits into the pipe."""
    opened = []

    def name(content: bytes) -> str:
        reading, writing = os.pipe()
        opened.append(reading)
        os.write(writing, content)
        os.close(writing)
        return f"/dev/fd/{reading}"

    yield name
    for reading in opened:
        os.close(reading)


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(arguments) == 0
    return capsys.readouterr().out


def test_a_pipe_is_as_good_as_the_file(
    tmp_path: Path,
    grasps: Path,
    piped: Callable[[bytes], str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    camera = tmp_path / "K.yaml"
    camera.write_text(INTRINSICS)
    monkeypatch.chdir(tmp_path)  # tables depend on the width of the names
    for verb, file in ((("camera", "show"), camera), (("grasps", "stats"), grasps)):
        expected = printed(capsys, *verb, file.name)
        found = printed(capsys, *verb, piped(file.read_bytes()))
        assert found.split("\n")[1:] == expected.split("\n")[1:]  # the first line may name the file


@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
def test_the_standard_input(tmp_path: Path, name: str) -> None:
    command = [
        sys.executable,
        "-m",
        "burg_drake.apps.cli",
        "camera",
        "convert",
        name,
        "-o",
        "K.yaml",
    ]
    done = subprocess.run(command, input=INTRINSICS, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "focal: [600.0, 610.0]" in (tmp_path / "K.yaml").read_text()


@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
def test_errors_name_the_standard_input(tmp_path: Path, name: str) -> None:
    command = [sys.executable, "-m", "burg_drake.apps.cli", "camera", "show", name]
    wrong = INTRINSICS.replace("600", "abc")
    done = subprocess.run(command, input=wrong, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("burg-drake: error: standard input:4: focal")


def test_errors_name_the_pipe(
    piped: Callable[[bytes], str], capsys: pytest.CaptureFixture[str]
) -> None:
    for verb in (("camera", "show"), ("grasps", "stats")):
        pipe = piped(INTRINSICS.replace("600", "abc").encode())
        assert main([*verb, pipe]) == 2
        error = capsys.readouterr().err
        assert pipe in error and "burg-drake-pipe" not in error


def test_a_pipe_that_never_ends_is_read_within_bounds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    read = values.read_pipe
    monkeypatch.setattr(values, "read_pipe", lambda pipe: read(pipe, 1000))
    endless = subprocess.Popen(["yes"], stdout=subprocess.PIPE)
    assert endless.stdout is not None
    with pytest.raises(SystemExit) as end:
        main(["camera", "show", f"/dev/fd/{endless.stdout.fileno()}"])
    endless.stdout.close()
    endless.kill()
    endless.wait()
    assert end.value.code == 2
    assert "more than 0 MiB arrived; save it to a file first" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ("scene", "validate", "PIPE"),
        ("station", "check", "PIPE"),
        ("hand", "check", "PIPE"),
        ("trials", "show", "PIPE"),
    ],
)
def test_what_is_read_in_its_folder_has_to_be_a_file(
    arguments: tuple[str, ...],
    piped: Callable[[bytes], str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    pipe = piped(b"version: 1\n")
    assert main([pipe if a == "PIPE" else a for a in arguments]) == 2
    error = capsys.readouterr().err
    assert (
        error == f"burg-drake: error: cannot read {pipe}: it is a pipe; save it to a file first\n"
    )


def test_a_mesh_has_to_be_a_file(
    tmp_path: Path, piped: Callable[[bytes], str], capsys: pytest.CaptureFixture[str]
) -> None:
    pipe = piped(b"v 0 0 0\n")
    main(["library", "build", pipe, "-o", str(tmp_path / "library"), "--workers", "1"])
    assert f"{pipe}: it is a pipe; save it to a file first" in capsys.readouterr().err
