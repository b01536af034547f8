"""Files in the layout of graspnetAPI's `GraspGroup`; its gripper is drawn by its own rules."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, GraspSet, InvalidInputError, make_pose
from burg_drake.formats import (
    GRASPNET_FORMAT,
    PANDA_GRIPPER,
    Gripper,
    graspnet_X_FG,
    read_grasp_file,
    write_grasp_file,
)
from burg_drake.grasping import sample_antipodal

DOWN_THE_CAMERA = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
"""Approach along the camera's z, closing along its y: columns are x, y, z of their grasp frame."""

SINGLE = "Numbers are stored in single precision."


def grasp_group(path: Path, *rows: tuple[Any, ...]) -> Path:
    """What `GraspGroup.save_npy` writes of `Grasp(score, width, height, depth, R, t, id)`."""
    array = np.zeros((0, 17), dtype=np.float32)
    for score, width, height, depth, R, t, number in rows:
        flat = [np.array((score, width, height, depth)), np.reshape(R, -1), t, [number]]
        array = np.concatenate((array, np.concatenate(flat).astype(np.float32).reshape((-1, 17))))
    np.save(path, array)
    return path


def finger_tips(row: Array) -> Array:
    """(2, 3) inner ends of the fingers that `plot_gripper_pro_max` draws."""
    width, depth, R, t = row[1], row[3], row[4:13].reshape(3, 3), row[13:16]
    return np.array([[depth, -width / 2, 0.0], [depth, width / 2, 0.0]]) @ R.T + t


def test_a_cube_below_the_camera(
    tmp_path: Path, assert_grips_the_cube: Callable[[Array], None]
) -> None:
    # a cube of 40 mm with its centre 0.5 m below the camera; the tips 9.5 mm below the centre
    path = grasp_group(
        tmp_path / "a.npy",
        (0.7, 0.06, 0.02, 0.0295, DOWN_THE_CAMERA, (0.0, 0.0, 0.48), 5),
        (0.3, 0.08, 0.02, 0.01, DOWN_THE_CAMERA, (0.0, 0.0, 0.48), -1),
    )
    imported = GRASPNET_FORMAT.read(path, PANDA_GRIPPER)
    assert (imported.frame, imported.notes) == ("camera", ())
    grasps = imported.grasps
    looking_down = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.5))
    assert_grips_the_cube(np.round(looking_down @ grasps.X_OG[0], 7))  # single precision
    np.testing.assert_allclose(grasps.X_OG[1, :3, 3], [0, 0, 0.49 - 0.0095], atol=1e-7)
    np.testing.assert_allclose(grasps.column("pregrasp_width"), [0.06, 0.08], rtol=1e-7)
    assert np.isnan(grasps.width).all()  # where the contacts are is not told
    np.testing.assert_allclose(grasps.score, [0.7, 0.3], rtol=1e-7)
    np.testing.assert_allclose(grasps.column("height"), 0.02, rtol=1e-7)
    np.testing.assert_allclose(grasps.column("depth"), [0.0295, 0.01], rtol=1e-7)
    assert grasps.column("object_id").tolist() == [5, -1]
    assert set(grasps.object.tolist()) == {""}


def test_their_finger_tips_are_ours(random_grasps: Callable[..., GraspSet], tmp_path: Path) -> None:
    opening = np.linspace(0.03, 0.08, 50)
    grasps = random_grasps(50, 0).with_columns(
        depth=np.linspace(0.0, 0.04, 50), pregrasp_width=opening
    )
    GRASPNET_FORMAT.write(grasps, tmp_path / "a.npy", PANDA_GRIPPER)
    for row, X_CG, width in zip(np.load(tmp_path / "a.npy"), grasps.X_OG, opening, strict=True):
        along, approach = X_CG[:3, 0], X_CG[:3, 2]
        tip = X_CG[:3, 3] + 0.0095 * approach
        expected = np.array([tip - width / 2 * along, tip + width / 2 * along])
        np.testing.assert_allclose(finger_tips(row.astype(float)), expected, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_round_trip(seed: int, random_grasps: Callable[..., GraspSet], tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    grasps = random_grasps(200, seed).with_columns(
        pregrasp_width=rng.uniform(0.0, 0.08, 200),
        depth=rng.uniform(0.01, 0.04, 200),
        height=0.02,
        object_id=rng.integers(-1, 80, 200),
    )
    notes = GRASPNET_FORMAT.write(grasps, tmp_path / "a.npy", PANDA_GRIPPER)
    assert notes == ("GraspNet-1Billion has no place for width, id, object.", SINGLE)
    assert np.load(tmp_path / "a.npy").dtype == np.float32
    assert GRASPNET_FORMAT.recognises(tmp_path / "a.npy")
    back = GRASPNET_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER).grasps
    np.testing.assert_allclose(back.X_OG, grasps.X_OG, atol=1e-6)
    for name in ("pregrasp_width", "score", "depth", "height", "object_id"):
        np.testing.assert_allclose(back.column(name), grasps.column(name), rtol=1e-6)


def test_each_grasp_is_read_alike_alone(
    random_grasps: Callable[..., GraspSet], tmp_path: Path
) -> None:
    GRASPNET_FORMAT.write(random_grasps(20, 1), tmp_path / "a.npy", PANDA_GRIPPER)
    together = GRASPNET_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER).grasps
    for i, row in enumerate(np.load(tmp_path / "a.npy")):
        np.save(tmp_path / "one.npy", row[None])
        assert (
            GRASPNET_FORMAT.read(tmp_path / "one.npy", PANDA_GRIPPER).grasps.id[0] == together.id[i]
        )


def test_what_is_not_known_gets_what_networks_write(tmp_path: Path) -> None:
    grasps = GraspSet.create(make_pose(p_AB=[[0, 0, 0.5], [0, 0, 0.6]]), object="")
    notes = GRASPNET_FORMAT.write(grasps, tmp_path / "a.npy", PANDA_GRIPPER)
    assert notes == (
        "GraspNet-1Billion has no place for id.",
        "2 grasps of unknown width got the hand's opening of 0.08 m.",
        "2 grasps without a score got score 0.",
        SINGLE,
    )
    rows = np.load(tmp_path / "a.npy").astype(float)
    np.testing.assert_allclose(rows[:, :4], [[0, 0.08, 0.02, 0.02]] * 2, rtol=1e-6)
    assert rows[:, 16].tolist() == [-1, -1]


def collides(rows: Array, surface: trimesh.Trimesh) -> np.ndarray:
    """(N,) whether points of a surface are in the hand of a row.

    The hand is that of `collision_detection` in graspnetAPI/utils/eval_utils.py, with its figures:
    fingers 10 mm thick from +-width/2 on, from 20 mm behind the origin to `depth` beyond it, and a
    base of 10 mm behind them.
    """
    points = trimesh.sample.sample_surface(surface, 5000, seed=1)[0]
    height, finger, base = 0.02, 0.01, 0.02
    width, depth = rows[:, 1, None], rows[:, 3, None]
    p = (points - rows[:, None, 13:16]) @ rows[:, 4:13].reshape(-1, 3, 3)
    x, y, z = np.moveaxis(p, -1, 0)
    level = np.abs(z) < height / 2
    beside = (np.abs(y) > width / 2) & (np.abs(y) < width / 2 + finger) & (x > -base) & (x < depth)
    behind = (np.abs(y) < width / 2 + finger) & (x > -base - finger) & (x < -base)
    return (level & (beside | behind)).any(axis=1)


@pytest.mark.parametrize(
    "surface",
    [trimesh.creation.icosphere(4, 0.025), trimesh.creation.box((0.04, 0.06, 0.02))],
    ids=["sphere", "box"],
)
def test_sampled_grasps_do_not_collide_by_their_rules(
    surface: trimesh.Trimesh, tmp_path: Path
) -> None:
    sampled = sample_antipodal(surface, 200, np.random.default_rng(0), object="thing")
    notes = GRASPNET_FORMAT.write(sampled, tmp_path / "a.npy", PANDA_GRIPPER)
    assert notes[1].endswith(
        "200 grasps got the distance of their contacts and 20 mm, at most 0.08 m."
    )
    rows = np.load(tmp_path / "a.npy").astype(float)
    open_wide = rows.copy()
    open_wide[:, 1] = 0.08
    # what hits the hand open wide hits the fingers' insides or the base, whatever is written
    np.testing.assert_array_equal(collides(rows, surface), collides(open_wide, surface))
    assert collides(rows, surface).mean() < 0.5
    at_the_contacts = rows.copy()
    at_the_contacts[:, 1] = sampled.width
    assert collides(at_the_contacts, surface).mean() > 0.9


def test_the_opening_of_a_network_is_not_taken_for_a_closed_hand(tmp_path: Path) -> None:
    path = grasp_group(tmp_path / "a.npy", (0.7, 0.08, 0.02, 0.02, np.eye(3), (0, 0, 0), -1))
    read = GRASPNET_FORMAT.read(path, PANDA_GRIPPER).grasps
    mug = GraspSet.create(read.X_OG, object="mug", width=read.width, columns=read.columns)
    write_grasp_file(mug, tmp_path / "a.yaml", "isaac_grasp")
    back = read_grasp_file(tmp_path / "a.yaml").grasps
    assert np.isnan(back.width[0])
    assert back.column("pregrasp_width")[0] == pytest.approx(0.08)


def test_openings_are_given_known_or_assumed(tmp_path: Path) -> None:
    grasps = GraspSet.create(
        make_pose(p_AB=np.zeros((4, 3))), object="", width=[0.03, 0.03, 0.07, np.nan], score=1.0
    ).with_columns(pregrasp_width=[0.06, np.nan, np.nan, np.nan])
    notes = GRASPNET_FORMAT.write(grasps, tmp_path / "a.npy", PANDA_GRIPPER)
    np.testing.assert_allclose(np.load(tmp_path / "a.npy")[:, 1], [0.06, 0.05, 0.08, 0.08])
    assert notes == (
        "GraspNet-1Billion has no place for width, id.",
        (
            "The width in the file is the opening when the hand arrives: 2 grasps got the"
            " distance of their contacts and 20 mm, at most 0.08 m."
        ),
        "1 grasps of unknown width got the hand's opening of 0.08 m.",
        SINGLE,
    )


def test_no_grasps(tmp_path: Path) -> None:
    GRASPNET_FORMAT.write(
        GraspSet.create(np.empty((0, 4, 4)), object=""), tmp_path / "a.npy", PANDA_GRIPPER
    )
    assert np.load(tmp_path / "a.npy").shape == (0, 17)
    assert GRASPNET_FORMAT.recognises(tmp_path / "a.npy")
    assert len(GRASPNET_FORMAT.read(tmp_path / "a.npy", PANDA_GRIPPER).grasps) == 0


def test_the_tips_of_another_hand(tmp_path: Path) -> None:
    long = Gripper("long", "hand", PANDA_GRIPPER.X_HG, 0.03, (0.0, 0.1), PANDA_GRIPPER.joints)
    row = (0.5, 0.06, 0.02, 0.02, np.eye(3), (0.0, 0.0, 0.0), -1)
    path = grasp_group(tmp_path / "a.npy", row)
    grasps = GRASPNET_FORMAT.read(path, long).grasps
    np.testing.assert_allclose(grasps.X_OG[0, :3, 3], [-0.01, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(grasps.X_OG[0, :3, 2], [1.0, 0.0, 0.0])
    np.testing.assert_allclose(
        GRASPNET_FORMAT.X_GF(long) @ graspnet_X_FG(0.02, long), np.eye(4), atol=1e-15
    )


MIRRORED = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            (0, 0, 0, np.nan, np.eye(3), (0, 0, 0), 0),
            "row 1 has depth nan; depths must be in metres",
        ),
        ((0, 0, 0, 20.0, np.eye(3), (0, 0, 0), 0), "row 1 has depth 20; depths must be in metres"),
        ((0, 0, 0, 0.02, np.zeros((3, 3)), (0, 0, 0), 0), r"columns 4 to 15\[1\] is not a"),
        (
            (0, 0, 0, 0.02, MIRRORED, (0, 0, 0), 0),
            r"columns 4 to 15\[1\] is a reflection",
        ),
        ((0, 0, 0, 0.02, np.eye(3), (0, np.inf, 0), 0), r"columns 4 to 15\[1\] has NaN or inf"),
    ],
)
def test_rows_that_are_no_grasps(row: tuple[Any, ...], message: str, tmp_path: Path) -> None:
    good = (0, 0, 0, 0.02, np.eye(3), (0, 0, 0), 0)
    with pytest.raises(InvalidInputError, match=message):
        GRASPNET_FORMAT.read(grasp_group(tmp_path / "a.npy", good, row), PANDA_GRIPPER)


def test_other_files(tmp_path: Path) -> None:
    np.save(tmp_path / "rect.npy", np.zeros((3, 7)))
    np.save(tmp_path / "text.npy", np.array(["a"]))
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    np.savez(tmp_path / "zip.npy.npz", a=np.zeros((3, 17)))
    good = grasp_group(tmp_path / "good.npy", (0, 0, 0, 0.02, np.eye(3), (0, 0, 0), 0))
    (tmp_path / "cut.npy").write_bytes(good.read_bytes()[:-20])
    (tmp_path / "empty.npy").write_bytes(b"")
    for name, message in {
        "rect.npy": r"has shape \(3, 7\); expected \(N, 17\)",
        "text.npy": r"has shape \(1,\); expected \(N, 17\)",
        "objects.npy": "holds pickled Python objects, which are not read",
        "zip.npy.npz": "is not a .npy file of numbers: the magic string is not correct",
        "cut.npy": "is damaged or cut off: its array of shape",
        "empty.npy": "is not a .npy file of numbers",
        "missing.npy": "cannot read .*: No such file or directory",
    }.items():
        assert GRASPNET_FORMAT.recognises(tmp_path / name) == (
            name == "cut.npy"
        )  # its header is whole
        with pytest.raises(InvalidInputError, match=message):
            GRASPNET_FORMAT.read(tmp_path / name, PANDA_GRIPPER)
    with pytest.raises(InvalidInputError, match="column 'depth' holds text"):
        text = GraspSet.create(np.eye(4), object="").with_columns(depth="deep")
        GRASPNET_FORMAT.write(text, tmp_path / "a.npy", PANDA_GRIPPER)
