"""Data sets where Drake's renderer cannot be: without colours, the rest the same, never mixed."""

from __future__ import annotations

import io
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

import burg_drake as burg
from burg_drake import system_libraries
from burg_drake.apps import main
from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.dataset import DatasetRecipe, check_generated, sample_again
from burg_drake.system_libraries import missing_render_libraries

SCENE, STATION = "tabletop_six", "panda_tabletop"
RECIPE = DatasetRecipe(views=2, sensor="d435", size=(320, 240), normals=True, colors=False)
WITH_COLORS = replace(RECIPE, colors=True)
COMMAND = ["dataset", "generate", "--scenes", SCENE, "--sensor", "d435", "--normals", "--recipe"]
MISSING = (
    "Drake cannot render images without libEGL.so.1; run: sudo apt-get install libegl1"  # Debian's
)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set without colours, made where there are none."""
    folder = tmp_path_factory.mktemp("data") / "set"
    with pytest.MonkeyPatch.context() as patch:
        lose_libraries(patch)
        assert burg.generate_dataset([SCENE], STATION, folder, RECIPE).new == (0,)
    return folder


@pytest.fixture(scope="module")
def colored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with colours."""
    if missing_render_libraries():
        pytest.skip("the renderer's system libraries are missing")
    folder = tmp_path_factory.mktemp("data") / "set"
    assert burg.generate_dataset([SCENE], STATION, folder, WITH_COLORS).new == (0,)
    return folder


@pytest.fixture
def lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without EGL."""
    lose_libraries(monkeypatch)


def lose_libraries(patch: pytest.MonkeyPatch) -> None:
    """Hides EGL from whoever looks for it."""
    patch.setattr(
        system_libraries, "_can_load", lambda name: name != system_libraries.SystemLibrary.egl
    )
    patch.setattr(system_libraries, "_has_mesa_driver", lambda: True)
    patch.setattr(system_libraries.shutil, "which", lambda _: "/usr/bin/apt-get")


def members(folder: Path) -> dict[str, bytes]:
    """Files of the shard."""
    with tarfile.open(folder / "shards/000000.tar") as archive:
        return {one.name: archive.extractfile(one).read() for one in archive}  # type: ignore[union-attr]


def recipe_file(folder: Path) -> str:
    """Of the size and the number of views of `RECIPE_KEY`."""
    path = folder / "recipe.yaml"
    path.write_text("version: 1\nviews: 2\nsize: [320, 240]\n")
    return str(path)


def test_all_that_follows_from_rays_is_the_same(without: Path, colored: Path) -> None:
    mine, theirs = members(without), members(colored)
    exact = [name for name in theirs if name.endswith((".depth.png", "labels.png", "normals.png"))]
    assert len(exact) == 6 and [mine[name] for name in exact] == [theirs[name] for name in exact]
    assert {*theirs} - {*mine} == {"000000_000.color.png", "000000_001.color.png"}
    one, other = burg.load_dataset(without)[1], burg.load_dataset(colored)[1]
    assert one.images.color is None and one.appearance == other.appearance
    for a, b in zip(one.instances, other.instances, strict=True):
        assert np.array_equal(a.amodal, b.amodal) and np.array_equal(a.X_CO, b.X_CO)


def test_python_asks_for_libraries_or_for_no_colours(lost: None, tmp_path: Path) -> None:
    with pytest.raises(MissingDependencyError) as refused:
        burg.generate_dataset([SCENE], STATION, tmp_path / "set", WITH_COLORS)
    assert str(refused.value) == (
        "the recipe has colour images, which cannot be rendered (colors=False leaves them out):"
        f" {MISSING}"
    )
    assert not (tmp_path / "set").exists()
    assert burg.render(SCENE, STATION, "board", ["depth"]).depth is not None
    with pytest.raises(MissingDependencyError, match=r"libEGL\.so\.1"):
        burg.render(SCENE, STATION, "board", ["color"])


def test_the_command_goes_on_and_says_so(
    lost: None, without: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [*COMMAND, recipe_file(tmp_path), "-o", str(tmp_path / "set"), "--quiet"]
    for _ in range(2):  # the second time it continues
        assert main(command) == 0
        assert capsys.readouterr().err == (
            "burg-drake: warning: the data set has no colours, and its sensor depth no holes at"
            f" dark surfaces: {MISSING}\n"
        )
        (tmp_path / "set/shards/000000.tar").rename(tmp_path / "first.tar")
    assert yaml.safe_load((tmp_path / "set/dataset.yaml").read_text())["recipe"]["colors"] is False
    assert (tmp_path / "first.tar").read_bytes() == (without / "shards/000000.tar").read_bytes()
    card = (tmp_path / "set/README.md").read_text()
    assert "| colours | none |" in card and "color (" not in card


def test_colours_are_never_mixed(
    colored: Path,
    without: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(InvalidInputError, match=r"recipe\.colors is False"):
        burg.generate_dataset([SCENE], STATION, without, WITH_COLORS)
    lose_libraries(monkeypatch)
    command = [*COMMAND, recipe_file(tmp_path), "--quiet", "-o", str(colored)]
    assert main(command) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: the samples of {colored} have colours, and so must new ones:"
        f" {MISSING}\n"
    )
    assert main([*command, "--no-colors"]) == 2
    assert "recipe.colors is True there, False here" in capsys.readouterr().err


def test_without_libraries_all_is_checked_and_made_again(
    colored: Path, without: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lose_libraries(monkeypatch)
    assert check_generated(without) == check_generated(colored) == []
    dataset = burg.load_dataset(without)
    stored, again = dataset[1], sample_again(dataset, "000000_001")
    assert again.images.color is None
    assert np.array_equal(stored.images.labels, again.images.labels)
    assert np.abs(stored.sensor_depth - again.sensor_depth).max() < 5.1e-5
    with pytest.raises(MissingDependencyError, match=r"libEGL\.so\.1"):
        sample_again(burg.load_dataset(colored), "000000_001")


@pytest.mark.thorough
def test_sheets_and_exports_do_without_or_say_what_they_need(
    lost: None, without: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["dataset", "show", str(without), "-o", str(tmp_path / "sheet.png")]) == 0
    panels = 3  # depth, the sensor's, labels
    assert Image.open(tmp_path / "sheet.png").width == 6 + panels * (320 + 6)
    for name, said in (("bop", "BOP"), ("coco", "COCO"), ("graspnet", "GraspNet")):
        capsys.readouterr()
        out = tmp_path / name
        assert main(["dataset", "export", str(without), "--to", name, "-o", str(out)]) == 2
        assert capsys.readouterr().err == (
            f"burg-drake: error: sample 000000_000 has no color image, which {said} needs; generate"
            " a data set with color\n"
        )
        assert not out.exists()
    out = tmp_path / "webdataset"
    assert main(["dataset", "export", str(without), "--to", "webdataset", "-o", str(out)]) == 0
    with tarfile.open(out / "shard-000000.tar") as archive:
        assert "000000_000.depth.png" in archive.getnames()
        assert not [name for name in archive.getnames() if name.endswith(".jpg")]


def test_one_look_has_what_can_be_made(
    lost: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    view = tmp_path / "view.png"
    line = f"burg-drake: warning: {view} is not written, as it has colours: {MISSING}\n"
    assert main(["render", SCENE, "-o", str(view)]) == 1
    assert capsys.readouterr() == ("", line) and not list(tmp_path.iterdir())
    assert main(["render", SCENE, "-o", str(view), "--depth", "--labels"]) == 0
    said = capsys.readouterr()
    assert said.err == line and "5 bowl: 6025 pixels" in said.out  # as with colours
    assert sorted(path.name for path in tmp_path.iterdir()) == ["view.depth.png", "view.labels.png"]
    assert Image.open(io.BytesIO((tmp_path / "view.depth.png").read_bytes())).size == (640, 480)
