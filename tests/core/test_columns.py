"""Units and meaning of columns: one declaration, in every file."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from burg_drake.core import GraspSet, describe_column, make_pose


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("moved_a mug.2", "m"),
        ("pushed", "m"),
        ("pushed_mug", "m"),
        ("q_grasp_7", "rad"),
        ("tug_+x_g", "g"),
        ("tug_-z_N", "N"),
        ("shake_x_g", "g"),
        ("n_lifted_disturbed", "1"),
        ("given_slide", "m"),
        ("given_theirs", ""),
    ],
)
def test_names_with_varying_parts(name: str, unit: str) -> None:
    column = describe_column(name)
    assert column is not None and column.unit == unit


@pytest.mark.parametrize("name", ["theirs", "q_grasp_", "tug_w_g", "moved_", "slip2"])
def test_what_others_made_up_is_not_known(name: str) -> None:
    assert describe_column(name) is None


def test_datasets_of_grasps_say_their_units(tmp_path: Path) -> None:
    grasps = GraspSet.create(
        make_pose(p_AB=np.zeros((2, 3))),
        object="mug",
        width=0.04,
        columns={"slide": np.zeros(2), "theirs": np.zeros(2), "blocker": np.array(["", "box"])},
    )
    path = tmp_path / "grasps.h5"
    grasps.save(path)
    with h5py.File(path) as file:
        assert file["width"].attrs["unit"] == "m"
        assert file["columns/slide"].attrs["unit"] == "m"
        assert "slides in the hand" in file["columns/slide"].attrs["description"]
        assert file["columns/blocker"].attrs["unit"] == ""
        assert "unit" not in file["columns/theirs"].attrs
        assert all(file[name].attrs["description"] for name in ("X_OG", "id", "object", "score"))
    assert GraspSet.load(path).width.tolist() == [0.04, 0.04]


def test_metrics_are_described() -> None:
    from burg_drake.evaluation import SCENE_COLUMNS
    from burg_drake.grasping import METRICS

    assert all(map(describe_column, (*METRICS, *SCENE_COLUMNS)))
