"""Data sets of what cannot be used: named in one line, and all else is made."""

from __future__ import annotations

import resource
import shutil
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import InvalidInputError, Pose, load_document
from burg_drake.dataset import (
    DatasetRecipe,
    ViewpointSettings,
    check_generated,
    render,
    station_view,
)
from burg_drake.system_libraries import missing_render_libraries

STATION = "panda_tabletop"
RECIPE = DatasetRecipe(views=1, looks=None, colors=False, sensor="kinect", size=(160, 120))
SHARD = "shards/000000.tar"


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two scenes of a library of their own: mug and box, and the box alone."""
    folder = tmp_path_factory.mktemp("scenes")
    six = burg.load_scene("tabletop_six")
    shutil.copytree(six.library.root, folder / "library")
    paths = []
    for names in (("mug", "box"), ("box",)):
        instances = tuple(six.instances[name] for name in names)
        document = replace(six.document, library=str(folder / "library"), instances=instances)
        paths.append(folder / f"{'_'.join(names)}.yaml")
        burg.save_scene(document, paths[-1])
    return paths


@pytest.fixture(scope="module")
def whole(scenes: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of both."""
    folder = tmp_path_factory.mktemp("data") / "set"
    assert burg.generate_dataset(scenes, STATION, folder, RECIPE).new == (0, 1)
    return folder


def test_a_scene_that_a_station_camera_does_not_see(scenes: list[Path], tmp_path: Path) -> None:
    document = burg.load_scene(scenes[1]).document
    away = replace(document.instances[0], X_SO=Pose(translation=(4.0, 0.0, 0.1)))
    library = str(scenes[0].parent / "library")
    burg.save_scene(replace(document, library=library, instances=(away,)), tmp_path / "away.yaml")
    recipe = replace(RECIPE, sensor="", size=None, viewpoints=ViewpointSettings(cameras=("board",)))
    found = burg.generate_dataset(
        [tmp_path / "away.yaml", scenes[1]], STATION, tmp_path / "set", recipe
    )
    assert found.new == (1,) and list(found.failed) == [0]
    assert f"({tmp_path / 'away.yaml'}) was found: of 1 views from 'board', 1" in (found.failed[0])
    assert found.failed[0].endswith("move the camera or the objects, or allow views from nearer")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (None, "mug.sdf cannot be loaded (.*mesh.obj' which does not exist"),
        (b"", "mesh.obj: it has no faces, or vertices that"),
        (b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "mesh.obj: it has no faces, or vertices that"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "mesh.obj is not a mesh that can be seen"),
    ],
)
def test_an_object_without_its_visual_mesh(
    scenes: list[Path], tmp_path: Path, damage: bytes | None, said: str
) -> None:
    mesh = scenes[0].parent / "library/mug/mesh.obj"
    content = mesh.read_bytes()
    mesh.unlink() if damage is None else mesh.write_bytes(damage)
    try:
        found = burg.generate_dataset(scenes, STATION, tmp_path / "set", RECIPE)
        assert found.new == (1,) and list(found.failed) == [0]
        with pytest.raises(InvalidInputError, match=said.replace("(.*", r"\(.*")) as refused:
            render(scenes[0], STATION, kinds=["depth"])
        assert str(refused.value) == found.failed[0]
        if not missing_render_libraries():
            with pytest.raises(InvalidInputError, match=r"mesh\.obj.*; build (its|the) library"):
                render(scenes[0], STATION, kinds=["color"])
    finally:
        mesh.write_bytes(content)
    assert burg.generate_dataset(scenes, STATION, tmp_path / "set", RECIPE).new == (0,)


def test_a_full_disk_ends_it_and_the_same_command_continues(
    scenes: list[Path], whole: Path, tmp_path: Path
) -> None:
    folder, three = tmp_path / "set", [scenes[1], scenes[0], scenes[1]]
    sizes = [(whole / f"shards/00000{number}.tar").stat().st_size for number in (0, 1)]
    assert sizes[0] > sizes[1]  # of two objects, and of one
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (sizes[1], limits[1]))
    try:
        with pytest.raises(InvalidInputError) as refused:
            burg.generate_dataset(three, STATION, folder, RECIPE)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(refused.value) == (
        f"cannot write {folder}/shards/000001.tar: File too large; all shards except this one"
        " are kept: make room, and run the same command to continue"
    )
    assert [path.name for path in (folder / "shards").iterdir()] == ["000000.tar"]
    found = burg.generate_dataset(three, STATION, folder, RECIPE)
    assert (found.known, found.new) == ((0,), (1, 2)) and check_generated(folder) == []


def flipped(near: bytes) -> Callable[[bytes], bytes]:
    """Flips a bit a little behind a text."""

    def change(data: bytes) -> bytes:
        place = data.index(near) + 40
        return data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :]

    return change


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: data[: len(data) // 2], "is truncated within 000000_000."),
        (lambda data: b"", "is truncated after its beginning"),
        (lambda data: data + bytes(512), "bytes, but the index says "),
        (lambda data: bytes(len(data)), "has 0 samples, but the index says 1"),
        (lambda data: b"1" + data[1:], "the checksum of a header is wrong"),
        (flipped(b"IDAT"), "000000_000.depth.png is damaged: its pixels"),
    ],
)
def test_a_damaged_shard_is_named_and_made_anew(
    scenes: list[Path],
    whole: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    damage: Callable[[bytes], bytes],
    said: str,
) -> None:
    folder = shutil.copytree(whole, tmp_path / "set")
    shard, sound = folder / SHARD, (whole / SHARD).read_bytes()
    shard.write_bytes(damage(sound))
    dataset = burg.load_dataset(folder)
    with pytest.raises(InvalidInputError) as refused:
        dataset.read(0)
    message = str(refused.value)
    assert str(shard) in message and said in message
    assert message.endswith("if it does not, delete the shard first")
    assert main(["dataset", "check", str(folder)]) == 1
    assert f"{SHARD}: it" in capsys.readouterr().out
    assert dataset[1].key == "000001_000" and dataset.index("000001_000") == 1
    warning = f"burg-drake: warning: 1 sample is left out: {message}\n"
    for verb, code in ((["show"], 0), (["export", "--to", "webdataset"], 1)):
        out = tmp_path / f"{verb[0]}.png"
        assert main(["dataset", *verb, str(folder), "-o", str(out)]) == code
        assert capsys.readouterr().err == warning
    with tarfile.open(tmp_path / "export.png/shard-000000.tar") as tar:
        assert {name.partition(".")[0] for name in tar.getnames()} == {"000001_000"}
    sheet = cv2.imread(str(tmp_path / "show.png"))
    assert main(["dataset", "show", str(whole), "-o", str(tmp_path / "whole.png")]) == 0
    assert cv2.imread(str(tmp_path / "whole.png")).shape[0] > 1.8 * sheet.shape[0]
    again = burg.generate_dataset(scenes, STATION, folder, RECIPE)
    assert (again.known, again.new) == ((1,), (0,)) and shard.read_bytes() == sound


def test_nothing_is_exported_of_what_is_all_damaged(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = shutil.copytree(whole, tmp_path / "set"), tmp_path / "out"
    for shard in (folder / "shards").iterdir():
        shard.unlink()
    for verb in (["show"], ["export", "--to", "webdataset"]):
        assert main(["dataset", *verb, str(folder), "-o", f"{out}.png"]) == 2
        assert capsys.readouterr().err.startswith(
            f"burg-drake: error: no sample of {folder} can be read; the first error is: cannot"
            f" read shard {folder / SHARD}: No such file or directory; repeat the command"
        )
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_a_data_set_of_another_version(
    scenes: list[Path], whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shutil.copytree(whole, tmp_path / "set")
    document = folder / "dataset.yaml"
    document.write_text(document.read_text().replace("version: 1", "version: 2", 1))
    out = ["-o", str(tmp_path / "out.png")]
    for arguments in (
        ["check", str(folder)],
        ["show", str(folder), *out],
        ["export", str(folder), "--to", "webdataset", *out],
        ["generate", "--scenes", str(scenes[0]), "-o", str(folder), "--no-colors"],
    ):
        assert main(["dataset", *arguments]) == 2
        assert capsys.readouterr().err == (
            f"burg-drake: error: {document}:3: version: 2 cannot be read; this release reads"
            " version 1\n"
        )


def test_intrinsics_that_do_not_fit_the_image(tmp_path: Path) -> None:
    station = burg.load_station(STATION)
    view = station_view(station, "board")
    other = replace(view.intrinsics, center=(959.5, 539.5))  # of another size
    with pytest.raises(
        InvalidInputError, match=r"principal point 959\.5, 539\.5 is outside of the"
    ):
        render("tabletop_six", station, replace(view, intrinsics=other), ["color"])
    wrong = replace(station.document.cameras["board"], center=(959.5, 539.5))
    document = replace(station.document, cameras={"board": wrong})
    with pytest.raises(InvalidInputError, match=r"959\.5, 539\.5 .*is outside the image"):
        burg.build_station_diagram(
            "tabletop_six", replace(station, document=document), robot="none", cameras=True
        )
    edge = replace(view.intrinsics, center=(-0.49, 479.49))
    images = render("tabletop_six", station, replace(view, intrinsics=edge), ["depth"])
    assert images.depth is not None and np.isfinite(images.depth).all()


def test_sizes_that_a_sensor_does_not_have(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    for size, said in (
        ("[640, 100]", "d435 has no depth images of 640 x 100 pixels; give a size"),
        ("[640, 0]", "d435 has no depth images of 640 x 0 pixels"),
        (
            "[32000, 24000]",
            "image of 32000 x 24000 pixels; a side may have at most 16,384",
        ),
    ):
        path.write_text(f"version: 1\nsensor: d435\nsize: {size}\n")
        with pytest.raises(InvalidInputError) as refused:
            load_document(path, DatasetRecipe)
        assert str(refused.value).startswith(f"{path}:3: {said}")
    assert DatasetRecipe(sensor="azure_kinect").size is None  # as they are, 640 x 576
