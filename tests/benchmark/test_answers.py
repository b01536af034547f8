"""Answers of planners are read as grasps in the scene frame, or refused with the likely mix-up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.benchmark import (
    AnswerError,
    FarGraspsError,
    Observation,
    PlannedGrasps,
    frame_mistakes,
    read_answer,
)
from burg_drake.core import BurgError
from burg_drake.formats import PANDA_GRIPPER


def pose(euler_deg: tuple[float, float, float], p: tuple[float, float, float]) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix()
    X[:3, 3] = p
    return X


X_WS = pose((0, 0, -90), (0.24, 0.3, 0.0))
X_SC = pose((-140, 10, 20), (0.3, -0.3, 0.6))
X_WC = X_WS @ X_SC
OBSERVATION = Observation(
    id="ab12",
    color=None,
    depth=np.zeros((2, 2), np.float32),
    K=np.eye(3),
    X_WC=X_WC,
    X_WS=X_WS,
    bounds=np.array([[0.0, 0.0, 0.0], [0.6, 0.42, 0.4]]),
    hand={},
)
GRASPS = np.stack([pose((170, 5 * k, 30 * k), (0.1 + 0.05 * k, 0.2, 0.1)) for k in range(6)])
"""(6, 4, 4) in the scene frame."""
IN_CAMERA = np.linalg.inv(X_SC) @ GRASPS


def read(answer: Any, **options: Any) -> PlannedGrasps:
    return read_answer(answer, OBSERVATION, PANDA_GRIPPER, **options)


@pytest.mark.parametrize(
    ("entry", "X"), [("X_CG", IN_CAMERA), ("X_WG", X_WS @ GRASPS), ("X_SG", GRASPS)]
)
def test_each_frame_leads_to_the_scene(entry: str, X: np.ndarray) -> None:
    found = read({entry: X})
    np.testing.assert_allclose(found.X_SG, GRASPS, atol=1e-9)
    assert found.score.tolist() == [6, 5, 4, 3, 2, 1]
    assert np.isnan(found.width).all() and np.isnan(found.time) and found.notes == ()


def test_grasps_are_sorted_by_score_and_stay_in_order_where_equal() -> None:
    answer = {
        "X_SG": GRASPS.astype(np.float32),
        "score": np.array([1, 3, 1, 3, 200, 0], np.uint8),
        "width": [0.01, 0.02, np.nan, 0.04, 0.05, 0.06],
        "time": np.float32(0.5),
        "observation": np.str_("ab12"),
    }
    found = read(answer)
    order = [4, 1, 3, 0, 2, 5]
    np.testing.assert_allclose(found.X_SG, GRASPS[order], atol=1e-6)
    np.testing.assert_array_equal(found.width, np.array(answer["width"])[order])
    assert found.score.tolist() == [200, 3, 3, 1, 1, 0] and found.time == 0.5


def test_frames_of_projects_are_converted() -> None:
    """ACRONYM's origin is the hand's body, 103.4 mm behind; GraspNet's x is the approach."""
    behind = GRASPS @ pose((0, 0, 0), (0, 0, -0.1034))
    np.testing.assert_allclose(read({"X_SG": behind, "frame": "acronym"}).X_SG, GRASPS, atol=1e-9)
    found = read({"X_SG": GRASPS, "frame": np.array("graspnet")}).X_SG
    np.testing.assert_allclose(found[:, :3, 2], GRASPS[:, :3, 0], atol=1e-9)
    np.testing.assert_allclose(found[:, :3, 0], GRASPS[:, :3, 1], atol=1e-9)


@pytest.mark.parametrize("empty", [[], np.empty((0, 4, 4)), np.empty((0,), np.float32)])
def test_no_grasps_are_an_answer(empty: Any) -> None:
    found = read({"X_CG": empty, "score": [], "width": []})
    assert found.X_SG.shape == (0, 4, 4) and found.score.shape == found.width.shape == (0,)


def test_rounded_rotations_become_rotations() -> None:
    found = read({"X_SG": np.round(GRASPS, 4)})
    R = found.X_SG[:, :3, :3]
    np.testing.assert_allclose(R.transpose(0, 2, 1) @ R, np.tile(np.eye(3), (6, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(R, GRASPS[:, :3, :3], atol=2e-4)
    assert "off from orthonormal" in found.notes[0]


def changed(row: int, place: Any, value: float) -> np.ndarray:
    X = GRASPS.copy()
    X[(row, *place)] = value
    return X


MIRROR_Y, SWAP_YZ = np.diag([1.0, -1.0, 1.0, 1.0]), np.eye(4)[:, [0, 2, 1, 3]]
REFUSED: dict[str, tuple[Any, str]] = {
    "list": ([GRASPS], "the planner returned list; return a dict with one of X_CG, X_WG, X_SG"),
    "none": (None, "the planner returned NoneType"),
    "nothing": ({}, r"has no poses; return one of X_CG in the camera frame"),
    "pose of none": ({"X_CG": None}, "has no poses"),
    "two": ({"X_CG": GRASPS, "X_SG": GRASPS}, "has poses in X_CG and X_SG; return one of"),
    "inverse name": ({"X_GC": GRASPS}, "entry 'X_GC'; return the inverse of these poses, X_CG"),
    "plural": ({"X_CG": GRASPS, "scores": []}, "entry 'scores'; did you mean 'score'"),
    "number as name": ({3: GRASPS}, "unknown entry 3;"),
    "text": ({"X_CG": "none"}, "X_CG is 'none'; give an array of numbers"),
    "ragged": ({"X_CG": [[1.0], [1.0, 2.0]]}, "X_CG cannot be made an array of numbers"),
    "objects": ({"X_CG": [{"a": 1}]}, "X_CG is an array of object"),
    "complex": ({"X_CG": GRASPS + 0j}, "X_CG is an array of complex128"),
    "truth values": ({"X_CG": GRASPS > 0}, "X_CG is an array of bool"),
    "one pose": ({"X_CG": GRASPS[0]}, r"shape \(4, 4\); .* array of shape \(1, 4, 4\)"),
    "3x4": ({"X_CG": GRASPS[:, :3]}, r"shape \(6, 3, 4\); .* add the row 0 0 0 1"),
    "flat": ({"X_CG": GRASPS.reshape(6, 16)}, r"X_CG.reshape\(-1, 4, 4\)"),
    "quaternions": ({"X_CG": np.ones((6, 7))}, "make matrices of positions and quaternions"),
    "5-dimensional": ({"X_CG": GRASPS[None, None]}, r"has shape \(1, 1, 6, 4, 4\)"),
    "nan": ({"X_SG": changed(4, (0, 3), np.nan)}, r"1 of 6 poses of X_SG have NaN.*X_SG\[4\]"),
    "inf": ({"X_SG": changed(2, (0, 0), np.inf)}, "have NaN, infinite or huge numbers"),
    "huge": ({"X_SG": changed(2, (0, 0), 1e300)}, "have NaN, infinite or huge numbers"),
    "padding": ({"X_SG": np.concatenate([GRASPS, np.zeros((3, 4, 4))])}, "3 of 9 .* all zero"),
    "transposed": (
        {"X_SG": GRASPS.transpose(0, 2, 1)},
        r"6 of 6 poses of X_SG are transposed: .* return X_SG.transpose\(0, 2, 1\)",
    ),
    "last row": ({"X_SG": changed(1, (3, 3), 2.0)}, "have a last row that is not 0 0 0 1"),
    "mirrored": (
        {"X_SG": GRASPS @ MIRROR_Y},
        "6 of 6 .* left-handed.* an axis is mirrored, or two",
    ),
    "swapped": ({"X_SG": GRASPS @ SWAP_YZ}, "swapped, such as y and z"),
    "some mirrored": (
        {"X_SG": np.concatenate([GRASPS[:4], GRASPS[4:] @ MIRROR_Y])},
        "2 of 6 .* left-handed.* from eigenvectors or singular vectors",
    ),
    "scaled": (
        {"X_SG": GRASPS @ np.diag([2.5, 2.5, 2.5, 1.0])},
        "6 of 6 .* have axes of length 2.5, in place of 1",
    ),
    "sheared": ({"X_SG": changed(3, (0, 0), 0.3)}, "not orthonormal, off by up to 0.[0-9]+"),
    "count of scores": ({"X_SG": GRASPS, "score": np.ones(5)}, r"score has shape \(5,\), but .* 6"),
    "column": ({"X_SG": GRASPS, "score": np.ones((6, 1))}, r"score\[:, 0\] has it"),
    "nan score": ({"X_SG": GRASPS, "score": [1, 2, 3, 4, 5, np.nan]}, "1 of 6 scores are NaN"),
    "inf score": ({"X_SG": GRASPS, "score": [1, 2, 3, 4, 5, np.inf]}, "1 of 6 scores are NaN or"),
    "count of widths": ({"X_SG": GRASPS, "width": 0.05}, r"width has shape \(\), but there are 6"),
    "negative width": ({"X_SG": GRASPS, "width": -np.ones(6)}, "6 of 6 widths are negative"),
    "giant width": ({"X_SG": GRASPS, "width": np.full(6, 1e39)}, "6 of 6 widths are negative or"),
    "giant number": ({"X_SG": GRASPS, "frame": 10**5000}, "a number with thousands of digits"),
    "frame": ({"X_SG": GRASPS, "frame": "acronyms"}, "did you mean 'acronym'"),
    "number as frame": ({"X_SG": GRASPS, "frame": 3}, "frame 3 of the answer is not"),
    "time": ({"X_SG": GRASPS, "time": "fast"}, "time 'fast' of the answer is not a number"),
    "negative time": ({"X_SG": GRASPS, "time": -1.0}, "time -1 of the answer"),
    "other image": (
        {"X_SG": GRASPS, "observation": "ff"},
        "for observation 'ff', .* earlier image",
    ),
    "image as array": ({"X_SG": GRASPS, "observation": np.ones(3)}, "is for observation array"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_in_one_line(name: str) -> None:
    answer, message = REFUSED[name]
    with pytest.raises(AnswerError, match=message) as error:
        read(answer)
    assert "\n" not in str(error.value) and len(str(error.value)) < 400
    assert isinstance(error.value, BurgError) and isinstance(error.value, ValueError)


def test_an_array_class_that_fails_is_refused() -> None:
    class OnGraphicsCard:
        def __array__(self, *_: Any, **__: Any) -> np.ndarray:
            raise RuntimeError("copy the tensor\nto the host first")

    with pytest.raises(AnswerError, match=r"X_CG cannot be made .*: copy the tensor to the host"):
        read({"X_CG": OnGraphicsCard()})


def test_too_many_grasps_are_refused() -> None:
    assert len(read({"X_SG": GRASPS}, max_grasps=6).X_SG) == 6
    with pytest.raises(AnswerError, match="X_SG has 6 grasps; return the best, 5 at most"):
        read({"X_SG": GRASPS}, max_grasps=5)


def far_pose(k: int) -> np.ndarray:
    return pose((k, 0, 0), (3.0 + k, 0.0, 0.0))


MILLIMETRES = IN_CAMERA * np.array([1.0, 1.0, 1.0, 1000.0])
MILLIMETRES[:, 3, 3] = 1.0
X_SD = pose((-140, 10, 20), (0.3, -2.3, 2.6))
"""A camera that is 3 m away from the workspace."""
FROM_AFAR = Observation(**{**vars(OBSERVATION), "X_WC": X_WS @ X_SD})


@pytest.mark.parametrize(
    ("observation", "entry", "X", "words"),
    [
        (OBSERVATION, "X_CG", MILLIMETRES, "in millimetres, most"),
        (FROM_AFAR, "X_SG", np.linalg.inv(X_SD) @ GRASPS, "measured in the camera frame, most"),
        (FROM_AFAR, "X_CG", GRASPS, "in the world frame or measured in the scene frame, most"),
        (FROM_AFAR, "X_CG", np.linalg.inv(GRASPS) @ X_SD, "inverted, most"),
    ],
)
def test_far_grasps_are_refused_with_the_frame_that_they_fit(
    observation: Observation, entry: str, X: np.ndarray, words: str
) -> None:
    with pytest.raises(FarGraspsError, match=f"6 of 6 grasps of {entry} .*; if they are .*{words}"):
        read_answer({entry: X}, observation, PANDA_GRIPPER)


def test_a_few_far_grasps_stay_and_are_told() -> None:
    X = np.concatenate([GRASPS, np.stack([far_pose(0), far_pose(1)])])
    found = read({"X_SG": X})
    assert len(found.X_SG) == 8
    assert found.notes[0].startswith("2 of 8 grasps are more than 1 m away from the workspace")
    most = np.concatenate([GRASPS[:3], np.stack([far_pose(k) for k in range(4)])])
    with pytest.raises(FarGraspsError, match="4 of 7 grasps of X_SG") as error:
        read({"X_SG": most})
    assert "if they are" not in str(error.value)


def test_wide_widths_are_told() -> None:
    assert read({"X_SG": GRASPS, "width": np.full(6, 0.08, np.float32)}).notes == ()
    (note,) = read({"X_SG": GRASPS, "width": [0.09, 0.01, 0.01, 0.01, 0.01, np.nan]}).notes
    assert note == "1 of 6 widths are more than the 0.08 m to which the hand opens, up to 0.09 m."
    (note,) = read({"X_SG": GRASPS, "width": np.full(6, 60.0)}).notes
    assert note.endswith("are they in millimetres?")


def test_frame_mistakes_are_undone_by_their_lines() -> None:
    """Grasps with each mistake, made here, are right after the line in Python."""
    opengl = np.diag([1.0, -1.0, -1.0, 1.0])
    X_CW = np.linalg.inv(X_WC)
    made = {
        "X_CG": {"OpenGL": opengl @ IN_CAMERA, "wrong way": X_WC @ X_WS @ GRASPS},
        "X_WG": {"OpenGL": X_WC @ opengl @ IN_CAMERA, "wrong way": X_CW @ IN_CAMERA},
        "X_SG": {"OpenGL": X_SC @ opengl @ IN_CAMERA, "wrong way": np.linalg.inv(X_SC) @ IN_CAMERA},
    }
    right = {"X_CG": IN_CAMERA, "X_WG": X_WS @ GRASPS, "X_SG": GRASPS}
    for entry, mistakes in made.items():
        for name, X in mistakes.items():
            ((mistake, line),) = [
                (m, line)
                for m, line in frame_mistakes(entry, OBSERVATION).items()
                if name in m.words
            ]
            names = {"np": np, "observation": OBSERVATION, entry: X}
            exec(line, names)
            np.testing.assert_allclose(names[entry], right[entry], atol=1e-9)
            np.testing.assert_allclose(mistake.camera @ X, GRASPS, atol=1e-9)
