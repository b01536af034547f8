"""Grasps that are meant otherwise than they were read are told, with the option that corrects them;
right grasps are not. Mistakes are planted with SciPy, and what is corrected has to be what was
there before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import GraspSet, UnknownNameError
from burg_drake.evaluation import (
    FileReading,
    MisplacedGraspsError,
    SamplingSettings,
    correct_poses,
    find_mistake,
    group_by_names,
    mistake_notes,
    read_grasps,
    read_input,
    sample_grasps,
)
from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER, write_grasp_file
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, load_station
from tests.thorough import thorough


def pose(euler_deg: tuple[float, float, float] = (0, 0, 0), p: tuple[float, ...] = (0, 0, 0)):
    X = np.eye(4)
    X[:3, :3] = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix()
    X[:3, 3] = p
    return X


def reordered(X: np.ndarray, shift: int) -> np.ndarray:
    found = X.copy()
    xyzw = np.roll(Rotation.from_matrix(X[:, :3, :3]).as_quat(), shift, axis=-1)
    found[:, :3, :3] = Rotation.from_quat(xyzw).as_matrix()
    return found


def transposed(X: np.ndarray) -> np.ndarray:
    found = X.copy()
    found[:, :3, :3] = X[:, :3, :3].transpose(0, 2, 1)
    return found


BASE = (0.0, 0.0, -0.1034)
PLANTED = {
    "turn:z90": lambda X: X @ pose((0, 0, 90)),
    "turn:x-90": lambda X: X @ pose((90, 0, 0)),
    "turn:x180": lambda X: X @ pose((0, 180, 0)),
    "turn:y90": lambda X: X @ pose((0, -90, 0)),
    "forward:103.4": lambda X: X @ pose(p=BASE),
    "forward:-103.4": lambda X: X @ np.linalg.inv(pose(p=BASE)),
    "turn:z90,forward:103.4": lambda X: X @ pose((0, 0, 90), BASE),
    "turn:z45,forward:103.4": lambda X: X @ pose((0, 0, -45), BASE),
    "inverse": np.linalg.inv,
    "wxyz": lambda X: reordered(X, 1),
    "xyzw": lambda X: reordered(X, -1),
    "y_up": lambda X: pose((-90, 0, 0)) @ X,
    "z_up": lambda X: pose((90, 0, 0)) @ X,
}
"""What undoes each mistake, and the mistake."""


@pytest.fixture(scope="module")
def no_pose_mistakes() -> None:
    """Here they are looked for."""


@pytest.fixture(scope="module")
def six() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def panda() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def right(six: Scene, panda: Station) -> GraspSet:
    """Twelve grasps of the mug that the hand can take."""
    return sample_grasps(six, panda, 12, only=["mug"])


def of_mug(X_OG: np.ndarray, **columns: object) -> dict[str, GraspSet]:
    return {"mug": GraspSet.create(X_OG, object="mug", **columns)}


LIKE_OTHERS = ("turn:x-90", "turn:y90", "turn:z45,forward:103.4", "xyzw", "z_up")
"""Mistakes that are made and undone as others of them are."""


@pytest.mark.parametrize(
    "correction", [thorough(name) if name in LIKE_OTHERS else name for name in PLANTED]
)
def test_a_planted_mistake_is_named_and_undone(
    correction: str, right: GraspSet, six: Scene, panda: Station
) -> None:
    spoiled = PLANTED[correction](right.X_OG)
    found = find_mistake(of_mug(spoiled), panda, six)
    assert found is not None
    assert ",".join(found.mistake.correction) == correction
    assert found.before <= 2 and found.after == found.count == 12
    assert found.text().startswith(f"As they were read, {found.before} of the 12 grasps fit: ")
    assert "12 of 12 fit." in found.text()
    assert f"very likely means that; --correction {correction} reads" in found.text()
    undone = correct_poses(spoiled, np.eye(4), correction.split(","))
    fingers_swapped = undone @ pose((0, 0, 180))
    same = [np.abs(X - right.X_OG).max(axis=(1, 2)) < 1e-9 for X in (undone, fingers_swapped)]
    assert np.logical_or(*same).all()


def test_what_the_grasps_of_one_object_show(right: GraspSet, six: Scene, panda: Station) -> None:
    """Those of the banana are right, and as many."""
    others = sample_grasps(six, panda, 12, only=["banana"])
    both = {**of_mug(right.X_OG @ pose((0, 0, 90))), "banana": others}
    found = find_mistake(both, panda, six)
    assert found is not None and found.only == "mug"
    assert found.options() == ["--correction", "turn:z90", "--only", "mug"]
    assert " of the 12 grasps of mug fit: " in found.text()
    assert find_mistake({**of_mug(right.X_OG), "banana": others}, panda, six) is None


def test_transposed_rotations_that_change_few_grasps(six: Scene, panda: Station) -> None:
    """A grasp from straight above is turned by 180 degrees, and its transposed rotation is the
    same: most grasps fit either way, and those that do not tell the mistake."""
    grasps = sample_grasps(six, panda, 60, only=["mug"])
    found = find_mistake(of_mug(transposed(grasps.X_OG)), panda, six)
    assert found is not None and found.mistake.correction == ("transposed",)
    assert 30 <= found.before < 50 and found.after == found.count == 60


@pytest.mark.parametrize("euler", [(90, 0, 0), thorough((180, 0, 0))])
def test_turns_about_the_closing_direction_before_the_pads(
    euler: tuple[float, float, float], right: GraspSet, six: Scene, panda: Station, tmp_path: Path
) -> None:
    """The origin of GraspNet's frame is 10 mm before the pads, which such a turn moves to another
    part of the wall: the pads still close on it, and the rest of the hand is in the mug."""
    X_SF = pose((175, 5, 30), (0.3, 0.25, 0.7))
    X_GF = pose(p=(0, 0, -0.0105))  # with the depth that is written where a set has none
    turned = np.linalg.inv(X_SF) @ six.X_SO("mug") @ right.X_OG
    turned = turned @ X_GF @ pose(euler) @ np.linalg.inv(X_GF)
    write_grasp_file(GraspSet.create(turned, object=""), tmp_path / "turned.npy", "graspnet")
    given = read_grasps(six, tmp_path / "turned.npy", PANDA_GRIPPER, X_SF=X_SF).by_instance
    found = find_mistake(given, panda, six)
    assert found is not None and found.after == 12
    assert found.mistake.correction == (f"turn:x{'-90' if euler[0] == 90 else '180'}",)


def test_a_second_correction_is_told_with_the_first(
    right: GraspSet, six: Scene, panda: Station, tmp_path: Path
) -> None:
    """A file that was read with one correction and shows another mistake needs both; what a file of
    ours was once read with is in its poses already."""
    spoiled = reordered(right.X_OG, 1) @ pose((0, 0, -90))
    path = tmp_path / "twice.npz"
    GraspSet.create(spoiled, object="mug").save(path)
    first = read_input(path, correction=["turn:z90"]).grasps
    found = find_mistake({"mug": first}, panda, six)
    assert found is not None and found.options() == ["--correction", "turn:z90,wxyz"]
    both = read_input(path, correction=["turn:z90", "wxyz"]).grasps
    np.testing.assert_allclose(both.X_OG, right.X_OG, atol=1e-9)
    first.save(tmp_path / "again.npz")
    found = find_mistake({"mug": read_input(tmp_path / "again.npz").grasps}, panda, six)
    assert found is not None and found.options() == ["--correction", "wxyz"]


def test_a_distance_that_no_format_has_is_told_with_its_range(
    right: GraspSet, six: Scene, panda: Station
) -> None:
    found = find_mistake(of_mug(right.X_OG @ pose(p=(0, 0, -0.03))), panda, six)
    assert found is not None and found.after == 12 and found.reach_mm is not None
    assert found.reach_mm[0] <= 30.0 <= found.reach_mm[1]
    low, high = found.reach_mm
    assert (
        f"12 of 12 fit. Any distance from {low:g} to {high:g} mm fits equally well." in found.text()
    )


def test_right_grasps_and_exchanged_fingers_are_no_mistake(
    right: GraspSet, six: Scene, panda: Station
) -> None:
    for source in (six, six.library):
        assert mistake_notes(of_mug(right.X_OG, width=right.width), panda, source) == ()
        assert mistake_notes(of_mug(right.X_OG @ pose((0, 0, 180))), panda, source) == ()


def test_poor_grasps_are_no_mistake(six: Scene, panda: Station) -> None:
    """Of grasps sampled by points alone, a few in a hundred can be executed."""
    blind = sample_grasps(
        six, panda, 24, settings=SamplingSettings(blind=True), only=["mug", "banana", "box"]
    )
    for name, part in group_by_names(six, blind).items():
        assert find_mistake({name: part}, panda, six) is None, name
        in_library = {six.instance(name).object: part}
        assert find_mistake(in_library, panda, six.library) is None, name


def test_turns_of_a_ball_are_no_mistake(panda: Station) -> None:
    library = load_scene("tabletop_twelve").library
    grasps = sample_grasps(library, panda, 6, only=["marble"])
    turned = GraspSet.create(grasps.X_OG @ pose((0, 90, 90)), object="marble")
    assert find_mistake({"marble": turned}, panda, library) is None


OBJECT_AND_WORLD = ("isaac_grasp", "burg")
"""A format of each of two frames in which files have their poses; the third one, the camera's, is
that of GraspNet below."""


@pytest.mark.parametrize(
    "name", [name if name in OBJECT_AND_WORLD else thorough(name) for name in GRASP_FORMATS]
)
def test_files_of_every_format(
    name: str, right: GraspSet, six: Scene, panda: Station, tmp_path: Path
) -> None:
    """A right file has no hint; in one whose poses are turned about the approach by a quarter, the
    hint leads back to the right grasps."""
    X_SF = pose((175, 5, 30), (0.3, 0.25, 0.7)) if GRASP_FORMATS[name].frame == "camera" else None
    X_FO = {"object": np.eye(4), "world": six.X_SO("mug")}.get(GRASP_FORMATS[name].frame)
    X_FO = np.linalg.inv(X_SF) @ six.X_SO("mug") if X_FO is None else X_FO
    options = {"X_SF": X_SF}
    if GRASP_FORMATS[name].frame == "object":
        options["objects"] = {"": "mug"}
    for turn in (np.eye(4), pose((0, 0, 90))):
        path = tmp_path / f"grasps{GRASP_FORMATS[name].suffixes[0]}"
        write_grasp_file(GraspSet.create(X_FO @ right.X_OG @ turn, object="mug"), path, name)
        try:
            given = read_grasps(six, path, PANDA_GRIPPER, **options)
            found = given.by_instance
        except MisplacedGraspsError as error:
            found = error.grasps
        text = " ".join(mistake_notes(found, panda, six))
        if turn[0, 0] == 1.0:
            assert text == ""
            continue
        other = {"isaac_grasp": "graspgen_yaml", "graspgen_yaml": "isaac_grasp"}.get(name)
        remedy = f"--grasps-format {other}" if other else "--correction turn:z90"
        assert remedy in text and "12 of 12 fit" in text
        more = {"format": other or FileReading(correction=("turn:z90",))}
        corrected = read_grasps(six, path, PANDA_GRIPPER, **options, **more)
        assert find_mistake(corrected.by_instance, panda, six) is None


def test_frames_that_are_measured_in_and_poses_of_cameras(
    right: GraspSet, six: Scene, panda: Station, tmp_path: Path
) -> None:
    X_SO, X_SC = six.X_SO("mug"), pose((175, 5, 30), (0.3, 0.25, 0.7))
    found = find_mistake(of_mug(X_SO @ right.X_OG), panda, six)
    assert found is not None and "--grasps-frame scene" in found.text()
    in_object = tmp_path / "object.npy"
    write_grasp_file(right, in_object, "burg")
    with pytest.raises(MisplacedGraspsError) as error:
        read_grasps(six, in_object, PANDA_GRIPPER)
    found = find_mistake(error.value.grasps, panda, six)
    assert found is not None and "--grasps-frame object" in found.text()
    seen = tmp_path / "seen.npy"
    in_camera = GraspSet.create(np.linalg.inv(X_SC) @ X_SO @ right.X_OG, object="")
    write_grasp_file(in_camera, seen, "graspnet")
    with pytest.raises(MisplacedGraspsError) as error:
        read_grasps(six, seen, PANDA_GRIPPER, X_SF=np.linalg.inv(X_SC))
    found = find_mistake(error.value.grasps, panda, six)
    assert found is not None and "pose of the camera inverted, 12 of 12 fit" in found.text()


def test_millimetres_in_a_file(right: GraspSet, six: Scene, panda: Station, tmp_path: Path) -> None:
    X = right.X_OG.copy()
    X[:, :3, 3] *= 1000.0
    path = tmp_path / "mm.npz"
    GraspSet.create(X, object="mug").save(path)
    with pytest.raises(MisplacedGraspsError, match="metres") as error:
        read_grasps(six, path, PANDA_GRIPPER)
    found = find_mistake(error.value.grasps, panda, six)
    assert found is not None and "--correction millimetres reads" in found.text()
    corrected = read_grasps(
        six, path, PANDA_GRIPPER, format=FileReading(correction=("millimetres",))
    )
    np.testing.assert_allclose(corrected.by_instance["mug"].X_OG, right.X_OG, atol=1e-12)


def test_half_widths_and_widths_beyond_the_opening(
    right: GraspSet, six: Scene, panda: Station, tmp_path: Path
) -> None:
    halved = of_mug(right.X_OG, width=right.width / 2.0)
    (note,) = mistake_notes(halved, panda, six)
    assert (
        note.startswith("The widths of 12 of the 12 grasps") and "--correction half_widths" in note
    )
    path = tmp_path / "half.npz"
    halved["mug"].save(path)
    read = read_input(path, correction=["half_widths"])
    np.testing.assert_allclose(read.grasps.width, right.width)
    wide = np.where(np.arange(12) < 3, 0.0951, right.width)
    GraspSet.create(right.X_OG, object="mug", width=wide).save(tmp_path / "wide.npz")
    (note,) = read_grasps(six, tmp_path / "wide.npz", PANDA_GRIPPER).notes
    assert "width of 3 of 12 grasps" in note and "(the largest is 95.1 mm)" in note
    assert "hand open at 80 mm" in note


def test_a_correction_that_does_not_exist(tmp_path: Path, right: GraspSet) -> None:
    right.save(tmp_path / "grasps.npz")
    with pytest.raises(UnknownNameError, match=r"no correction 'yup'; did you mean 'y_up'"):
        read_input(tmp_path / "grasps.npz", correction=["yup"])
