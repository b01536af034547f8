"""Folders of scenes: the same bytes however they come about, and going on where they were left."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from burg_drake.core import DocumentError, InvalidInputError
from burg_drake.generation import SampledFolder, sample_scenes
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Board, SceneRecipe
from burg_drake.station import Station

RECIPE = SceneRecipe(
    library="household",
    count=3,
    only=("box", "can", "marble", "mug"),
    board=Board(size=(0.297, 0.21)),
    settle=False,
    attempts=2,
)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def sampled(
    tmp_path_factory: pytest.TempPathFactory, household: ObjectLibrary, tabletop: Station
) -> Path:
    """Twelve scenes, sampled by this process in one go."""
    folder = tmp_path_factory.mktemp("sampled") / "whole"
    sample_scenes(RECIPE, household, tabletop, folder, 12)
    return folder


@pytest.fixture
def whole(sampled: Path, tmp_path: Path) -> Path:
    """A copy of them, that a test may change."""
    return shutil.copytree(sampled, tmp_path / "whole")


@pytest.mark.thorough
def test_the_same_bytes_by_workers_and_after_a_kill(
    tmp_path: Path, whole: Path, household: ObjectLibrary, tabletop: Station
) -> None:
    part = tmp_path / "part"
    program = (
        "import burg_drake as burg\n"
        "from burg_drake.core import load_document\n"
        "from burg_drake.scene.scene_document import SamplingProvenance\n"
        f"recipe = load_document({str(whole / 'recipe.yaml')!r}, SamplingProvenance).recipe\n"
        "library, station = burg.load_library('household'), burg.load_station('panda_tabletop')\n"
        f"burg.sample_scenes(recipe, library, station, {str(part)!r}, 12, workers=2)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", program], env=environment)
    while len(list(part.glob("scene_*.yaml"))) < 3 and process.poll() is None:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    with (part / "scenes.csv").open("a") as table:
        table.write("9,yes,3")  # torn
    found = sample_scenes(RECIPE, household, tabletop, part, 12)
    assert len(found.rows) == 12
    assert contents(part) == contents(whole)


def test_what_is_there_is_not_sampled_again(
    whole: Path, household: ObjectLibrary, tabletop: Station
) -> None:
    before = contents(whole)
    accepted = sorted(whole.glob("scene_*.yaml"))
    assert 0 < len(accepted) < 12  # some are refused, which is remembered
    assert sample_scenes(RECIPE, household, tabletop, whole, 12).new == ()
    accepted[0].unlink()
    found = sample_scenes(RECIPE, household, tabletop, whole, 12)
    assert found.new == (int(accepted[0].stem[-4:]),)
    assert contents(whole) == before
    more: SampledFolder = sample_scenes(RECIPE, household, tabletop, whole, 13)
    assert more.new == (12,)


def test_damaged_files(whole: Path, household: ObjectLibrary, tabletop: Station) -> None:
    """A table is made again from what is there; a scene that someone may have edited is not."""
    before = contents(whole)
    (whole / "scenes.csv").write_bytes(b"\x87\x00\xff" * 50)
    sample_scenes(RECIPE, household, tabletop, whole, 12)
    assert contents(whole) == before
    scene = min(whole.glob("scene_*.yaml"))
    text = scene.read_bytes()
    scene.write_bytes(b"")
    with pytest.raises(DocumentError, match=f"{scene.name}: .*empty.*; fix the file, or delete it"):
        sample_scenes(RECIPE, household, tabletop, whole, 12)
    scene.write_bytes(text)


def test_another_recipe_is_refused(
    whole: Path, tmp_path: Path, household: ObjectLibrary, tabletop: Station
) -> None:
    before = contents(whole)
    other = replace(RECIPE, seed=8, only=(), layout="close", fewer=True)
    with pytest.raises(InvalidInputError) as caught:
        sample_scenes(other, household, tabletop, whole, 12)
    assert str(caught.value) == (
        f"{whole} already holds other scenes (only is box, can, marble, mug there, none here;"
        " layout is random there, close here; fewer is off there, on here; seed is 0 there, 8"
        " here); choose another folder, or delete it"
    )
    assert contents(whole) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("")
    with pytest.raises(InvalidInputError, match="is not empty, but has no sampled scenes"):
        sample_scenes(RECIPE, household, tabletop, tmp_path / "mine", 1)
