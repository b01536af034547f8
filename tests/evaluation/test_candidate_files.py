"""Grasp files of other projects on a scene: every grasp goes where it belongs, or an error says why
not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    grasp_from_axes,
    inverse,
    make_pose,
)
from burg_drake.evaluation import (
    EvaluationSettings,
    NoSceneIdsError,
    SamplingSettings,
    evaluate,
    join_in_frame,
    read_grasps,
    read_table,
    run_grasps,
    sample_candidates,
)
from burg_drake.formats import PANDA_GRIPPER, write_grasp_file
from burg_drake.scene import Scene
from burg_drake.station import Station

pytestmark = pytest.mark.usefixtures("judged_here")

DOWN = (0.0, 0.0, -1.0)
LEFT, RIGHT = (0.1, 0.2, 0.025), (0.3, 0.2, 0.025)
X_SC = make_pose(Rotation.from_euler("xyz", [170, 10, 30], degrees=True).as_matrix(), (0.3, 0, 0.6))


def down(*positions: tuple[float, float, float]) -> Array:
    """(N, 4, 4) grasps from above."""
    return np.array([grasp_from_axes((1.0, 0.0, 0.0), DOWN, p) for p in positions])


def acronym_file(path: Path, mesh: str = "meshes/Cube/3f2a.obj") -> Path:
    """A grasp from above at the height of the object's frame, one 10 mm higher."""
    with h5py.File(path, "w") as file:
        file["object/file"] = mesh
        file["object/scale"] = 1.0
        X_OB = down((0, 0, 0), (0, 0, 0.01)) @ make_pose(p_AB=(0.0, 0.0, -0.1034))
        file["grasps/transforms"] = X_OB
        file["grasps/qualities/flex/object_in_gripper"] = np.array([1, 0])
    return path


def graspnet_file(path: Path, X_SG: Array, X_SC: Array = X_SC, **columns: Any) -> Path:
    seen = GraspSet.create(inverse(X_SC) @ X_SG, object="", width=0.05, score=0.5)
    write_grasp_file(seen.with_columns(**columns), path, "graspnet")
    return path


def poses(given: dict[str, GraspSet]) -> dict[str, list[list[float]]]:
    """Positions of G in the objects, by instance."""
    return {name: np.round(g.X_OG[:, :3, 3], 6).tolist() for name, g in given.items()}


def test_a_file_of_one_object_goes_to_all_its_instances(scene: Scene, tmp_path: Path) -> None:
    path = acronym_file(tmp_path / "Cube_3f2a_1.0.h5")
    given = read_grasps(scene, path, objects={"": "cube"})
    heights = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.01]]
    assert poses(given.by_instance) == {"left": heights, "right": heights}
    for grasps in given.by_instance.values():
        assert grasps.score.tolist() == [1.0, 0.0] and set(grasps.object.tolist()) == {"cube"}
    assert any("scaled by 1" in note for note in given.notes)
    named = read_grasps(scene, path, objects={"3f2a": "right"}).by_instance
    assert poses(named) == {"right": heights}


def test_grasps_that_are_listed_more_than_once_are_told(scene: Scene, tmp_path: Path) -> None:
    grasps = GraspSet.create(down((0, 0, 0), (0, 0, 0.01)), object="bar").select([0, 1, 0, 0])
    grasps.save(tmp_path / "a.h5")
    (note,) = read_grasps(scene, tmp_path / "a.h5").notes
    assert note == f"2 grasps of {tmp_path / 'a.h5'} are duplicates; each is judged once."


def test_grasps_of_several_objects(scene: Scene, tmp_path: Path) -> None:
    X_OG = down((0, 0, 0), (0, 0, 0.01), (0, 0, 0.02))
    GraspSet.create(X_OG, object=["a", "bar", "b"]).save(tmp_path / "a.h5")
    given = read_grasps(scene, tmp_path / "a.h5", objects={"a": "left", "b": "cube"}).by_instance
    assert poses(given) == {
        "left": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.02]],
        "right": [[0.0, 0.0, 0.02]],
        "bar": [[0.0, 0.0, 0.01]],
    }
    with pytest.raises(InvalidInputError, match=r"3 objects \(a, b, bar\)"):
        read_grasps(scene, tmp_path / "a.h5", objects={"": "cube"})
    with pytest.raises(UnknownNameError, match="no grasps of object 'c'; known: a, b, bar"):
        read_grasps(scene, tmp_path / "a.h5", objects={"c": "cube"})


def test_a_file_that_names_instances(scene: Scene, tmp_path: Path) -> None:
    grasps = GraspSet.create(down((0, 0, 0), (0, 0, 0.01)), object="cube")
    grasps.with_columns(instance=["right", "left"], epsilon=[0.1, 0.2]).save(tmp_path / "a.npz")
    given = read_grasps(scene, tmp_path / "a.npz").by_instance
    assert poses(given) == {"right": [[0.0, 0.0, 0.0]], "left": [[0.0, 0.0, 0.01]]}
    assert given["left"].column("epsilon").tolist() == [0.2]
    assert "instance" not in given["left"].columns
    elsewhere = read_grasps(scene, tmp_path / "a.npz", objects={"": "left"}).by_instance
    assert poses(elsewhere) == {"left": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.01]]}


def test_grasps_in_the_frame_of_a_camera(scene: Scene, tmp_path: Path) -> None:
    path = graspnet_file(tmp_path / "a.npy", down(RIGHT, LEFT, (0.3, 0.2, 0.03)))
    given = read_grasps(scene, path, X_SF=X_SC)
    assert poses(given.by_instance) == {
        "left": [[0.0, 0.0, 0.0]],
        "right": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.005]],
    }
    assert given.notes == ()
    assert given.by_instance["left"].column("depth").tolist() == [pytest.approx(0.02)]
    with pytest.raises(InvalidInputError, match="give the pose of the camera in the scene"):
        read_grasps(scene, path)
    with pytest.raises(InvalidInputError, match=r"none of the 3 grasps .* between its fingers; is"):
        read_grasps(scene, path, X_SF=X_SC @ make_pose(p_AB=(0.0, 0.0, 0.5)))


def test_grasps_that_hold_nothing_are_kept_and_counted(scene: Scene, tmp_path: Path) -> None:
    path = graspnet_file(tmp_path / "a.npy", down(LEFT, (0.3, 0.2, 0.2), (0.2, 0.35, 0.4)))
    given = read_grasps(scene, path, X_SF=X_SC)
    assert poses(given.by_instance) == {
        "left": [[0.0, 0.0, 0.0]],
        "right": [[0.0, 0.0, 0.175]],
        "bar": [[0.0, 0.0, 0.385]],
    }
    assert given.notes == (
        (
            "2 of 3 grasps have no object between their fingers; each was assigned to the"
            " object with the nearest surface."
        ),
    )


def test_object_ids_and_names_decide(scene: Scene, tmp_path: Path) -> None:
    path = graspnet_file(tmp_path / "a.npy", down(LEFT, LEFT, LEFT), object_id=[0, 7, -1])
    given = read_grasps(scene, path, X_SF=X_SC, object_ids={0: "bar", 7: "right", 9: "left"})
    assert {name: len(grasps) for name, grasps in given.by_instance.items()} == {
        "bar": 1, "right": 1, "left": 1,
    }  # fmt: skip
    only = read_grasps(scene, path, X_SF=X_SC, objects={"": "cube"}).by_instance
    assert {name: len(grasps) for name, grasps in only.items()} == {"left": 3}
    with pytest.raises(InvalidInputError, match="grasps of object id 0, but no"):
        read_grasps(scene, path, X_SF=X_SC, object_ids={7: "bar"})
    with pytest.raises(InvalidInputError, match=r"7 is named 'cube', but .* left, right"):
        read_grasps(scene, path, X_SF=X_SC, object_ids={0: "bar", 7: "cube"})
    with pytest.raises(UnknownNameError, match="no free instance 'baar'; did you mean 'bar'"):
        read_grasps(scene, path, X_SF=X_SC, object_ids={0: "baar", 7: "bar"})


def test_one_scene_of_several(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "grasps.csv"
    grasps = GraspSet.create(down(LEFT, RIGHT, RIGHT), object="", width=0.05)
    grasps = grasps.with_columns(scene_id=["one", "two", "two"], label=[1, 0, 1])
    write_grasp_file(grasps, path, "vgn")
    given = read_grasps(scene, path, scene_id="two").by_instance
    assert {name: g.column("label").tolist() for name, g in given.items()} == {"right": [0.0, 1.0]}
    shifted = read_grasps(
        scene, path, scene_id="one", X_SF=make_pose(p_AB=(0.2, 0.0, 0.0))
    ).by_instance
    assert poses(shifted) == {"right": [[0.0, 0.0, 0.0]]}
    with pytest.raises(InvalidInputError, match=r"of 2 scenes; choose one .* one, two"):
        read_grasps(scene, path)
    with pytest.raises(UnknownNameError, match="no scene 'tow'; did you mean 'two'"):
        read_grasps(scene, path, scene_id="tow")


def test_a_frame_in_place_of_the_formats(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "grasps.npy"
    write_grasp_file(GraspSet.create(down(LEFT), object=""), path, "burg")
    assert poses(read_grasps(scene, path).by_instance) == {"left": [[0.0, 0.0, 0.0]]}
    on_the_mesh = read_grasps(scene, path, frame="object", objects={"": "bar"}).by_instance
    assert poses(on_the_mesh) == {"bar": [list(LEFT)]}
    with pytest.raises(InvalidInputError, match="does not name the object of its grasps"):
        read_grasps(scene, path, frame="object")
    with pytest.raises(UnknownNameError, match="no grasps of object 'a'; it names no objects"):
        read_grasps(scene, path, frame="object", objects={"a": "bar"})


@pytest.mark.parametrize("format", ["graspnet", "vgn", "burg"])
def test_there_and_back(format: str, scene: Scene, station: Station, tmp_path: Path) -> None:
    sampled = sample_candidates(scene, station, 60, 3, SamplingSettings(blind=True))
    sets = {name: sampled.grasps.select(sampled.instance == name) for name in scene.instances}
    path = tmp_path / ("a.csv" if format == "vgn" else "a.npy")
    X_SF = X_SC if format == "graspnet" else make_pose(p_AB=(0.15, 0.05, -0.05))
    write_grasp_file(join_in_frame(scene, sets, X_SF), path, format, PANDA_GRIPPER)
    given = read_grasps(scene, path, X_SF=X_SF)
    assert given.notes == () and list(given.by_instance) == list(sets)
    for name, grasps in given.by_instance.items():
        np.testing.assert_allclose(grasps.X_OG, sets[name].X_OG, atol=2e-6)
        assert set(grasps.object.tolist()) == {scene.instance(name).object}


def test_options_that_do_not_apply(scene: Scene, tmp_path: Path) -> None:
    path = acronym_file(tmp_path / "a.h5")
    with pytest.raises(
        UnknownNameError,
        match="3f2a=NAME",
    ):
        read_grasps(scene, path)
    with pytest.raises(
        InvalidInputError,
        match="frames of their objects; leave out the pose",
    ):
        read_grasps(scene, path, objects={"": "cube"}, X_SF=X_SC)
    with pytest.raises(
        InvalidInputError,
        match="frames of their objects; leave out the pose",
    ):
        read_grasps(scene, path, objects={"": "cube"}, object_ids={0: "left"})
    with pytest.raises(NoSceneIdsError, match="no scene ids; leave the scene id out"):
        read_grasps(scene, path, objects={"": "cube"}, scene_id="one")
    with pytest.raises(UnknownNameError, match="no free instance 'cub'; did you mean 'cube'"):
        read_grasps(scene, path, objects={"": "cub"})
    burg = tmp_path / "a.npy"
    write_grasp_file(GraspSet.create(down(LEFT), object=""), burg, "burg")
    with pytest.raises(InvalidInputError, match="no object ids; leave their names out"):
        read_grasps(scene, burg, object_ids={0: "left"})


@pytest.mark.parametrize("table", ["csv", "parquet"])
def test_what_came_with_the_grasps_is_in_the_results(
    table: Any, scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    if table == "parquet":
        pytest.importorskip("pyarrow")
    grasps = GraspSet.create(down(LEFT, RIGHT, (0.2, 0.35, 0.015)), object="", width=0.05)
    grasps = grasps.with_columns(
        scene_id="7f1c", label=[1.0, np.nan, 0.0], good=[True, False, True]
    )
    path = tmp_path / "grasps.csv"
    write_grasp_file(grasps, path, "vgn")
    given = {n: g.with_columns(good=True) for n, g in read_grasps(scene, path).by_instance.items()}
    run = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(table=table),
        grasps=given,
        workers=1,
        progress=False,
    )
    rows = read_table(run.table_path)
    assert rows["instance"].tolist() == ["left", "right", "bar"]
    np.testing.assert_array_equal(rows["given_label"], [1.0, np.nan, 0.0])
    assert rows["given_scene_id"].tolist() == ["7f1c"] * 3
    assert rows["given_good"].tolist() == [1, 1, 1]
    assert run_grasps(run).column("label").tolist()[::2] == [1.0, 0.0]
    assert "given_label" not in run_grasps(run).columns
