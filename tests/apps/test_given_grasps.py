"""`burg-drake evaluate --grasps` on files of other projects: from the file to the verdict."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from burg_drake.apps import build_parser, main
from burg_drake.apps.commands import evaluate
from burg_drake.core import (
    GraspSet,
    InvalidInputError,
    grasp_from_axes,
    make_pose,
    rotation_from_rpy,
)
from burg_drake.evaluation import GraspsLike, given_content, given_correction, read_table
from burg_drake.formats import write_grasp_file
from burg_drake.scene import load_scene
from burg_drake.station import load_station
from tests.apps.conftest import TWO

Capture = pytest.CaptureFixture[str]

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above: it lifts the box."""
X_OG = np.stack([ABOVE, ABOVE @ make_pose(p_AB=(0.0, 0.0, -0.1))])
"""And one 100 mm higher, in thin air."""
OUTCOMES = ["lifted", "no_contact"]
QUICK = ["--engine", "screening", "--workers", "1", "--quiet"]


@pytest.fixture(scope="module")
def no_pose_mistakes() -> None:
    """Enables the checks for common mistakes."""


def judged(folder: Path, *arguments: str) -> dict[str, np.ndarray]:
    """The results of an evaluation on a scene of two objects."""
    (folder / "two.yaml").write_text(TWO)
    options = ["-o", str(folder / "run"), *QUICK]
    assert main(["evaluate", str(folder / "two.yaml"), *arguments, *options]) == 0
    return read_table(folder / "run" / "results.csv")


@pytest.mark.thorough
def test_a_network_s_grasps_seen_by_a_camera(tmp_path: Path, capsys: Capture) -> None:
    # the camera looks down on the board from 0.7 m; rows are written as graspnetAPI has them
    p_SC = (0.3, 0.2, 0.7)
    (tmp_path / "camera.yaml").write_text(f"translation: {list(p_SC)}\nrpy_deg: [180, 0, 30]\n")
    X_SC = make_pose(rotation_from_rpy(np.deg2rad([180.0, 0.0, 30.0])), p_SC)
    X_CG = np.linalg.inv(X_SC) @ load_scene("tabletop_six").X_SO("box") @ X_OG
    rows = np.zeros((2, 17), dtype=np.float32)
    rows[:, 0] = [0.9, 0.4]
    rows[:, 1:4] = [0.07, 0.02, 0.03]
    # x: approach, y: closing, z = x cross y; origin 30 mm before the tips, which are 9.5 mm past G
    rows[:, 4:13] = X_CG[:, :3, [2, 0, 1]].reshape(2, 9)
    rows[:, 13:16] = X_CG[:, :3, 3] + (0.0095 - 0.03) * X_CG[:, :3, 2]
    rows[:, 16] = -1
    np.save(tmp_path / "0000.npy", rows)
    file, camera = str(tmp_path / "0000.npy"), str(tmp_path / "camera.yaml")
    results = judged(tmp_path, "--grasps", file, "--camera-pose", camera, "--mode", "hand")
    assert results["instance"].tolist() == ["box", "box"]
    assert results["outcome"].tolist() == OUTCOMES
    np.testing.assert_allclose(results["score"], [0.9, 0.4], rtol=1e-6)
    np.testing.assert_allclose(results["given_depth"], 0.03, rtol=1e-6)
    printed = capsys.readouterr().out
    assert printed.startswith(
        "note: 1 of 2 grasps have no object between their fingers; each was assigned to"
        " the object with the nearest surface.\n"
    )


@pytest.mark.thorough
def test_a_data_set_s_grasps_of_an_object(tmp_path: Path, capsys: Capture) -> None:
    # as ACRONYM has them: the hand's base, 103.4 mm before G, x along the closing direction
    path = tmp_path / "Box_3f2a_1.0.h5"
    with h5py.File(path, "w") as file:
        file["object/file"], file["object/scale"] = "meshes/Box/3f2a.obj", 1.0
        file["gripper/type"] = "panda"
        file["grasps/transforms"] = X_OG @ make_pose(p_AB=(0.0, 0.0, -0.1034))
        file["grasps/qualities/flex/object_in_gripper"] = np.array([0, 1])
    assert main(["evaluate", "tabletop_six", "--grasps", str(path)]) == 2
    assert "say which of the scene's objects it is, 3f2a=NAME" in capsys.readouterr().err
    millimetres = tmp_path / "millimetres.h5"
    with h5py.File(path) as file, h5py.File(millimetres, "w") as other:
        X_OB = file["grasps/transforms"][()]
        X_OB[:, :3, 3] *= 1000.0
        other["object/file"], other["object/scale"] = "box.obj", 1.0
        other["grasps/transforms"] = X_OB
    assert main(["evaluate", "tabletop_six", "--grasps", str(millimetres)]) == 2
    assert "are lengths in metres" in capsys.readouterr().err
    results = judged(tmp_path, "--grasps", str(path), "--grasps-object", "box")
    assert results["outcome"].tolist() == OUTCOMES
    assert np.isfinite(results["q_grasp_7"]).all()  # the whole arm was asked
    assert results["score"].tolist() == [0.0, 1.0]  # the data set's labels, both of them wrong here
    np.testing.assert_allclose(
        [[float(n) for n in text.split()] for text in results["X_OG"]],
        X_OG[:, :3].reshape(2, 12),
        atol=1e-12,
    )


def turned_grasps(folder: Path) -> Path:
    """A file of grasps that lift a box, turned by a quarter about the approach."""
    heights = [ABOVE @ make_pose(p_AB=(0.0, y, 0.0)) for y in (-0.004, 0.0, 0.004)]
    turned = np.stack(heights) @ make_pose(rotation_from_rpy(np.deg2rad([0.0, 0.0, 90.0])))
    GraspSet.create(turned, object="box").save(folder / "turned.npz")
    return folder / "turned.npz"


def typed(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """The exit code of a command line."""
    monkeypatch.setattr(sys, "argv", ["/usr/bin/burg-drake", *words])
    return main(words)


def test_turned_grasps_are_told_and_the_printed_command_corrects_them(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The note counts grasps that are turned about the approach, and speaks of no sampling. The
    command in it works as printed, and leads to the lifts; in the same folder it is refused."""
    (tmp_path / "two.yaml").write_text(TWO)
    run = tmp_path / "run"
    words = ["evaluate", str(tmp_path / "two.yaml"), "--grasps", str(turned_grasps(tmp_path))]
    words += ["--mode", "hand", "-o", str(run), *QUICK]
    assert typed(words, monkeypatch) == 0
    assert "lifted" not in read_table(run / "results.csv")["outcome"].tolist()
    printed = capsys.readouterr().out
    told = " ".join(printed.split())
    assert "note: As they were read, 0 of the 3 grasps fit: the open hand is clear of the" in told
    assert "Turned by 90 degrees about the approach, 3 of 3 fit." in told
    assert "The file perhaps means that; --correction turn:z90 reads it that way." in told
    assert "sample grasps" not in told
    (line,) = [line for line in printed.splitlines() if line.startswith("    burg-drake ")]
    assert line.strip() in (run / "report.html").read_text(encoding="utf-8")
    assert typed(shlex.split(line)[1:], monkeypatch) == 0
    corrected = read_table(tmp_path / "run_corrected" / "results.csv")
    assert corrected["outcome"].tolist() == ["lifted"] * 3
    assert "As they were read" not in capsys.readouterr().out
    assert typed([*words, "--correction", "turn:z90"], monkeypatch) == 2
    assert (
        f"{run} already holds another run (correction is none there, turn:z90 here);"
        " choose another folder"
    ) in capsys.readouterr().err


def test_a_run_over_scenes_tells_the_mistake_of_its_file_once(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    for name, x in (("first", "0.475"), ("second", "0.47")):
        (scenes / f"{name}.yaml").write_text(TWO.replace("tabletop_two", name).replace("0.475", x))
    words = ["evaluate", str(scenes), "--grasps", str(turned_grasps(tmp_path)), "--mode", "hand"]
    words += ["-o", str(tmp_path / "all"), "--no-scene-reports", *QUICK]
    assert typed(words, monkeypatch) == 0
    printed = capsys.readouterr().out
    assert printed.count("As they were read") == 1
    assert "note: Scene first: As they were read, 0 of the 3 grasps fit" in printed
    (line,) = [line for line in printed.splitlines() if line.startswith("    burg-drake ")]
    assert line.strip() in (tmp_path / "all" / "report.html").read_text(encoding="utf-8")
    assert typed([*words, "--correction", "turn:z90"], monkeypatch) == 2
    assert "(correction is none there, turn:z90 here)" in capsys.readouterr().err
    assert line.endswith(f"--correction turn:z90 -o {tmp_path / 'all_corrected'}")
    assert line.count(" -o ") == 1
    assert typed([*words, "--only", "box"], monkeypatch) == 2
    assert "grasps are given there, given for box alone here" in capsys.readouterr().err


def test_another_file_of_grasps_of_scenes_is_not_taken_for_the_first(tmp_path: Path) -> None:
    """Grasps in the frame of a scene are read scene by scene; a hash of file and options counts."""
    station, parser = load_station("panda_tabletop"), build_parser()

    def given(name: str, height: float, *options: str) -> GraspsLike | None:
        X_SG = X_OG[:1] @ make_pose(p_AB=(0.0, 0.0, height))
        columns = {"scene_id": ["tabletop_two"], "label": [1]}
        grasps = GraspSet.create(X_SG, object="", width=0.05, columns=columns)
        write_grasp_file(grasps, tmp_path / name, "vgn")
        words = ["evaluate", "scenes", "--grasps", str(tmp_path / name), *options]
        return evaluate._grasps_from_file(parser.parse_args(words), station)

    first, same, other = given("a.csv", 0.0), given("b.csv", 0.0), given("a.csv", 0.001)
    corrected = given("a.csv", 0.0, "--correction", "inverse")
    assert given_content(first) == given_content(same) != given_content(other)
    assert given_content(corrected) not in (given_content(first), given_content(other), "")
    assert given_correction(first) == () and given_correction(corrected) == ("inverse",)


def test_the_link_of_another_gripper_names_its_option(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "box.yaml"
    write_grasp_file(GraspSet.create(X_OG, object="box"), path, "isaac_grasp")
    path.write_text(path.read_text().replace("/World/panda_hand", "/World/tool"))
    assert main(["evaluate", "tabletop_six", "--grasps", str(path)]) == 2
    assert "'tool' as the gripper's link (--gripper-link" in capsys.readouterr().err


def test_grasps_for_another_hand_are_judged_with_a_note(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "grasps.h5"
    hand = {"hand": {"name": "wsg_50"}}
    GraspSet.create(X_OG, object="box", provenance=hand).save(path)
    judged(tmp_path, "--grasps", str(path), "--mode", "hand")
    note = (
        "note: The grasps were made for hand 'wsg_50'; they are judged as those of hand"
        " 'panda_hand'.\n"
    )
    assert capsys.readouterr().out.startswith(note)


def test_a_file_that_does_not_say_which_scene_it_is_of(tmp_path: Path) -> None:
    path = tmp_path / "grasps.npz"
    GraspSet.create(X_OG, object="box").save(path)
    parser = build_parser()
    station = load_station("panda_tabletop")
    scene = load_scene("tabletop_six")
    arguments = parser.parse_args(["evaluate", scene.name, "--grasps", str(path)])
    with pytest.raises(InvalidInputError) as error:
        evaluate._SceneGraspFile(arguments, station, "", ())(scene)
    assert "without saying which; evaluate that scene alone" in str(error.value)
    arguments.grasps = str(tmp_path / "no scene ids.npz")  # another error is not taken for it
    with pytest.raises(InvalidInputError, match=r"no scene ids\.npz does not exist"):
        evaluate._SceneGraspFile(arguments, station, "", ())(scene)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--camera-pose", "a.npy"], "--camera-pose is for grasp files; add --grasps FILE"),
        (["--grasps-object", "mug"], "--grasps-object is for grasp files; add --grasps FILE"),
        (["--object-ids", "5=mug"], "--object-ids is for grasp files; add --grasps FILE"),
        (["--scene-id", "a"], "--scene-id is for grasp files; add --grasps FILE"),
        (["--grasps", "a.npy", "--blind"], "--blind is for sampled grasps; leave out either it or"),
        (["--grasps", "a.npy", "--approach-angle", "30"], "--approach-angle is for sampled"),
        (["--max-grasps-per-object", "50"], "(--max-grasps-per-object, --until-balanced)"),
        (["--balanced-among", "all"], "balanced_among has no effect without until_balanced; add"),
        (
            ["--until-balanced", "3", "--balanced-among", "reachable", "--mode", "hand"],
            "does not check what the arm can reach; balance among executed, clear or all, or give",
        ),
        (["--grasps", "missing.npy"], "missing.npy does not exist"),
        (["--grasps", "a.npy", "--camera-pose", "missing.npy"], "cannot read missing.npy"),
        (["--grasps", "a.npy", "--grasps-format", "vgm"], "no grasp format 'vgm'; did you mean"),
        (["--grasps", "a.npy"], "its array has shape (2, 3); expected (N, 4, 4)"),
        (["--grasps", "a.npy"], "name the format to see what is wrong (--grasps-format)"),
        (["--grasps", "a.npy", "--correction", "yup"], "no correction 'yup'; did you mean 'y_up'"),
        (["--correction", "inverse"], "--correction is for grasp files; add --grasps FILE"),
        (
            ["--grasps", "a.npy", "--grasps-format", "graspnet"],
            "has shape (2, 3); expected (N, 17)",
        ),
    ],
)
def test_mistakes(
    options: list[str],
    message: str,
    tmp_path: Path,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", np.zeros((2, 3)))
    assert main(["evaluate", "tabletop_six", *options, "-o", "run"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not Path("run").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--grasps-object", "mug="], "'mug=' is not THEIRS=OURS, such as Mug_3f2a=mug"),
        (["--object-ids", "mug=5"], "'mug=5' is not ID=NAME, such as 5=mug"),
        (["--object-ids", "5=mug,6"], "'6' is not ID=NAME, such as 5=mug"),
        (["--grasps-frame", "world"], "invalid choice: 'world'"),
    ],
)
def test_options_that_cannot_be_read(options: list[str], message: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as end:
        main(["evaluate", "tabletop_six", "--grasps", "a.npy", *options])
    assert end.value.code == 2
    assert message in capsys.readouterr().err
