"""`grasps convert` from the command line: what it writes, what it says, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from burg_drake.apps import cli
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.grasp_files import FORMATS

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
    assert lines[2:] == ["mug.h5: written as burg_drake"]


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
    assert convert("both.npz", "b.json", "--object", "b", "--success-above", "0.5") == 0
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


def test_formats_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("--formats") == 0
    text = capsys.readouterr().out
    for name, format in FORMATS.items():
        assert f"{name} " in text and format.title in text
        assert all(suffix in text for suffix in format.suffixes)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["mug.h5"], "IN OUT"),
        (["none.h5", "out.h5"], "none.h5 does not exist"),
        (["mug.h5", "out"], "out is a folder; say in which format"),
        (["mug.h5", "out.yaml"], "isaac_grasp or graspgen_yaml"),
        (["mug.h5", "out.h5", "--to", "acronim"], "did you mean 'acronym'"),
        (["mug.h5", "out.h5", "--from", "vgm"], "did you mean 'vgn'"),
        (["mug.h5", "out.h5", "--from", "vgn"], "not a CSV file"),
        (["mug.h5", "out.h5", "--object", "bowl"], "no grasps are of object 'bowl'"),
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
