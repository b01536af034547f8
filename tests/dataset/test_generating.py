"""Data sets of many scenes: the same by any number of workers, continued, and made again alone."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import FieldError, InvalidInputError, Pose
from burg_drake.dataset import (
    DatasetRecipe,
    ViewpointSettings,
    check_generated,
    sample_again,
)

SCENES = ["tabletop_six", "tabletop_close"]
RECIPE = DatasetRecipe(views=2, sensor="d435", size=(320, 240), grasps_per_object=5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set."""
    made = tmp_path_factory.mktemp("data") / "set"
    found = burg.generate_dataset(SCENES, "panda_tabletop", made, RECIPE)
    assert found.new == (0, 1) and not found.failed
    return made


def sums(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((folder / "shards").iterdir())
    }


@pytest.mark.thorough  # the cluster's workers make the same bytes, too
def test_the_same_bytes_by_two_workers_and_after_a_stop(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "set"
    burg.generate_dataset(SCENES, "panda_tabletop", again, RECIPE, workers=2)
    assert sums(again) == sums(folder)
    lost = again / "shards" / "000001.tar"
    lost.unlink()  # as if the process had been killed before it was complete
    (again / "shards" / ".unfinished").touch()
    found = burg.generate_dataset(SCENES, "panda_tabletop", again, RECIPE)
    assert (found.known, found.new) == ((0,), (1,))
    assert sums(again)[lost.name] == sums(folder)[lost.name]
    keys = burg.load_dataset(again).keys
    assert keys == ("000000_000", "000000_001", "000001_000", "000001_001")


def test_a_sample_made_again_alone(folder: Path) -> None:
    dataset = burg.load_dataset(folder)
    stored, again = dataset[3], sample_again(dataset, "000001_001")
    assert np.array_equal(stored.images.color, again.images.color)
    assert np.array_equal(stored.images.labels, again.images.labels)
    assert np.abs(stored.images.depth - again.images.depth).max() < 5.1e-5
    assert np.abs(stored.sensor_depth - again.sensor_depth).max() < 5.1e-5
    assert np.array_equal(stored.view.X_SC, again.view.X_SC)
    assert stored.grasps is not None and len(stored.grasps) > 10
    assert stored.view.intrinsics.width == 320


def test_a_sound_data_set_is_sound(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_generated(folder) == []
    assert main(["dataset", "check", str(folder)]) == 0
    assert "4 samples, nothing is wrong" in capsys.readouterr().out


def test_other_content_is_refused(folder: Path) -> None:
    other = DatasetRecipe(views=2, sensor="d435", size=(320, 240), grasps_per_object=5, seed=1)
    with pytest.raises(InvalidInputError, match=r"holds another data set \(.*seed is 0 there"):
        burg.generate_dataset(SCENES, "panda_tabletop", folder, other)


def test_a_scene_that_fails_leaves_the_others(tmp_path: Path) -> None:
    """No view shows all objects of a scene whose mug stands three metres away."""
    scene = burg.load_scene("tabletop_six")
    moved = [
        replace(one, X_SO=Pose(translation=(3.0, 0.1, 0.0))) if name == "mug" else one
        for name, one in scene.instances.items()
    ]
    library = str(scene.library.root)
    document = replace(scene.document, library=library, instances=tuple(moved))
    burg.save_scene(document, tmp_path / "apart.yaml")
    recipe = DatasetRecipe(views=1, looks=None, viewpoints=ViewpointSettings(in_view=1.0))
    scenes = [tmp_path / "apart.yaml", "tabletop_six"]
    found = burg.generate_dataset(scenes, "panda_tabletop", tmp_path / "set", recipe)
    assert found.new == (1,) and list(found.failed) == [0]
    assert "apart" in found.failed[0] and "view" in found.failed[0]
    assert burg.load_dataset(tmp_path / "set").keys == ("000001_000",)


def test_bad_requests(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FieldError, match=r"sampled or taken from a run; give only one"):
        DatasetRecipe(run="runs/first", grasps_per_object=3)
    with pytest.raises(InvalidInputError, match=r"no depth images of 640 x 100"):
        DatasetRecipe(sensor="d435", size=(640, 100))
    output = ["-o", str(tmp_path / "data")]
    for arguments, told in (
        (["--scenes", str(tmp_path / "*.yaml")], "there is no such file"),
        (["--sample", "household"], "as in household:1000"),
        (["--scenes", "tabletop_six", "--grasps", "sample:no"], "as in sample:100"),
        (["--scenes", "tabletop_six", "--sensor", "d436"], "'d436'"),
        (["--scenes", "tabletop_six", "--camera", "sphre"], "did you mean 'sphere'"),
        (["--scenes", "tabletop_six", "--grasps", "no/run"], "no/run is not the folder of a run"),
    ):
        assert main(["dataset", "generate", *arguments, *output]) == 2
        assert told in capsys.readouterr().err
        assert not (tmp_path / "data").exists()


def test_the_commands(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    view = tmp_path / "view.png"
    options = ["--camera", "board", "-o", str(view), "--depth", "--labels", "--normals"]
    assert main(["render", "tabletop_six", *options]) == 0
    assert "5 bowl: 6025 pixels" in capsys.readouterr().out
    names = ("view.depth.png", "view.labels.png", "view.normals.png", "view.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == list(names)
    assert main(["render", "tabletop_six", "-o", str(tmp_path / "view.jpg")]) == 2
    assert main(["dataset", "show", str(folder), "-o", str(tmp_path / "sheet.png")]) == 0
    page, one = tmp_path / "sample.html", tmp_path / "one.html"
    chosen = ["--sample", "000001_001"]
    assert main(["dataset", "show", str(folder), *chosen, "--html", str(page), "-o", str(one)]) == 0
    assert f"wrote {one}" in capsys.readouterr().out
    assert "<summary>set 000001_001</summary>" in page.read_text(encoding="utf-8")
    assert one.read_text(encoding="utf-8").count("<figure>") == 1
    assert main(["dataset", "show", str(folder), "--no-wait"]) == 0
    assert "set 000000_000: not kept open" in capsys.readouterr().out
    assert main(["dataset", "show", str(folder), "--sample", "000001_009", "--no-wait"]) == 2
    assert "has no sample '000001_009'; did you mean" in capsys.readouterr().err
    exported = tmp_path / "coco"
    assert main(["dataset", "export", str(folder), "--to", "coco", "-o", str(exported)]) == 0
    assert (exported / "instances.json").is_file()
