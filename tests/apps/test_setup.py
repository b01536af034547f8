"""`burg-drake setup` as a process: what it says, and how it ends."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from burg_drake.apps import main
from tests.hang_guard import HANG_GUARD

pytest.importorskip("viser", reason="the page needs viser: pip install 'burg-drake[ui]'")

MUG = """\
version: 1
name: breakfast
library: household
instances:
- object: mug
  X_SO: {translation: [0.2, 0.2, 0]}
"""


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A process that serves the page, and the first line that it says."""
    process = subprocess.Popen(
        [sys.executable, "-m", "burg_drake.apps.cli", "setup", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline()
    finally:
        process.kill()
        process.communicate()


def url_in(line: str) -> str:
    found = re.search(r"open (http://\S+) in a browser", line)
    assert found is not None, line
    return found[1]


def test_a_new_scene(tmp_path: Path) -> None:
    with running(tmp_path) as (process, line):
        assert line.startswith(
            f"new_scene (no objects yet, not saved yet, to be saved in {tmp_path}):"
        )
        with urllib.request.urlopen(url_in(line), timeout=HANG_GUARD) as page:
            assert page.status == 200
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline() == "Press Ctrl-C to end.\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(HANG_GUARD) == 0
        assert (process.stdout.read(), process.stderr.read()) == ("", "\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
def test_an_address_for_one_browser_after_the_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "breakfast.yaml"
    scene.write_text(MUG)
    with running(tmp_path, "breakfast.yaml", "--host", "0.0.0.0") as (process, line):
        assert line.startswith(f"breakfast (1 object, {scene}): open ")
        token = url_in(line).partition("?token=")[2]
        port = url_in(line).partition("?")[0].rstrip("/").rpartition(":")[2]
        assert process.stdout is not None and "Ctrl-C" in process.stdout.readline()
        local = f"http://127.0.0.1:{port}/?token="
        with urllib.request.urlopen(local + token, timeout=HANG_GUARD) as page:
            assert page.status == 200
        line = process.stdout.readline()
        assert re.match(r"opened by 127\.0\.0\.1; another browser: open http://\S+\?token=", line)
        assert line.strip().partition("?token=")[2] != token
        assert main(["setup", str(scene)]) == 2  # a second page on the same scene
        said = capsys.readouterr().err
        assert f":{port}/; use it there" in said and "token" not in said
        process.send_signal(signal.SIGTERM)
        assert process.wait(HANG_GUARD) == 0


def test_a_taken_port(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["setup", "--port", str(port)]) == 2
    assert f"port {port} of 127.0.0.1 is in use; choose another" in capsys.readouterr().err


def test_without_viser(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["setup"]) == 2
    said = capsys.readouterr().err
    assert said == "burg-drake: error: the page needs viser: pip install 'burg-drake[ui]'\n"


def test_small_files_of_huge_pictures_are_refused() -> None:
    """As a process: OpenCV looks for its limit once."""
    program = """
import io
from PIL import Image
from burg_drake.apps.commands.setup import limit_picture_size
limit_picture_size()
from burg_drake.cameras import decode_image
for side in (1000, 12_000):
    file = io.BytesIO()
    Image.new("1", (side, side)).save(file, "png")
    image = decode_image(file.getvalue())
    print(len(file.getvalue()) < 1_000_000, image is not None)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("True True\nTrue False\n", "")
