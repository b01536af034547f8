"""No Blender, and one that fails: said in one line, and nothing hangs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import FieldError, MissingDependencyError, SimulationError, UnknownNameError
from burg_drake.dataset import BLENDER_ENVIRONMENT_VARIABLE, Blender, BlenderScene, blender_command
from tests.dataset.blender_parts import image_of


def test_no_blender(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(BLENDER_ENVIRONMENT_VARIABLE, "no_such_blender")
    with pytest.raises(
        MissingDependencyError,
        match=r"'no_such_blender'.*pip install",
    ):
        burg.render("tabletop_six", "panda_tabletop", renderer="blender")
    recipe = burg.dataset.DatasetRecipe(renderer="blender", views=1)
    with pytest.raises(MissingDependencyError, match=r"no_such_blender"):
        burg.generate_dataset(["tabletop_six"], "panda_tabletop", tmp_path / "data", recipe)
    assert not (tmp_path / "data").exists()


def test_a_python_without_bpy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -S "$@"\n')
    bare.chmod(0o755)
    monkeypatch.setenv(BLENDER_ENVIRONMENT_VARIABLE, str(bare))
    with pytest.raises(MissingDependencyError, match="No module named 'bpy'"):
        Blender(blender_command())


def test_the_command_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(BLENDER_ENVIRONMENT_VARIABLE, "no_such_blender")
    out = tmp_path / "view.png"
    assert main(["render", "tabletop_six", "--renderer", "blender", "-o", str(out)]) != 0
    assert "pip install 'burg-drake[blender]'" in capsys.readouterr().err and not out.exists()


def test_labels_need_no_blender(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BLENDER_ENVIRONMENT_VARIABLE, "no_such_blender")
    kinds = ("depth", "labels")
    ours = burg.render("tabletop_six", "panda_tabletop", "board", kinds, renderer="blender")
    drakes = burg.render("tabletop_six", "panda_tabletop", "board", kinds)
    assert np.array_equal(ours.depth, drakes.depth) and np.array_equal(ours.labels, drakes.labels)


def test_no_such_renderer() -> None:
    with pytest.raises(UnknownNameError, match=r"'blendr'.*'blender'"):
        burg.render("tabletop_six", "panda_tabletop", renderer="blendr")  # type: ignore[arg-type]
    with pytest.raises(FieldError, match=r"'blendr'.*'blender'"):
        burg.dataset.DatasetRecipe(renderer="blendr")  # type: ignore[arg-type]


def program(after: str) -> list[str]:
    """A process that says that it is a Blender, and does something when it is asked."""
    code = f'import os, sys, json; print(\'{{"version": "0"}}\', flush=True)\n{after}'
    return [sys.executable, "-c", code]


EMPTY = BlenderScene((), ())


def test_a_crash_is_told_with_the_last_lines() -> None:
    dying = Blender(
        program("sys.stdin.readline(); os.write(2, b'first\\n\\nout of memory\\n'); os.abort()")
    )
    with pytest.raises(
        SimulationError,
        match=r"SIGABRT while loading a scene; .*first \| out of memory$",
    ):
        image_of(dying, EMPTY)
    assert not dying.alive
    with pytest.raises(SimulationError, match=r"^Blender ended by SIGABRT"):
        image_of(dying, EMPTY)


def test_an_end_and_a_refusal() -> None:
    with pytest.raises(SimulationError, match=r"^Blender ended with code 3 while loading a"):
        image_of(Blender(program("sys.stdin.readline(); sys.exit(3)")), EMPTY)
    failing = Blender(program('for line in sys.stdin: print(\'{"error": "no"}\', flush=True)'))
    with pytest.raises(SimulationError, match=r"^Blender failed while loading a scene: no$"):
        image_of(failing, EMPTY)
    failing.close()


def test_nobody_gets_the_answer_to_an_interrupted_question() -> None:
    """The process ends with the question."""
    waiting = Blender(
        program("import signal; sys.stdin.readline(); os.kill(os.getppid(), signal.SIGINT)\n"
                "sys.stdin.read()")
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        image_of(waiting, EMPTY)
    waiting.close()
    assert not waiting.alive


def test_half_an_image_is_none() -> None:
    half = Blender(
        program(
            "for line in sys.stdin:\n"
            "    if 'output' in line: open(json.loads(line)['output'], 'wb').write(b'\\x89PNG')\n"
            "    print('{}', flush=True)"
        )
    )
    with pytest.raises(SimulationError, match=r"^Blender wrote no image; it printed nothing$"):
        image_of(half, EMPTY)
    half.close()
