"""Files in the layout of the manuals of Isaac Sim and Isaac ROS, of GraspDataGen and GraspGen."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, GraspSet, InvalidInputError
from burg_drake.formats import (
    GRASPGEN_YAML_FORMAT,
    ISAAC_GRASP_FORMAT,
    PANDA_GRIPPER,
    GraspFormat,
    read_grasp_file,
)

MANUAL = """\
format: isaac_grasp
format_version: 1.0

object_frame_link: /World/mug
gripper_frame_link: /World/panda_hand

grasps:
  grasp_0:
      confidence: 1.0
      position: [-0.04346, 0.06759, 0.19895]
      orientation: {w: 0.00332, xyz: [0.98453, 0.16837, 0.04837]}
      cspace_position:
        panda_finger_joint1: 0.00943
      pregrasp_cspace_position:
        panda_finger_joint1: 0.04
"""
"""The example of Isaac Sim's manual."""

# Straight down on a cube, fingers along y: panda_hand 0.1034 m above, turned half around its y.
CUBE = MANUAL.replace("[-0.04346, 0.06759, 0.19895]", "[0.0, 0.0, 0.1034]").replace(
    "{w: 0.00332, xyz: [0.98453, 0.16837, 0.04837]}", "{w: 0.0, xyz: [0.0, 1.0, 0.0]}"
)


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    def make(text: str) -> Path:
        path = tmp_path / "grasps.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return make


def load_from_isaac_grasp_format(path: Path) -> tuple[Array, Array]:
    """(N, 4, 4) poses and (N,) confidences as GraspGen's own reader makes them of a file."""
    data = yaml.safe_load(path.read_text())
    poses = []
    for grasp in data["grasps"].values():
        X = np.eye(4)
        w, xyz = grasp["orientation"]["w"], grasp["orientation"]["xyz"]
        assert all(type(number) is float for number in (w, *xyz, *grasp["position"]))
        X[:3, :3] = Rotation.from_quat([*xyz, w]).as_matrix()
        X[:3, 3] = grasp["position"]
        poses.append(X)
    return np.array(poses), np.array([g["confidence"] for g in data["grasps"].values()])


def test_the_manual_s_example(file: Callable[[str], Path]) -> None:
    read = ISAAC_GRASP_FORMAT.read(file(MANUAL), PANDA_GRIPPER)
    grasps = read.grasps
    assert (read.frame, len(grasps), grasps.object[0], grasps.score[0]) == ("object", 1, "mug", 1.0)
    assert grasps.width[0] == pytest.approx(2 * 0.00943)
    assert grasps.columns["pregrasp_width"][0] == pytest.approx(0.08)
    assert grasps.columns["name"][0] == "grasp_0"
    R = Rotation.from_quat([0.98453, 0.16837, 0.04837, 0.00332]).as_matrix()
    p = np.array([-0.04346, 0.06759, 0.19895])
    np.testing.assert_allclose(grasps.X_OG[0, :3, 3], p + 0.1034 * R[:, 2], atol=1e-12)
    np.testing.assert_allclose(grasps.X_OG[0, :3, 2], R[:, 2], atol=1e-12)
    np.testing.assert_allclose(grasps.X_OG[0, :3, 0], R[:, 1], atol=1e-12)  # y of panda_hand


def test_a_grasp_on_a_cube_written_by_hand(
    file: Callable[[str], Path], assert_grips_the_cube: Callable[[Array], None]
) -> None:
    path = file(CUBE)
    assert ISAAC_GRASP_FORMAT.recognises(path) and not GRASPGEN_YAML_FORMAT.recognises(path)
    assert_grips_the_cube(ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER).grasps.X_OG[0])


def test_isaac_ros_names_frames_and_versions_its_own_way(file: Callable[[str], Path]) -> None:
    text = MANUAL.replace("_frame_link", "_frame").replace("1.0\n\n", '"1.0"\n\n')
    path = file(text.replace("grasp_0:", '"grasp_0":'))
    assert ISAAC_GRASP_FORMAT.recognises(path)
    assert ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER).grasps.object[0] == "mug"


def test_files_of_grasp_data_gen(file: Callable[[str], Path], random_grasps: Any) -> None:
    X = random_grasps(4, 3).X_OG
    document = {
        "format": "isaac_grasp",
        "format_version": "1.0",
        "created_with": "grasp_guess",
        "created_at": "2025-10-01T12:00:00",
        "object_file": "objects/banana.obj",
        "object_scale": 0.5,
        "gripper_file": "bots/franka_panda.usd",
        "gripper_frame_link": "panda_hand",
        "open_limit": "upper",
        "finger_colliders": ["panda_leftfinger", "panda_rightfinger"],
        "base_length": 0.06,
        "approach_axis": 2,
        "bite_point": [0.0, 0.0, 0.1],
        "grasps": {},
    }
    for i, pose in enumerate(X):
        q = Rotation.from_matrix(pose[:3, :3]).as_quat().astype(np.float32)
        document["grasps"][f"grasp_{i}_0"] = {
            "confidence": float(i % 2),
            "position": pose[:3, 3].astype(np.float32).tolist(),
            "orientation": {"w": float(q[3]), "xyz": q[:3].tolist()},
            "cspace_position": {"panda_finger_joint1": 0.01 * i, "panda_finger_joint2": 0.01 * i},
            "bite_point": [0.0, 0.0, 0.1],
            "pregrasp_cspace_position": {"panda_finger_joint1": 0.04},
            "pregrasp_bite_point": [0.0, 0.0, 0.1],
            "group": i,
        }
    read = ISAAC_GRASP_FORMAT.read(file(yaml.safe_dump(document, sort_keys=False)), PANDA_GRIPPER)
    np.testing.assert_allclose(read.grasps.width, [0.0, 0.02, 0.04, 0.06], atol=1e-12)
    np.testing.assert_array_equal(read.grasps.score, [0, 1, 0, 1])
    np.testing.assert_array_equal(read.grasps.columns["group"], range(4))
    tcp = X[:, :3, 3] + 0.1034 * X[:, :3, 2]
    np.testing.assert_allclose(read.grasps.X_OG[:, :3, 3], tcp, atol=1e-6)
    assert read.grasps.object[0] == "banana"
    assert read.grasps.provenance["object_files"]["banana"]["scale"] == 0.5
    assert any("scaled by 0.5" in note for note in read.notes)
    assert any("bite_point" in note for note in read.notes)


def test_predictions_of_graspgen_close_along_x(
    file: Callable[[str], Path], assert_grips_the_cube: Callable[[Array], None]
) -> None:
    q = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]).as_quat()
    grasp = {
        "confidence": 0.9,
        "position": [0.0, 0.0, 0.1034],
        "orientation": {"w": float(q[3]), "xyz": q[:3].tolist()},
    }
    data = {"format": "isaac_grasp", "format_version": 1.0, "grasps": {"grasp_0": grasp}}
    path = file(yaml.dump(data, default_flow_style=False, sort_keys=False))
    assert GRASPGEN_YAML_FORMAT.recognises(path) and not ISAAC_GRASP_FORMAT.recognises(path)
    read = GRASPGEN_YAML_FORMAT.read(path, PANDA_GRIPPER)
    assert_grips_the_cube(read.grasps.X_OG[0])
    assert read.grasps.object[0] == "grasps"  # the file's name: nothing else names the object


def test_predictions_of_graspgen_x_have_no_version(file: Callable[[str], Path]) -> None:
    text = """\
format: isaac_grasp
grasps:
  grasp_0:
    confidence: 0.9679833054542542
    position: [-0.0886637, 0.0169026, 0.0547606]
    orientation: { w: 0.3234007, xyz: [0.7127000, 0.5170539, 0.3465920] }
"""
    path = file(text)
    assert GRASPGEN_YAML_FORMAT.recognises(path)
    read = GRASPGEN_YAML_FORMAT.read(path, PANDA_GRIPPER)
    assert read.grasps.score[0] == 0.9679833054542542
    assert any(
        "no gripper frame; the fingers were taken to close along its x" in n for n in read.notes
    )


def test_grasps_for_grasp_data_gen_may_name_a_file_instead_of_a_frame(
    file: Callable[[str], Path], assert_grips_the_cube: Callable[[Array], None]
) -> None:
    path = file(CUBE.replace("gripper_frame_link: /World/", "gripper_file: bots/"))
    assert ISAAC_GRASP_FORMAT.recognises(path) and not GRASPGEN_YAML_FORMAT.recognises(path)
    read = ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER)
    assert_grips_the_cube(read.grasps.X_OG[0])
    assert any(
        "no gripper frame; the fingers were taken to close along its y" in n for n in read.notes
    )


@pytest.mark.parametrize("format", [ISAAC_GRASP_FORMAT, GRASPGEN_YAML_FORMAT])
def test_written_files_are_read_by_graspgen_s_reader(
    format: GraspFormat, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(20, 4)
    tiny = grasps.X_OG.copy()
    tiny[0] = np.eye(4)
    tiny[0, :3, 3] = [1e-5, -2e-17, 3e-9]  # numbers that YAML 1.1 can take for text
    grasps = GraspSet.create(tiny, object="mug", width=grasps.width, score=grasps.score)
    format.write(grasps, tmp_path / "out.yaml", PANDA_GRIPPER)
    X_OF, confidence = load_from_isaac_grasp_format(tmp_path / "out.yaml")
    np.testing.assert_array_equal(confidence, grasps.score)
    np.testing.assert_allclose(
        X_OF[:, :3, 3] + 0.1034 * X_OF[:, :3, 2], grasps.X_OG[:, :3, 3], atol=1e-12
    )
    fingers = 1 if format is ISAAC_GRASP_FORMAT else 0
    np.testing.assert_allclose(X_OF[:, :3, fingers], grasps.X_OG[:, :3, 0], atol=1e-12)


def test_written_joints_are_those_of_each_finger(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(3, 5)
    notes = ISAAC_GRASP_FORMAT.write(grasps, tmp_path / "out.yaml", PANDA_GRIPPER)
    assert notes == ("Isaac Sim grasp editor has no place for id.",)
    data = yaml.safe_load((tmp_path / "out.yaml").read_text())
    assert data["object_frame_link"] == "/World/mug"
    assert data["gripper_frame_link"] == "/World/panda_hand"
    for grasp, width in zip(data["grasps"].values(), grasps.width, strict=True):
        assert grasp["cspace_position"]["panda_finger_joint1"] == pytest.approx(width / 2)
        assert grasp["cspace_position"]["panda_finger_joint2"] == pytest.approx(width / 2)
        assert grasp["pregrasp_cspace_position"]["panda_finger_joint1"] == pytest.approx(0.04)


def test_unknown_widths_and_scores_are_left_out(tmp_path: Path) -> None:
    grasps = GraspSet.create(np.eye(4), object="mug")
    notes = ISAAC_GRASP_FORMAT.write(grasps, tmp_path / "out.yaml", PANDA_GRIPPER)
    assert notes[0] == "1 grasp has no score: confidence is .nan there."
    back = ISAAC_GRASP_FORMAT.read(tmp_path / "out.yaml", PANDA_GRIPPER).grasps
    assert np.isnan(back.width[0]) and np.isnan(back.score[0])


def test_scores_beyond_1_and_further_columns_are_said(tmp_path: Path) -> None:
    grasps = GraspSet.create(np.eye(4), object="mug", score=3.0, columns={"epsilon": [0.1]})
    notes = ISAAC_GRASP_FORMAT.write(grasps, tmp_path / "out.yaml", PANDA_GRIPPER)
    assert any("from 0 to 1" in note for note in notes)
    assert any("epsilon" in note for note in notes)


def test_widths_that_the_hand_does_not_have_are_said(tmp_path: Path) -> None:
    four = GraspSet.create(np.repeat(np.eye(4)[None], 4, 0), object="mug", score=1.0)
    wide = GraspSet.create(four.X_OG, object="mug", score=1.0, width=[0.02, 0.12, -0.01, 0.08])
    expected = (
        (
            "widths of 2 grasps are outside the opening of hand 'panda_hand', 0 to 0.08 m; so"
            " are their joints."
        ),
        "Isaac Sim grasp editor has no place for id.",
    )
    assert ISAAC_GRASP_FORMAT.write(wide, tmp_path / "a.yaml", PANDA_GRIPPER) == expected
    on_arrival = four.with_columns(pregrasp_width=[0.02, 0.12, -0.01, float(np.float32(0.08))])
    assert ISAAC_GRASP_FORMAT.write(on_arrival, tmp_path / "b.yaml", PANDA_GRIPPER) == expected
    back = ISAAC_GRASP_FORMAT.read(tmp_path / "a.yaml", PANDA_GRIPPER).grasps
    np.testing.assert_allclose(back.width, wide.width, atol=1e-12)


@pytest.mark.parametrize("format", [ISAAC_GRASP_FORMAT, GRASPGEN_YAML_FORMAT])
def test_each_format_says_its_own_name(format: GraspFormat, tmp_path: Path) -> None:
    grasps = GraspSet.create(np.eye(4), object="mug", score=1.0, columns={"epsilon": [0.1]})
    (note,) = [
        n for n in format.write(grasps, tmp_path / "a.yaml", PANDA_GRIPPER) if "epsilon" in n
    ]
    assert note.startswith(f"{format.title} has no place for ")
    read = format.read(tmp_path / "a.yaml", PANDA_GRIPPER)
    assert read.grasps.provenance["format"] == format.name


def test_a_gripper_named_at_the_end_of_a_long_file_is_seen(file: Callable[[str], Path]) -> None:
    """As when keys are written in the order of the alphabet, and there are no joints."""
    many = {
        f"grasp_{i}": {"position": [0.0, 0.0, 1e-4 * i], "orientation": {"w": 1, "xyz": [0, 0, 0]}}
        for i in range(2000)
    }
    document = {"format": "isaac_grasp", "grasps": many, "gripper_frame_link": "panda_hand"}
    path = file(yaml.dump(document, Dumper=yaml.CSafeDumper))
    assert path.stat().st_size > 1 << 17
    assert ISAAC_GRASP_FORMAT.recognises(path) and not GRASPGEN_YAML_FORMAT.recognises(path)


def test_names_survive_if_they_differ(tmp_path: Path) -> None:
    odd = ["null", 'a "b": c', "1e3"]
    grasps = GraspSet.create(np.repeat(np.eye(4)[None], 3, 0), object="mug", columns={"name": odd})
    ISAAC_GRASP_FORMAT.write(grasps, tmp_path / "a.yaml", PANDA_GRIPPER)
    assert (
        ISAAC_GRASP_FORMAT.read(tmp_path / "a.yaml", PANDA_GRIPPER).grasps.columns["name"].tolist()
        == odd
    )
    ISAAC_GRASP_FORMAT.write(
        grasps.with_columns(name=["a", "a", "b"]), tmp_path / "b.yaml", PANDA_GRIPPER
    )
    names = (
        ISAAC_GRASP_FORMAT.read(tmp_path / "b.yaml", PANDA_GRIPPER).grasps.columns["name"].tolist()
    )
    assert names == ["grasp_0", "grasp_1", "grasp_2"]


def test_anchors_are_followed(file: Callable[[str], Path]) -> None:
    text = MANUAL.replace("position: [-", "position: &p [-")
    second = MANUAL.split("grasps:\n")[1].replace("grasp_0", "grasp_1")
    second = second.replace("[-0.04346, 0.06759, 0.19895]", "*p")
    grasps = ISAAC_GRASP_FORMAT.read(file(text + second), PANDA_GRIPPER).grasps
    np.testing.assert_array_equal(grasps.X_OG[0], grasps.X_OG[1])


def test_a_gripper_by_another_name_needs_to_be_named(file: Callable[[str], Path]) -> None:
    path = file(MANUAL.replace("/World/panda_hand", "/World/fr3_hand"))
    with pytest.raises(InvalidInputError, match=r"gripper_frame_link.*name 'fr3_hand' as the g"):
        ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER)
    named = ISAAC_GRASP_FORMAT.read(path, dataclasses.replace(PANDA_GRIPPER, body="fr3_hand"))
    assert len(named.grasps) == 1


def test_joints_of_another_hand_are_said(file: Callable[[str], Path]) -> None:
    read = ISAAC_GRASP_FORMAT.read(
        file(MANUAL.replace("panda_finger_joint1", "fr3_joint")), PANDA_GRIPPER
    )
    assert np.isnan(read.grasps.width[0])
    assert any("fr3_joint" in note for note in read.notes)


def test_values_by_the_names_of_our_own_columns_are_left_aside(file: Callable[[str], Path]) -> None:
    text = MANUAL.replace("confidence: 1.0", "confidence: 1.0\n      width: 7\n      group: left")
    read = ISAAC_GRASP_FORMAT.read(file(text), PANDA_GRIPPER)
    assert read.grasps.width[0] == pytest.approx(2 * 0.00943)
    assert read.grasps.columns["group"].tolist() == ["left"]
    assert any("Ignored: width" in note for note in read.notes)


def test_no_grasps_are_no_error(file: Callable[[str], Path]) -> None:
    path = file(MANUAL.split("grasps:")[0] + "grasps: {}\n")
    assert len(ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER).grasps) == 0


TWICE = MANUAL + MANUAL.split("grasps:\n")[1]
QUATERNION = "{w: 0.00332, xyz: [0.98453, 0.16837, 0.04837]}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the document is empty"),
        ("- 1\n- 2\n", "format: a list instead of isaac_grasp"),
        ("hello", "format: 'hello' instead of isaac_grasp"),
        (MANUAL.replace("isaac_grasp", "acronym"), "format: 'acronym' instead of isaac_grasp"),
        (MANUAL.replace("version: 1.0", "version: 2.0"), "format_version: '2.0' cannot be read"),
        (MANUAL.replace("grasps:", "poses:"), "grasps: missing"),
        (
            MANUAL.split("  grasp_0")[0] + "  - a\n",
            "grasps: a list instead of grasps by name",
        ),
        (MANUAL.split("  grasp_0")[0] + "  a: 1\n", r"grasps\.a: '1' instead of position"),
        (TWICE, r":16: 'grasp_0' appears twice"),
        (MANUAL.replace("position: [-", "place: [-", 1), r"grasps\.grasp_0\.position: missing"),
        (
            MANUAL.replace("-0.04346, ", ""),
            r"grasp_0.position: a list instead of 3 numbers",
        ),
        (MANUAL.replace("[-0.04346, 0.06759, 0.19895]", "[[1, 2, 3]]"), "instead of 3 numbers"),
        (
            MANUAL.replace("confidence: 1.0", "confidence: [1.0]"),
            "confidence: a list instead of",
        ),
        (MANUAL.replace("-0.04346", "left"), r"grasp_0\.position: 'left' instead of a finite"),
        (MANUAL.replace("-0.04346", ".nan"), r"grasp_0\.position: '\.nan' instead of a finite"),
        (MANUAL.replace("-0.04346", ".inf"), r"grasp_0\.position: '\.inf' instead of a finite"),
        (MANUAL.replace("-0.04346", "inf"), r"grasp_0\.position: 'inf' instead of a finite"),
        (
            MANUAL.replace("-0.04346", "[1]"),
            r"grasp_0.position: a list instead of a finite",
        ),
        (
            MANUAL.replace(QUATERNION, "[1, 0, 0, 0]"),
            r"grasp_0.orientation: a list instead of",
        ),
        (
            MANUAL.replace("w: 0.00332, ", ""),
            r"grasp_0.orientation: a dict instead of {w",
        ),
        (
            MANUAL.replace("xyz:", "xyzw:"),
            r"grasp_0.orientation: a dict instead of {w",
        ),
        (
            MANUAL.replace("0.16837, ", ""),
            r"grasp_0.orientation: a list instead of 4 numbers",
        ),
        (MANUAL.replace("0.98453", "0.9"), r"grasp_0.orientation: the quaternion has length 0.9"),
        (MANUAL.replace(QUATERNION, "{w: 0, xyz: [0, 0, 0]}"), "quaternion has length 0;"),
        (MANUAL.replace("confidence: 1.0", "confidence: high"), r"confidence: 'high' instead of"),
        (MANUAL.replace("0.00943", "wide"), r"cspace_position\.panda_finger_joint1: 'wide'"),
        (
            MANUAL.replace("      cspace_position:\n", "      cspace_position: 3\n").replace(
                "        panda_finger_joint1: 0.00943\n", ""
            ),
            r"cspace_position: '3' instead of",
        ),
        (MANUAL.replace("mug\n", "mug\nobject_file: a.obj\nobject_scale: 0\n"), "object_scale: 0"),
        (
            MANUAL.replace("mug\n", "mug\nobject_file: a.obj\nobject_scale: x\n"),
            "object_scale: 'x'",
        ),
        (MANUAL[:200] + "}", r"grasps\.yaml:\d+: not valid YAML"),
        (MANUAL.replace("position: [-0.04346", "position: [*p"), "not valid YAML|has no anchor"),
    ],
)
def test_malformed_files_say_where(file: Callable[[str], Path], text: str, said: str) -> None:
    path = file(text)
    with pytest.raises(InvalidInputError, match=said) as caught:
        ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_binary_files_are_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\x00\xff\xfe" * 50)
    assert not ISAAC_GRASP_FORMAT.recognises(path)
    with pytest.raises(InvalidInputError, match="not a text file"):
        ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER)


def test_every_line_of_a_file_can_be_the_last(file: Callable[[str], Path]) -> None:
    lines = CUBE.splitlines()
    for n in range(len(lines)):
        path = file("\n".join(lines[:n]))
        try:
            assert len(ISAAC_GRASP_FORMAT.read(path, PANDA_GRIPPER).grasps) == 1
        except InvalidInputError as error:
            assert str(path) in str(error)


def test_widths_beyond_all_numbers_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    ISAAC_GRASP_FORMAT.write(
        GraspSet.create(np.eye(4), object="mug", width=0.04, score=1.0), path, PANDA_GRIPPER
    )
    path.write_text(path.read_text().replace("joint1: 0.02", "joint1: 1e308"))
    with pytest.raises(InvalidInputError, match=r"a\.yaml: width\[0\] is inf"):
        read_grasp_file(path)
