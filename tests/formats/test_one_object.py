"""What the formats of one object share: names, descriptions, success, hands."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Outcome
from burg_drake.formats import (
    PANDA_GRIPPER,
    check_gripper_name,
    object_description,
    object_name,
    success_labels,
    with_objects_renamed,
)

THREE = np.repeat(np.eye(4)[None], 3, axis=0)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("meshes/Mug/10f6e09.obj", "10f6e09"),
        ("C:\\meshes\\mug.STL", "mug"),
        ("/World/mug", "mug"),
        ("/World/mug/", "mug"),
        ("objects/banana.1.0.obj", "banana.1.0"),
        ("v1.0", "v1.0"),
        ("000074a334c541878360457c672b6c2e", "000074a334c541878360457c672b6c2e"),
        (".obj", ".obj"),
        ("/libraries/household/mug/mesh.obj", "mug"),
        ("mug\\surface.obj", "mug"),
        ("mesh.obj", "mesh"),
        ("/mesh.obj", "mesh"),
    ],
)
def test_objects_are_called_after_their_files(file: str, name: str) -> None:
    assert object_name(file) == name


@pytest.mark.parametrize("parts", ["list", "mapping"])
def test_descriptions_are_found_in_parts_of_either_kind(parts: str) -> None:
    mug = {"file": "mug.obj", "scale": 0.5}
    told: list[dict[str, object]] = [{"seed": 1}, {"object_files": {"mug": mug}}]
    by_name = dict(zip(("left", "right"), told, strict=True))
    provenance = {"parts": told if parts == "list" else by_name}
    grasps = GraspSet.create(THREE, object="mug", provenance=provenance)
    assert object_description(grasps, "mug") == mug
    renamed = with_objects_renamed(grasps, {"mug": "cup"})
    assert object_description(renamed, "cup") == mug
    assert object_description(renamed, "mug") == {}


def test_descriptions_are_found_in_joined_sets() -> None:
    mug = {"file": "mug.obj", "scale": 0.5}
    one = GraspSet.create(THREE, object="mug", provenance={"object_files": {"mug": mug}})
    joined = GraspSet.concatenate([GraspSet.create(THREE, object="bowl"), one])
    assert object_description(one, "mug") == object_description(joined, "mug") == mug
    assert object_description(joined, "bowl") == {}


@pytest.mark.parametrize(
    "provenance",
    [
        {"object_files": {"mug": {"file": 5, "scale": "big", "mass": 10**400, "com": [[1], 2]}}},
        {"object_files": {"mug": "mug.obj"}},
        {"object_files": 7},
        {"parts": 5},
        {"parts": [1, {"parts": "abc"}]},
        {"parts": {"a": None}},
    ],
)
def test_a_provenance_that_says_nonsense_describes_nothing(provenance: dict[str, object]) -> None:
    grasps = GraspSet.create(THREE, object="mug")
    assert object_description(dataclasses.replace(grasps, provenance=provenance), "mug") == {}


def test_success_comes_from_the_column_then_outcomes_then_scores() -> None:
    grasps = GraspSet.create(THREE, object="mug", score=[1.0, 0.0, np.nan])
    np.testing.assert_array_equal(success_labels(grasps), [1, 0, np.nan])
    judged = grasps.with_columns(outcome=[Outcome.SLIPPED.value, Outcome.LIFTED.value, ""])
    np.testing.assert_array_equal(success_labels(judged), [0, 1, np.nan])
    told = judged.with_columns(object_in_gripper=[True, True, False])
    np.testing.assert_array_equal(success_labels(told), [1, 1, 0])
    scored = GraspSet.create(THREE, object="mug", score=[1.0, 0.5, 0.0])
    assert np.isnan(success_labels(scored)).all()


def test_lifted_alone_is_success() -> None:
    for outcome in Outcome:
        grasps = GraspSet.create(THREE[:1], object="a", columns={"outcome": [outcome.value]})
        success = success_labels(grasps)[0]
        if outcome in (Outcome.REACHABLE, Outcome.SIMULATION_FAILED):  # not known
            assert np.isnan(success)
        else:
            assert success == (outcome is Outcome.LIFTED)


def test_names_of_hands() -> None:
    assert check_gripper_name("panda", PANDA_GRIPPER, "a.h5") == ()
    assert check_gripper_name("franka_panda", PANDA_GRIPPER, "a.h5") == ()
    assert check_gripper_name("panda_hand", PANDA_GRIPPER, "a.h5") == ()
    assert check_gripper_name("mine", replace(PANDA_GRIPPER, name="mine"), "a.h5") == ()
    assert len(check_gripper_name("robotiq", PANDA_GRIPPER, "a.h5")) == 1
    with pytest.raises(InvalidInputError, match=r"a.h5: .* hand 'panda_hand', but hand"):
        check_gripper_name("panda", replace(PANDA_GRIPPER, name="wsg_50"), "a.h5")
