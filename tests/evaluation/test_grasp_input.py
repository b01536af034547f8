"""What verbs about grasps take: files, and folders of runs with what became of each grasp."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    SamplingSettings,
    evaluate,
    hand_of,
    hand_reference,
    read_grasps,
    read_in_frame,
    read_input,
    sample_grasps,
)
from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER, format_of, write_each_object
from burg_drake.scene import Scene
from burg_drake.station import Station, load_station, locate_hand

pytestmark = pytest.mark.usefixtures("judged_here")


@pytest.fixture
def run(scene: Scene, station: Station, tmp_path: Path, known_judge: None) -> Run:
    return evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(grasps_per_object=12, blind=True),
        workers=1,
        progress=False,
    )


def test_outcomes_of_a_run_in_files_of_acronym(run: Run, tmp_path: Path) -> None:
    grasps = read_in_frame(run.path, "object").grasps
    write_each_object(grasps, tmp_path / "out", GRASP_FORMATS["acronym"], PANDA_GRIPPER)
    for name in ("cube", "bar"):
        with h5py.File(tmp_path / "out" / f"{name}.h5") as file:
            held = file["grasps/qualities/flex/object_in_gripper"][()]
        lifted = run.results["outcome"][run.results["object"] == name] == "lifted"
        assert 0 < lifted.sum() < len(lifted)
        np.testing.assert_array_equal(held, lifted)


def test_grasps_of_a_run_are_judged_again(run: Run, scene: Scene, tmp_path: Path) -> None:
    given = read_grasps(scene, run.path).by_instance
    again = evaluate(
        scene, "panda_tabletop", tmp_path / "again", grasps=given, workers=1, progress=False
    )
    assert again.candidates.id == run.candidates.id
    assert again.results["given_outcome"].tolist() == run.results["outcome"].tolist()
    # which has the name of a column of this run, and so keeps the one of the table
    grasps = read_input(again.path).grasps
    np.testing.assert_array_equal(grasps.column("given_outcome"), run.results["outcome"])
    np.testing.assert_array_equal(grasps.column("outcome"), again.results["outcome"])


def test_a_run_says_where_its_objects_and_its_hand_are(run: Run) -> None:
    told = read_input(run.path).grasps.provenance
    assert Path(told["scene"]) == run.path / "scene.yaml"
    assert Path(hand_reference(run.path) or "") == locate_hand("panda_hand")[2]


@pytest.mark.parametrize("table", ["csv", "parquet"])
def test_the_table_of_a_run_is_no_grasp_file(run: Run, table: str, tmp_path: Path) -> None:
    path = run.table_path
    if table == "parquet":
        path = path.rename(path.with_suffix(".parquet"))
    else:
        with pytest.raises(InvalidInputError, match="not a file of grasps"):
            format_of(path)
    with pytest.raises(InvalidInputError, match=r"is the table of a run; give the run's folder"):
        read_input(path)


def test_a_folder_without_a_run(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="is not the folder of a run"):
        read_input(tmp_path)


def test_sampled_sets_name_their_hand(scene: Scene, tmp_path: Path) -> None:
    station = load_station("panda_wsg")
    grasps = sample_grasps(scene, station, 3, settings=SamplingSettings(blind=True))
    assert hand_of(grasps) == {"name": "wsg_50", "document": str(station.hand_path)}
    both = GraspSet.concatenate(
        [grasps, sample_grasps(scene, station, 3, seed=1, settings=SamplingSettings(blind=True))]
    )
    assert (hand_of(both) or {})["name"] == "wsg_50"
    both.save(tmp_path / "both.h5")
    assert hand_reference(tmp_path / "both.h5") == str(station.hand_path)
    note = "The grasps were made for hand 'wsg_50'; they are judged as those of hand 'panda_hand'."
    assert read_grasps(scene, tmp_path / "both.h5", PANDA_GRIPPER).notes == (note,)
    assert read_input(tmp_path / "both.h5").notes == ()
    other = sample_grasps(
        scene, load_station("panda_tabletop"), 3, settings=SamplingSettings(blind=True)
    )
    assert hand_of(GraspSet.concatenate([grasps, other])) is None


def test_a_hand_whose_document_has_moved_goes_by_its_name(tmp_path: Path) -> None:
    hand = {"name": "wsg_50", "document": str(tmp_path / "gone.yaml")}
    grasps = GraspSet.create(np.eye(4), object="cube", provenance={"hand": hand})
    grasps.save(tmp_path / "grasps.npz")
    assert hand_reference(tmp_path / "grasps.npz") == "wsg_50"


def test_sets_of_others_are_for_the_hand_that_they_were_read_with(tmp_path: Path) -> None:
    grasps = GraspSet.create(np.eye(4), object="cube", score=1.0)
    GRASP_FORMATS["acronym"].write(grasps, tmp_path / "cube.h5", PANDA_GRIPPER)
    assert hand_of(read_input(tmp_path / "cube.h5", gripper=PANDA_GRIPPER).grasps) == {
        "name": PANDA_GRIPPER.name
    }
    grasps.save(tmp_path / "ours.h5")
    assert hand_of(read_input(tmp_path / "ours.h5", gripper=PANDA_GRIPPER).grasps) is None
