"""Steps between reading and writing: names, selection, success, a file for each object."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError
from burg_drake.formats import (
    GRASP_FORMATS,
    PANDA_GRIPPER,
    with_objects_renamed,
    with_success,
    write_each_object,
)


@pytest.fixture
def both(random_grasps: Callable[..., GraspSet]) -> GraspSet:
    return GraspSet.concatenate(
        [random_grasps(3, 1, success=True), random_grasps(2, 2, object="1a/2b", success=True)]
    )


def test_objects_are_renamed_with_what_files_said_of_them() -> None:
    grasps = GraspSet.create(
        np.eye(4),
        object="10f6",
        score=0.5,
        width=0.02,
        columns={"epsilon": [0.1]},
        provenance={"object_files": {"10f6": {"file": "10f6.obj", "scale": 0.5}}, "seed": 1},
    )
    renamed = with_objects_renamed(grasps, {"10f6": "mug"})
    expected = GraspSet.create(np.eye(4), object="mug", width=0.02)
    assert renamed.object.tolist() == ["mug"] and renamed.id[0] == expected.id[0]
    assert (renamed.score[0], renamed.width[0], renamed.columns["epsilon"][0]) == (0.5, 0.02, 0.1)
    assert renamed.provenance == {
        "object_files": {"mug": {"file": "10f6.obj", "scale": 0.5}},
        "seed": 1,
    }
    assert with_objects_renamed(grasps, {"": "mug"}).object.tolist() == ["mug"]


def test_a_name_that_stays_gives_the_same_bytes_as_a_new_set() -> None:
    X_OG = np.stack([np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])])
    both = GraspSet.create(X_OG, object=["mug", "screwdriver"])
    kept, expected = both.select([0]), GraspSet.create(X_OG[:1], object="mug")
    renamed = with_objects_renamed(kept, {"mug": "mug"})
    assert renamed.object.dtype == expected.object.dtype != kept.object.dtype
    assert renamed.id.tolist() == expected.id.tolist() and renamed.X_OG is kept.X_OG
    moved = replace(kept, X_OG=X_OG[1:])  # its identifier is that of the old pose
    fresh = GraspSet.create(X_OG[1:], object="mug")
    assert with_objects_renamed(moved, {"mug": "mug"}).id.tolist() == fresh.id.tolist()
    swapped = with_objects_renamed(both, {"mug": "screwdriver", "screwdriver": "mug"})
    assert swapped.object.tolist() == ["screwdriver", "mug"]


def test_names_that_do_not_fit_are_refused(both: GraspSet) -> None:
    with pytest.raises(UnknownNameError, match=r"object 'mag'; did you mean 'mug'"):
        with_objects_renamed(both, {"mag": "cup"})
    with pytest.raises(InvalidInputError, match=r"\(1a/2b, mug\); .* 'cup'"):
        with_objects_renamed(both, {"": "cup"})


def test_success_is_what_scores_above_the_limit() -> None:
    grasps = GraspSet.create(np.repeat(np.eye(4)[None], 3, 0), object="a", score=[0.4, 0.5, np.nan])
    success = with_success(grasps, 0.4).columns["object_in_gripper"]
    np.testing.assert_array_equal(success, [0.0, 1.0, np.nan])


def test_a_folder_gets_one_file_an_object(tmp_path: Path, both: GraspSet) -> None:
    notes = write_each_object(both, tmp_path / "new", GRASP_FORMATS["graspgen"], PANDA_GRIPPER)
    assert sorted(path.name for path in notes) == ["1a_2b.json", "mug.json"]
    counts = {
        path.name: len(json.loads(path.read_text())["grasps"]["transforms"]) for path in notes
    }
    assert counts == {"1a_2b.json": 2, "mug.json": 3}


@pytest.mark.parametrize("name", ["..", "../x", "ä" * 200])
def test_no_name_of_an_object_leads_elsewhere(
    tmp_path: Path, random_grasps: Callable[..., GraspSet], name: str
) -> None:
    grasps = random_grasps(1, 3, object=name, success=True)
    (path,) = write_each_object(grasps, tmp_path, GRASP_FORMATS["graspgen"], PANDA_GRIPPER)
    assert list(tmp_path.iterdir()) == [path] and not path.name.startswith(".")


def test_two_objects_never_share_a_file(
    tmp_path: Path, both: GraspSet, random_grasps: Callable[..., GraspSet]
) -> None:
    clash = GraspSet.concatenate([both, random_grasps(1, 3, object="1a_2b", success=True)])
    with pytest.raises(InvalidInputError, match="'1a/2b' and of '1a_2b'"):
        write_each_object(clash, tmp_path, GRASP_FORMATS["graspgen"], PANDA_GRIPPER)
    assert not list(tmp_path.iterdir())
