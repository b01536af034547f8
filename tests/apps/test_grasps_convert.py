"""`grasps convert` from the command line: files, messages and errors."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from burg_drake.apps import cli
from burg_drake.core import GraspSet, resolve_reference
from burg_drake.evaluation import Run
from burg_drake.formats import GRASP_FORMATS

DOWN = np.array(
    [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.1034], [0.0, 0.0, 0.0, 1.0]]
)
"""Of a gripper's base that closes along x, above a cube."""


@pytest.fixture
def mug(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file of ACRONYM in the current folder."""
    monkeypatch.chdir(tmp_path)
    with h5py.File("Mug_10f6_0.5.h5", "w") as file:
        file["grasps/transforms"] = np.stack([DOWN, DOWN])
        file["grasps/qualities/flex/object_in_gripper"] = [1, 0]
        file["object/file"] = "meshes/Mug/10f6.obj"
        file["object/scale"] = 0.5
        file["gripper/type"] = "panda"
    return "Mug_10f6_0.5.h5"


def convert(*arguments: str) -> int:
    return cli.main(["grasps", "convert", *arguments])


def test_acronym_becomes_ours(mug: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert convert(mug, "mug.h5", "--rename", "mug") == 0
    grasps = GraspSet.load("mug.h5")
    assert grasps.object.tolist() == ["mug", "mug"]
    np.testing.assert_allclose(grasps.X_OG[:, :3, 3], 0.0, atol=1e-12)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{mug}: acronym (ACRONYM), 2 grasps of mug in the frame of their object"
    assert "scaled by 0.5" in lines[1]
    assert lines[2:] == ["wrote 2 grasps to mug.h5"]


def test_ours_becomes_isaac_grasp_of_another_hand(
    mug: str, capsys: pytest.CaptureFixture[str]
) -> None:
    convert(mug, "mug.h5")
    arguments = ("mug.h5", "mug.yaml", "--to", "isaac_grasp", "--hand", "wsg_50")
    assert convert(*arguments, "--gripper-link", "base") == 0
    document = yaml.safe_load(Path("mug.yaml").read_text())
    assert document["gripper_frame_link"] == "/World/base"
    # the origin of the WSG's body is 0.1455 m from between its pads
    np.testing.assert_allclose(
        document["grasps"]["grasp_0"]["position"], [0, 0, 0.1455], atol=1e-12
    )


def test_a_folder_gets_one_file_an_object(mug: str) -> None:
    both = GraspSet.create(
        np.repeat(np.eye(4)[None], 3, 0), object=["a", "b", "a"], score=[0.2, 0.9, 0.7]
    )
    both.save("both.npz")
    assert convert("both.npz", "out/", "--to", "graspgen", "--success-above", "0.5") == 0
    found = {p.name: json.loads(p.read_text())["grasps"] for p in Path("out").iterdir()}
    assert {k: v["object_in_gripper"] for k, v in found.items()} == {
        "a.json": [False, True],
        "b.json": [True],
    }
    assert convert("both.npz", "b.json", "--only", "b", "--success-above", "0.5") == 0
    assert Path("b.json").read_text() == Path("out/b.json").read_text()


def test_grasps_of_a_scene_and_back(mug: str, capsys: pytest.CaptureFixture[str]) -> None:
    convert(mug, "mug.h5", "--rename", "mug")
    assert convert("mug.h5", "scene.csv", "--scene", "tabletop_six") == 0
    assert "2 grasps of mug in a scene" in capsys.readouterr().out
    assert convert("scene.csv", "back.h5", "--scene", "tabletop_six") == 0
    back = GraspSet.load("back.h5")
    assert back.columns["instance"].tolist() == ["mug", "mug"]
    np.testing.assert_allclose(back.X_OG, GraspSet.load("mug.h5").X_OG, atol=1e-9)


def test_poses_that_were_measured_otherwise(mug: str) -> None:
    convert(mug, "mug.h5")
    assert convert("mug.h5", "mug.npy", "--to", "burg", "--out-frame", "object") == 0
    assert convert("mug.npy", "back.h5", "--from", "burg", "--frame", "object") == 0
    np.testing.assert_allclose(
        GraspSet.load("back.h5").X_OG, GraspSet.load("mug.h5").X_OG, atol=1e-6
    )


def ended(*arguments: str) -> int | str | None:
    """Exit code of a command line that is not run at all."""
    with pytest.raises(SystemExit) as end:
        convert(*arguments)
    return end.value.code


def test_options_may_stand_anywhere(mug: str) -> None:
    convert(mug, "mug.h5", "--rename", "mug")
    assert convert("mug.h5", "--to", "isaac_grasp", "x.yaml", "--only", "mug") == 0
    assert Path("x.yaml").exists()


def test_outcomes_of_a_run(mug: str, run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert convert(str(run.path), "out/", "--to", "acronym") == 0
    assert capsys.readouterr().out.startswith(f"{run.path}: run, 3 grasps of box in the frame")
    with h5py.File("out/box.h5") as file:
        assert file["grasps/qualities/flex/object_in_gripper"][()].tolist() == [1, 0, 0]
        assert resolve_reference(file["object/file"].asstr()[()]).is_file()
    assert convert(str(run.table_path), "r.h5") == 2
    assert "is the table of a run; give the run's folder" in capsys.readouterr().err


def test_the_hand_is_that_of_the_set(mug: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--only", "mug", "--station", "panda_wsg", "-n", "3", "-o", "wsg.h5"]
    assert cli.main(["grasps", "sample", "household", *options]) == 0
    for hand, joints in ((None, "wsg_left_joint"), ("panda_hand", "panda_finger_joint1")):
        asked = ["--hand", hand] if hand else []
        capsys.readouterr()
        assert convert("wsg.h5", "w.yaml", "--to", "isaac_grasp", *asked) == 0
        grasp = yaml.safe_load(Path("w.yaml").read_text())["grasps"]["grasp_0"]
        assert joints in grasp["cspace_position"]
        said = "for hand 'wsg_50'; they are judged as those of hand 'panda_hand'"
        assert (said in capsys.readouterr().out) == (hand is not None)
    lost = GraspSet.create(np.eye(4), object="a", provenance={"hand": {"name": "gone_hand"}})
    lost.save("lost.h5")
    assert convert("lost.h5", "l.yaml", "--to", "isaac_grasp") == 2
    assert "the hand that lost.h5 names cannot be used" in capsys.readouterr().err


def test_formats_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert ended("--formats") == 0
    text = capsys.readouterr().out
    for name, format in GRASP_FORMATS.items():
        assert f"{name} " in text and format.title in text
        assert all(suffix in text for suffix in format.suffixes)


def test_both_names_are_needed(mug: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(mug) == 2
    assert "required: OUT (see burg-drake grasps convert --help)" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.h5", "out.h5"], "none.h5 does not exist"),
        (["mug.h5", "out"], "out is a folder; say in which format"),
        (["mug.h5", "out.yaml"], "isaac_grasp or graspgen_yaml"),
        (["mug.h5", "out.h5", "--to", "acronim"], "did you mean 'acronym'"),
        (["mug.h5", "out.h5", "--from", "vgm"], "did you mean 'vgn'"),
        (["mug.h5", "out.h5", "--from", "vgn"], "not a text file"),
        (["mug.h5", "out.h5", "--only", "bowl"], "mug.h5 has no grasps of 'bowl'"),
        (["mug.h5", "out.csv"], "(--scene)"),
        (["mug.h5", "out.h5", "--hand", "wsg"], "wsg_50"),
    ],
)
def test_what_is_refused(
    mug: str, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    convert(mug, "mug.h5")
    capsys.readouterr()
    assert convert(*arguments) == 2
    assert said in capsys.readouterr().err
    assert sorted(p.name for p in Path().iterdir()) == sorted([mug, "mug.h5"])
