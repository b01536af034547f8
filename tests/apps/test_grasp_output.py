"""Outputs of grasps: checks before there are grasps, and messages after writing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import grasp_output
from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError
from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def of(*objects: str) -> GraspSet:
    return GraspSet.create(np.repeat(np.eye(4)[None], len(objects), 0), object=list(objects))


@pytest.mark.parametrize("folder", ["out", "out/", "there.d", "a/b/out"])
def test_folders(folder: str) -> None:
    Path("there.d").mkdir()
    with pytest.raises(InvalidInputError, match=r"is a folder; say in which format .*--to"):
        grasp_output(folder, None)
    output = grasp_output(folder, "graspgen")
    assert output.is_folder
    output.require_fits(["a", "b"])
    output.write(of("a", "b", "a"), PANDA_GRIPPER)
    assert sorted(p.name for p in Path(folder).iterdir()) == ["a.json", "b.json"]


def test_files() -> None:
    assert grasp_output("x.h5", None).format.name == "burg_drake"
    assert grasp_output("x.yaml", "isaac_grasp").format.name == "isaac_grasp"
    assert not Path("x.h5").exists()
    with pytest.raises(InvalidInputError, match=r"isaac_grasp or graspgen_yaml; .*\(--to\)$"):
        grasp_output("x.yaml", None)
    with pytest.raises(UnknownNameError, match="did you mean 'acronym'"):
        grasp_output("x.h5", "acronim")
    with pytest.raises(InvalidInputError, match="have grasps in the camera frame"):
        grasp_output("x.npy", "graspnet", frame="object")


@pytest.mark.parametrize("name", list(GRASP_FORMATS))
def test_formats_of_one_object_are_told_beforehand(name: str) -> None:
    format = GRASP_FORMATS[name]
    path = f"x{format.suffixes[0]}"
    output = grasp_output(path, name)
    output.require_fits(["a", "a"])
    if not format.one_object:
        output.require_fits(["a", "b"])
        format.write(of("a", "b"), Path(path), PANDA_GRIPPER)
        return
    with pytest.raises(InvalidInputError, match=r"of 2 \(a, b\).* folder .*: x/"):
        output.require_fits(["a", "b"])
    with pytest.raises(InvalidInputError, match="of 2 objects"):
        format.write(of("a", "b"), Path(path), PANDA_GRIPPER)


def test_places_that_cannot_be_written_to() -> None:
    Path("file").write_text("")
    for path in ("file/x.h5", "file/deep/x.h5"):
        with pytest.raises(InvalidInputError, match=r"cannot write .*; choose a writable place"):
            grasp_output(path, None)
    with pytest.raises(InvalidInputError, match="cannot write"):
        grasp_output("file", "acronym")
    grasp_output("new/folders/x.h5", None)
    assert [p.name for p in Path().iterdir()] == ["file"]


def test_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    grasps = of("a", "b").with_columns(maker=["x", "y"])
    grasp_output("x.h5", None).write(grasps, PANDA_GRIPPER)
    assert capsys.readouterr().out == "wrote 2 grasps to x.h5\n"
    grasp_output("out", "graspgen").write(grasps, PANDA_GRIPPER)
    first, files, *lines = capsys.readouterr().out.splitlines()
    assert first == "wrote 2 grasps to out as graspgen (GraspGen data set)"
    assert files == "  a.json, b.json"
    assert sum("has no place for id, maker" in line for line in lines) == 1  # it is alike for both
    success = of("a", "b").with_columns(object_in_gripper=[np.nan, 1.0])
    grasp_output("out", "graspgen").write(success, PANDA_GRIPPER)
    assert "  a.json: The file has no object_in_gripper" in capsys.readouterr().out
