"""Files in the layout of `write_grasp` in src/vgn/io.py, read back as `read_grasp` does."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, GraspSet, InvalidInputError, make_pose
from burg_drake.formats import PANDA_GRIPPER, VGN_FORMAT

HEADER = "scene_id,qx,qy,qz,qw,x,y,z,width,label"
DOWN = "0.0,1.0,0.0,0.0"
"""Half a turn about y: z, the approach, points down, and the fingers close along y."""


def grasps_csv(path: Path, *lines: str, header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def finger_tip(row: dict[str, str]) -> Array:
    """(3,) the middle of the tips, at the end of the lines that src/vgn/vis.py draws."""
    R = Rotation.from_quat([float(row[q]) for q in ("qx", "qy", "qz", "qw")]).as_matrix()
    return R @ [0.0, 0.0, 0.05] + [float(row[c]) for c in "xyz"]


def test_a_cube_from_above(tmp_path: Path, assert_grips_the_cube: Callable[[Array], None]) -> None:
    # tips 9.5 mm below the cube's centre, where the Panda's tips are with G in the centre
    path = grasps_csv(
        tmp_path / "grasps.csv",
        f"7f1c,{DOWN},0.0,0.0,0.0405,0.04,1",
        f"7f1c,{DOWN},0.1,0.2,0.3,0.08,0",
    )
    imported = VGN_FORMAT.read(path, PANDA_GRIPPER)
    assert imported.frame == "world"
    assert imported.notes == ("the width of 1 failed grasps was ignored: it is the open hand's.",)
    grasps = imported.grasps
    assert_grips_the_cube(grasps.X_OG[0])
    np.testing.assert_allclose(grasps.X_OG[1, :3, 3], [0.1, 0.2, 0.2595], atol=1e-15)
    np.testing.assert_array_equal(grasps.width, [0.04, np.nan])
    assert grasps.column("label").tolist() == [1.0, 0.0]
    assert grasps.column("scene_id").tolist() == ["7f1c", "7f1c"]
    assert np.isnan(grasps.score).all()


def test_the_closing_axis_is_theirs(tmp_path: Path) -> None:
    # a quarter turn about z: their y is -x, and the approach stays +z
    s = 2**-0.5
    path = grasps_csv(tmp_path / "a.csv", f"0,0.0,0.0,{s!r},{s!r},0.0,0.0,0.0,0.08,0")
    X_VG = VGN_FORMAT.read(path, PANDA_GRIPPER).grasps.X_OG[0]
    np.testing.assert_allclose(X_VG[:3, 0], [-1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(X_VG[:3, 2], [0.0, 0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_round_trip(seed: int, random_grasps: Callable[..., GraspSet], tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    grasps = random_grasps(100, seed).with_columns(
        label=rng.integers(0, 2, 100), scene_id=rng.choice(["a1", "b2"], 100)
    )
    path = tmp_path / "grasps.csv"
    failed = grasps.column("label") == 0
    assert VGN_FORMAT.write(grasps, path, PANDA_GRIPPER) == (
        "VGN and GIGA has no place for id, object, score.",
        f"{failed.sum()} failed grasps got the hand's opening of 0.08 m as width.",
    )
    assert VGN_FORMAT.recognises(path)
    back = VGN_FORMAT.read(path, PANDA_GRIPPER).grasps
    np.testing.assert_allclose(back.X_OG, grasps.X_OG, atol=1e-14)
    np.testing.assert_array_equal(back.width, np.where(failed, np.nan, grasps.width))
    for name in ("label", "scene_id"):
        np.testing.assert_array_equal(back.column(name), grasps.column(name))
    with path.open() as file:
        rows = list(csv.DictReader(file))
    tips = grasps.X_OG[:, :3, 3] + 0.0095 * grasps.X_OG[:, :3, 2]
    np.testing.assert_allclose([finger_tip(row) for row in rows], tips, atol=1e-14)
    assert path.read_text().splitlines()[0] == HEADER
    assert {row["label"] for row in rows} == {"0", "1"}
    assert {row["width"] for row in rows if row["label"] == "0"} == {"0.08"}


def test_each_grasp_is_read_alike_alone(
    random_grasps: Callable[..., GraspSet], tmp_path: Path
) -> None:
    VGN_FORMAT.write(random_grasps(20, 1), tmp_path / "all.csv", PANDA_GRIPPER)
    together = VGN_FORMAT.read(tmp_path / "all.csv", PANDA_GRIPPER).grasps
    for i, line in enumerate((tmp_path / "all.csv").read_text().splitlines()[1:]):
        alone = VGN_FORMAT.read(grasps_csv(tmp_path / "one.csv", line), PANDA_GRIPPER).grasps
        assert alone.id[0] == together.id[i]


def test_outcomes_of_trials_become_labels(tmp_path: Path) -> None:
    """A grasp that the arm can execute, and nobody has tried, is no failure."""
    X_OG = make_pose(p_AB=[[0, 0, 0.1], [0, 0, 0.2], [0, 0, 0.3]])
    outcome = ["lifted", "no_contact", "reachable"]
    grasps = GraspSet.create(X_OG, object="").with_columns(outcome=outcome)
    notes = VGN_FORMAT.write(grasps, tmp_path / "scene_7.csv", PANDA_GRIPPER)
    assert notes == (
        "VGN and GIGA has no place for id.",
        "1 failed grasps got the hand's opening of 0.08 m as width.",
        "2 grasps have no width; their cells are empty.",
    )
    back = VGN_FORMAT.read(tmp_path / "scene_7.csv", PANDA_GRIPPER).grasps
    np.testing.assert_array_equal(back.column("label"), [1.0, 0.0, np.nan])
    assert np.isnan(back.width).all()
    assert set(back.column("scene_id").tolist()) == {"scene_7"}
    plain = GraspSet.create(X_OG, object="", width=0.05)
    assert VGN_FORMAT.write(plain, tmp_path / "b.csv", PANDA_GRIPPER) == (
        "VGN and GIGA has no place for id.",
        "No grasp has a label; the cells for it are empty.",
    )


def test_further_columns_come_along(tmp_path: Path) -> None:
    header = "x,y,z,qx,qy,qz,qw,quality,planner"  # predictions, in another order
    path = grasps_csv(tmp_path / "a.csv", f"0.1,0.2,0.3,{DOWN},0.93,giga", header=header)
    assert VGN_FORMAT.recognises(path)
    grasps = VGN_FORMAT.read(path, PANDA_GRIPPER).grasps
    assert grasps.column("quality").tolist() == [0.93]
    assert grasps.column("planner").tolist() == ["giga"]
    assert np.isnan(grasps.width).all()


def test_no_grasps(tmp_path: Path) -> None:
    VGN_FORMAT.write(
        GraspSet.create(np.empty((0, 4, 4)), object=""), tmp_path / "a.csv", PANDA_GRIPPER
    )
    assert len(VGN_FORMAT.read(tmp_path / "a.csv", PANDA_GRIPPER).grasps) == 0


@pytest.mark.parametrize(
    ("header", "line", "message"),
    [
        (HEADER, f"a,{DOWN},0,0,0.1,0.08", ":2: the row has 9 cells, the header has 10"),
        (HEADER, f"a,{DOWN},0,zero,0.1,0.08,1", ":2: y is 'zero', not a number"),
        (HEADER, f"a,{DOWN},0,nan,0.1,0.08,1", ":2: y is nan; give a finite number"),
        (HEADER, f"a,{DOWN},0,0,0.1,inf,1", ":2: width is inf; give a finite number"),
        (HEADER, "a,0,0,0,0,0,0,0.1,0.08,1", ":2: qx, qy, qz, qw have length 0; a rotation has"),
        (HEADER, "a,1,1,0,0,0,0,0.1,0.08,1", ":2: qx, qy, qz, qw have length 1.41421; a rotation"),
        (
            "scene_id,x,y,z",
            "a,0,0,0",
            " has no column qx, qy, qz, qw; a file of VGN has the columns scene_id",
        ),
        (HEADER + ",x", f"a,{DOWN},0,0,0.1,0.08,1,2", ":1: column 'x' appears twice"),
    ],
)
def test_malformed(header: str, line: str, message: str, tmp_path: Path) -> None:
    path = grasps_csv(tmp_path / "a.csv", line, header=header)
    with pytest.raises(InvalidInputError) as error:
        VGN_FORMAT.read(path, PANDA_GRIPPER)
    assert str(error.value).startswith(f"{path}{message}")


def test_empty_lines_are_passed_over_and_counted(tmp_path: Path) -> None:
    good = f"a,{DOWN},0,0,0.1,0.08,1"
    path = grasps_csv(tmp_path / "a.csv", "", good, "", good.replace("0.1,", "high,"))
    with pytest.raises(InvalidInputError, match=r"a\.csv:5: z is 'high', not a number"):
        VGN_FORMAT.read(path, PANDA_GRIPPER)
    path = grasps_csv(tmp_path / "a.csv", "", good, "", "a,1,1,0,0,0,0,0.1,0.08,1")
    with pytest.raises(InvalidInputError, match=r"a\.csv:5: qx, qy, qz, qw have length"):
        VGN_FORMAT.read(path, PANDA_GRIPPER)
    path = grasps_csv(tmp_path / "a.csv", "", good, "", "a,1")
    with pytest.raises(InvalidInputError, match=r"a\.csv:5: the row has 2 cells"):
        VGN_FORMAT.read(path, PANDA_GRIPPER)
    assert len(VGN_FORMAT.read(grasps_csv(path, "", good, "", good), PANDA_GRIPPER).grasps) == 2


def test_a_table_of_results_is_not_taken_for_one(tmp_path: Path) -> None:
    header = "id,outcome,x,y,z,qw,qx,qy,qz,X_OG"
    path = tmp_path / "results.csv"
    for name, expected in ((header.removesuffix(",X_OG"), True), (header, False)):
        path.write_text(name + "\n")
        assert VGN_FORMAT.recognises(path) == expected


def test_other_files(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "binary.csv").write_bytes(b"\x89HDF\r\n\x1a\n\xff\xfe")
    for name, message in {
        "empty.csv": "is empty",
        "binary.csv": "is not a text file",
        "missing.csv": "cannot read",
    }.items():
        assert not VGN_FORMAT.recognises(tmp_path / name)
        with pytest.raises(InvalidInputError, match=message):
            VGN_FORMAT.read(tmp_path / name, PANDA_GRIPPER)
