"""Where verbs write grasps: what is checked before there are any, and what is said afterwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps.options.grasp_output import output_of
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.grasps.grasp_set import GraspSet
from burg_drake.formats.common.grasp_format import PANDA
from burg_drake.formats.grasp_files import FORMATS


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def of(*objects: str) -> GraspSet:
    return GraspSet.create(np.repeat(np.eye(4)[None], len(objects), 0), object=list(objects))


@pytest.mark.parametrize("folder", ["out", "out/", "there.d", "a/b/out"])
def test_folders(folder: str) -> None:
    Path("there.d").mkdir()
    with pytest.raises(InvalidInputError, match=r"is a folder; say in which format .*--to"):
        output_of(folder, None)
    output = output_of(folder, "graspgen")
    assert output.is_folder
    output.require_fits(["a", "b"])
    output.write(of("a", "b", "a"), PANDA)
    assert sorted(p.name for p in Path(folder).iterdir()) == ["a.json", "b.json"]


def test_files() -> None:
    assert output_of("x.h5", None).format.name == "burg_drake"
    assert output_of("x.yaml", "isaac_grasp").format.name == "isaac_grasp"
    assert not Path("x.h5").exists()
    with pytest.raises(InvalidInputError, match=r"isaac_grasp or graspgen_yaml; .*\(--to\)$"):
        output_of("x.yaml", None)
    with pytest.raises(UnknownNameError, match="did you mean 'acronym'"):
        output_of("x.h5", "acronim")
    with pytest.raises(InvalidInputError, match="has grasps in the camera frame"):
        output_of("x.npy", "graspnet", frame="object")


@pytest.mark.parametrize("name", list(FORMATS))
def test_formats_of_one_object_are_told_beforehand(name: str) -> None:
    format = FORMATS[name]
    path = f"x{format.suffixes[0]}"
    output = output_of(path, name)
    output.require_fits(["a", "a"])
    if not format.one_object:
        output.require_fits(["a", "b"])
        format.write(of("a", "b"), Path(path), PANDA)
        return
    with pytest.raises(InvalidInputError, match=r"of 2 \(a, b\).* folder .*: x/"):
        output.require_fits(["a", "b"])
    with pytest.raises(InvalidInputError, match="of 2 objects"):
        format.write(of("a", "b"), Path(path), PANDA)


def test_places_that_cannot_be_written_to() -> None:
    Path("file").write_text("")
    for path in ("file/x.h5", "file/deep/x.h5"):
        with pytest.raises(InvalidInputError, match=r"cannot write .*; choose a writable place"):
            output_of(path, None)
    with pytest.raises(InvalidInputError, match="cannot write"):
        output_of("file", "acronym")
    output_of("new/folders/x.h5", None)
    assert [p.name for p in Path().iterdir()] == ["file"]


def test_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    grasps = of("a", "b").with_columns(maker=["x", "y"])
    output_of("x.h5", None).write(grasps, PANDA)
    assert capsys.readouterr().out == "wrote 2 grasps to x.h5\n"
    output_of("out", "graspgen").write(grasps, PANDA)
    first, files, *lines = capsys.readouterr().out.splitlines()
    assert first == "wrote 2 grasps to out as graspgen (GraspGen data set)"
    assert files == "  a.json, b.json"
    assert sum("has no place for id, maker" in line for line in lines) == 1  # it is alike for both
    success = of("a", "b").with_columns(object_in_gripper=[np.nan, 1.0])
    output_of("out", "graspgen").write(success, PANDA)
    assert "  a.json: The file has no object_in_gripper" in capsys.readouterr().out
