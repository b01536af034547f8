"""Files in the layout of GraspGen's docs/GRASP_DATASET_FORMAT.md and of what writes it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.core import Array, GraspSet, InvalidInputError
from burg_drake.formats import PANDA_GRIPPER, graspgen

# Straight down on a cube: the gripper's base 0.1034 m above the centre, its z down, x along y.
DOWN = [
    [0.0, 1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, -1.0, 0.1034],
    [0.0, 0.0, 0.0, 1.0],
]
OFFSET = "transform_offset_from_asset_to_graspgen_convention"
QUARTER = [[0.0, 0.0, 0.0], [0, 0, 0.7071, 0.7071]]
"""What GraspDataGen's datagen.py writes for a hand whose asset closes along y."""


@pytest.fixture
def file(tmp_path: Path) -> Callable[[Any], Path]:
    def make(document: Any) -> Path:
        path = tmp_path / "grasps.json"
        path.write_text(document if isinstance(document, str) else json.dumps(document, indent=2))
        return path

    return make


def document(**changed: Any) -> dict[str, Any]:
    """A file as the data set has them; keys with a dot go into the mapping of that name."""
    result: dict[str, Any] = {
        "object": {"file": "1a2b3c", "scale": 0.7},
        "grasps": {"transforms": [DOWN, DOWN], "object_in_gripper": [True, False]},
    }
    for key, value in changed.items():
        outer, _, inner = key.partition("__")
        target = result[outer] if inner else result
        if value is None:
            del target[inner or outer]
        else:
            target[inner or outer] = value
    return result


def positive_and_negative(path: Path) -> tuple[Array, Array]:
    """As the data set's documentation reads a file."""
    grasps_dict = json.loads(path.read_text())
    grasps = np.array(grasps_dict["grasps"]["transforms"])
    mask = np.array(grasps_dict["grasps"]["object_in_gripper"])
    return grasps[mask], grasps[~mask]


def test_a_grasp_on_a_cube_written_by_hand(
    file: Callable[[Any], Path], assert_grips_the_cube: Callable[[Array], None]
) -> None:
    path = file(document())
    assert graspgen.recognise_graspgen(path)
    read = graspgen.read_graspgen(path, PANDA_GRIPPER)
    grasps = read.grasps
    assert read.frame == "object"
    assert_grips_the_cube(grasps.X_OG[0])
    assert grasps.object.tolist() == ["1a2b3c"] * 2
    np.testing.assert_array_equal(grasps.score, [1, 0])
    assert grasps.provenance["object_files"]["1a2b3c"] == {"file": "1a2b3c", "scale": 0.7}
    assert any("scaled by 0.7" in note for note in read.notes)


@pytest.mark.parametrize(
    "offset", [QUARTER, [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]], ids=["pair", "matrix"]
)
def test_the_offset_of_an_asset_that_closes_along_y_is_applied(
    file: Callable[[Any], Path], assert_grips_the_cube: Callable[[Array], None], offset: Any
) -> None:
    down_y = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.1034], DOWN[3]]
    block = {"name": "franka_panda", "file_name": "a.usd", "width": 0.08, OFFSET: offset}
    path = file(document(gripper=block, grasps__transforms=[down_y, down_y]))
    assert_grips_the_cube(graspgen.read_graspgen(path, PANDA_GRIPPER).grasps.X_OG[0])


def test_the_offset_is_applied_from_the_right(file: Callable[[Any], Path]) -> None:
    offset = [[0.01, 0.02, 0.03], [0.0, 0.0, 0.0, 1.0]]
    read = graspgen.read_graspgen(file(document(gripper={OFFSET: offset})), PANDA_GRIPPER)
    # x of the gripper is y of the cube, its y is x, its z points down
    np.testing.assert_allclose(read.grasps.X_OG[0, :3, 3], [0.02, 0.01, -0.03], atol=1e-12)


def test_files_of_record_grasp_have_no_object(file: Callable[[Any], Path]) -> None:
    recorded = {"grasps": {"transforms": [DOWN], "object_in_gripper": [1]}}
    path = file(json.dumps(recorded))
    assert graspgen.recognise_graspgen(path)
    read = graspgen.read_graspgen(path, PANDA_GRIPPER)
    assert read.grasps.object.tolist() == ["grasps"]
    assert any("names no object" in note for note in read.notes)


def test_written_files_are_read_as_the_documentation_reads_them(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(12, 3, success=True)
    notes = graspgen.write_graspgen(grasps, tmp_path / "a.json", PANDA_GRIPPER)
    good, bad = positive_and_negative(tmp_path / "a.json")
    assert (len(good), len(bad)) == ((grasps.score == 1).sum(), (grasps.score == 0).sum())
    good[:, :3, 3] += 0.1034 * good[:, :3, 2]
    np.testing.assert_allclose(good, grasps.X_OG[grasps.score == 1], atol=1e-12)
    assert any("width" in note for note in notes) and any("mug.obj" in note for note in notes)
    loaded = json.loads((tmp_path / "a.json").read_text())
    assert loaded["object"] == {"file": "mug.obj", "scale": 1.0}


def test_mesh_and_scale_survive_reading_and_writing(
    file: Callable[[Any], Path], tmp_path: Path
) -> None:
    graspgen.write_graspgen(
        graspgen.read_graspgen(file(document()), PANDA_GRIPPER).grasps,
        tmp_path / "b.json",
        PANDA_GRIPPER,
    )
    loaded = json.loads((tmp_path / "b.json").read_text())
    assert loaded["object"] == {"file": "1a2b3c", "scale": 0.7}
    np.testing.assert_allclose(loaded["grasps"]["transforms"], [DOWN, DOWN], atol=1e-15)
    assert loaded["grasps"]["object_in_gripper"] == [True, False]


def test_scores_that_are_no_success_are_left_behind(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    notes = graspgen.write_graspgen(random_grasps(3, 4), tmp_path / "a.json", PANDA_GRIPPER)
    assert any("no object_in_gripper" in note for note in notes)
    assert any("score" in note and "width" in note for note in notes)
    read = graspgen.read_graspgen(tmp_path / "a.json", PANDA_GRIPPER)
    assert np.isnan(read.grasps.score).all()
    assert any("has no object_in_gripper" in note for note in read.notes)


def test_success_known_of_some_is_refused(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    some = random_grasps(3, 4, success=True).with_columns(object_in_gripper=[1.0, np.nan, 0.0])
    with pytest.raises(InvalidInputError, match="1 of 3 grasps it is not known"):
        graspgen.write_graspgen(some, tmp_path / "a.json", PANDA_GRIPPER)
    assert not list(tmp_path.iterdir())


def test_no_grasps_are_no_error(file: Callable[[Any], Path]) -> None:
    empty = document(grasps__transforms=[], grasps__object_in_gripper=[])
    assert len(graspgen.read_graspgen(file(empty), PANDA_GRIPPER).grasps) == 0


def test_another_hand_is_refused(file: Callable[[Any], Path]) -> None:
    path = file(document(gripper={"name": "franka_panda"}))
    with pytest.raises(InvalidInputError, match=r"gripper\.name.*panda_hand.*wsg_50"):
        graspgen.read_graspgen(path, replace(PANDA_GRIPPER, name="wsg_50"))


NAN = [[float("nan")] * 4] * 4


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", ":1: not valid JSON"),
        ("[1, 2]", "a list instead of a mapping"),
        (json.dumps(document())[:-40], "not valid JSON"),
        ('{"grasps": {"transforms": [], "transforms": []}}', "'transforms' appears twice"),
        (document(grasps=None), "grasps is missing"),
        (document(grasps=[1]), "grasps is missing or not a mapping"),
        (document(grasps__transforms=None), r"grasps\.transforms is missing"),
        (document(grasps__transforms={"a": 1}), r"grasps.transforms is missing or not a list"),
        (document(grasps__transforms=[DOWN, DOWN[:3]]), r"grasps\.transforms must hold"),
        (document(grasps__transforms=[DOWN[:3]] * 2), r"transforms has shape \(2, 3, 4\)"),
        (document(grasps__transforms=[DOWN, NAN]), r"grasps\.transforms\[1\] has NaN"),
        (document(grasps__transforms=["a", "b"]), r"grasps\.transforms must hold"),
        (document(grasps__object_in_gripper=[1]), "has 1 values; expected 2, one for each grasp"),
        (document(grasps__object_in_gripper=[1, 0.5]), r"in_gripper\[1\] is 0\.5; expected true"),
        (document(grasps__object_in_gripper=[1, "no"]), r"in_gripper\[1\] is 'no'; expected"),
        (document(grasps__object_in_gripper=True), "has True; expected 2, one for each grasp"),
        (document(object="mug"), "object is missing or not a mapping"),
        (document(object__file=None), r"object\.file is None; expected the name"),
        (document(object__file=5), r"object\.file is 5; expected the name"),
        (document(object__scale=None), r"object\.scale is None; expected a number above 0"),
        (document(object__scale=0), r"object\.scale is 0; expected a number above 0"),
        (document(object__scale=-1.5), r"object\.scale is -1\.5; expected a number above 0"),
        (document(object__scale="big"), r"object\.scale is 'big'; expected a number"),
        (document(object__scale=True), r"object\.scale is True; expected a number"),
        (document(object__scale=float("nan")), r"object\.scale is nan; expected a number"),
        (document(gripper=3), "gripper is missing or not a mapping"),
        (document(gripper={OFFSET: [1, 2, 3]}), r"convention is \[1, 2, 3\]; expected \[\["),
        (document(gripper={OFFSET: [[0, 0, 0], [0, 0, 0, 0]]}), "convention is .*; expected"),
        (document(gripper={OFFSET: [0.0] * 16}), "convention"),
        (document(gripper={OFFSET: 5}), "convention is 5; expected"),
    ],
)
def test_malformed_files_say_where(file: Callable[[Any], Path], content: Any, said: str) -> None:
    path = file(content)
    with pytest.raises(InvalidInputError, match=said) as caught:
        graspgen.read_graspgen(path, PANDA_GRIPPER)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
