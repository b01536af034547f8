"""Images of a real camera as observations, and the best grasps on a robot.

Rendered images stand for photographs; they are written to files as a lab would.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.benchmark import (
    BenchmarkSettings,
    Budget,
    CameraPlacement,
    RealImages,
    Suite,
    SuiteSettings,
    all_tables,
    compare_by_suite,
    make_suite,
    plan_robot_trials,
    robot_successes,
    run_benchmark,
)
from burg_drake.cameras import save_intrinsics
from burg_drake.core import BurgError, InvalidInputError, Outcome, Pose, RealOutcome, save_document
from burg_drake.experiment import load_trials
from burg_drake.scene import Board, load_scene
from burg_drake.station import load_station
from tests.benchmark.can_scenes import cans

PLANNERS = "tests.benchmark.scripted_planners"
SCENE, STATION = load_scene("tabletop_six"), load_station("panda_tabletop")
CAMERA = CameraPlacement(exact_depth=True).camera(SCENE.board).scene_camera()


@pytest.fixture(scope="module")
def photo() -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth image of a scene on its board."""
    seen = CAMERA.observe(SCENE, STATION)
    return seen.color, seen.depth


@pytest.fixture
def folder(tmp_path: Path, photo: tuple[np.ndarray, np.ndarray]) -> Path:
    color, depth = photo
    save_intrinsics(CAMERA.intrinsics, tmp_path / "intrinsics.yaml")
    cv2.imwrite(str(tmp_path / "six.png"), color[..., ::-1])
    cv2.imwrite(str(tmp_path / "six.depth.png"), np.rint(1000.0 * depth).astype(np.uint16))
    return tmp_path


def observed(folder: Path, *, color: bool = True, depth_unit: float | None = None) -> object:
    images = RealImages.open(folder, ["five", "six"], depth_unit=depth_unit)
    assert images.scenes == ("six",)
    scene = replace(SCENE, document=replace(SCENE.document, name="six"))
    return images.observe(scene, STATION, color=color)


def test_the_pose_follows_from_the_markers(
    folder: Path, photo: tuple[np.ndarray, np.ndarray]
) -> None:
    found = observed(folder)
    X_SC = np.linalg.inv(found.X_WS) @ found.X_WC
    error = np.linalg.inv(CAMERA.X_SC) @ X_SC
    assert np.linalg.norm(error[:3, 3]) < 2e-3
    assert np.arccos((np.trace(error[:3, :3]) - 1.0) / 2.0) < np.deg2rad(0.3)
    assert np.array_equal(found.color, photo[0])
    assert found.depth == pytest.approx(photo[1], abs=0.51e-3)
    assert found.segmentation is None and np.allclose(found.K, CAMERA.intrinsics.K)


def test_a_given_pose_and_unit_are_taken(folder: Path) -> None:
    known = Pose((0.1, 0.2, 0.9), (180.0, 0.0, 0.0))
    save_document(known, folder / "camera.yaml")
    (folder / "six.depth.png").unlink()
    np.save(folder / "six.depth.npy", np.full((480, 640), 9000, np.uint16))
    (folder / "six.png").unlink()
    found = observed(folder, color=False, depth_unit=1e-4)
    assert np.linalg.inv(found.X_WS) @ found.X_WC == pytest.approx(known.matrix())
    assert found.depth == pytest.approx(np.full((480, 640), 0.9)) and found.color is None
    save_document(Pose((0.3, 0.2, 0.9)), folder / "six.camera.yaml")
    own = observed(folder, color=False, depth_unit=1e-4)
    assert (np.linalg.inv(own.X_WS) @ own.X_WC)[0, 3] == pytest.approx(0.3)


def test_distortion_is_removed(folder: Path) -> None:
    bent = replace(CAMERA.intrinsics, distortion=(-0.3, 0.1, 0.0, 0.0))
    save_intrinsics(bent, folder / "intrinsics.yaml")
    save_document(Pose.readable(CAMERA.X_SC), folder / "camera.yaml")
    ray = np.array([[-0.4, 0.25, 1.0]])
    zero = np.zeros(3)
    (where,), _ = cv2.projectPoints(ray, zero, zero, bent.K, np.array(bent.distortion))
    depth = np.zeros((480, 640), np.uint16)
    column, row = np.rint(where[0]).astype(int)
    depth[row - 2 : row + 3, column - 2 : column + 3] = 700
    cv2.imwrite(str(folder / "six.depth.png"), depth)
    found = observed(folder, color=False).depth
    rows, columns = np.nonzero(found)
    straight = bent.K @ ray[0]
    assert [columns.mean(), rows.mean()] == pytest.approx(straight[:2], abs=1.0)


def remove(name: str) -> object:
    return lambda folder: (folder / name).unlink()


def other_size(folder: Path) -> None:
    np.save(folder / "six.depth.npy", np.ones((100, 100), np.float32))
    (folder / "six.depth.png").unlink()


def tenths_of_millimetres(folder: Path) -> None:
    path = folder / "six.depth.png"
    cv2.imwrite(str(path), 10 * cv2.imread(str(path), cv2.IMREAD_UNCHANGED))


def no_board(folder: Path) -> None:
    cv2.imwrite(str(folder / "six.png"), np.full((480, 640, 3), 90, np.uint8))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (remove("six.depth.png"), "has no depth image of a scene .* such as five.depth.png"),
        (remove("intrinsics.yaml"), r"intrinsics.yaml does not exist"),
        (remove("six.png"), r"six.png does not exist; add the colour image"),
        (other_size, r"six.depth.npy.* 100 x 100"),
        (
            tenths_of_millimetres,
            r"six.depth.png: the depth is 10 times the distance of the board; give its unit",
        ),
        (no_board, r"six.png: the camera's pose cannot be measured on the board: .*camera.yaml"),
        (lambda f: (f / "six.png").write_bytes(b"no image"), "six.png cannot be read"),
        (lambda f: (f / "sex.depth.png").touch(), "sex.depth.png: the suite has no scene 'sex'"),
        (lambda f: (f / "six.depth.npy").touch(), "are both depth images of scene six"),
    ],
)
def test_what_is_wrong_names_its_file(folder: Path, damage: object, message: str) -> None:
    damage(folder)
    with pytest.raises(BurgError, match=message):
        observed(folder)


# --- on the robot ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    scenes = [cans(f"cans_{k}", (0.2 + 0.02 * k, 0.2)) for k in range(4)]
    camera = replace(CameraPlacement(exact_depth=True).camera(Board()), size=(212, 120))
    return make_suite(
        tmp_path_factory.mktemp("suite") / "cans.yaml",
        scenes,
        cameras=[camera],
        settings=SuiteSettings(budget=Budget(grasps=2), mode="hand", engine="screening"),
    )


@pytest.mark.physics
@pytest.mark.usefixtures("benchmarked_here")
def test_the_same_planner_on_rendered_images_on_photographs_and_on_the_robot(
    suite: Suite, tmp_path: Path
) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    camera = suite.document.cameras[0].scene_camera()
    save_intrinsics(camera.intrinsics, photos / "intrinsics.yaml")
    save_document(Pose.readable(camera.X_SC), photos / "camera.yaml")
    for scene in list(suite.scenes().values())[:3]:  # the fourth is not set up
        seen = replace(camera, color=False).observe(scene, suite.station)
        np.save(photos / f"{scene.name}.depth.npy", seen.depth)
    np.save(photos / "cans_2.depth.npy", np.zeros((120, 212), np.float32))  # nothing is seen
    settings = BenchmarkSettings(depth_only=True, name="mine")
    planner = f"{PLANNERS}:plan_cans"
    rendered, real = (
        run_benchmark(
            *(suite, planner, tmp_path / name),
            settings=settings,
            images=images,
            workers=1,
            progress=False,
        )
        for name, images in (("rendered", None), ("real", photos))
    )
    assert real.scene_names == ["cans_0", "cans_1", "cans_2"]
    assert len(compare_by_suite([rendered, real])) == 2  # never in one table of methods

    out = tmp_path / "trials.yaml"
    plan_robot_trials([real], out)
    sheet = load_trials(out)
    assert len(sheet.trials) == 2 and {trial.simulated for trial in sheet.trials} == {
        Outcome.LIFTED
    }
    (found,) = robot_successes([rendered, real], [sheet])
    assert (found.tried, found.infeasible, found.open) == (0, 1, 2)
    assert np.isnan(found.real.value) and (found.real.least, found.real.most) == (0.0, 2 / 3)
    one = replace(sheet.trials[0], outcome=RealOutcome.LIFTED)
    half = replace(sheet, trials=(one, *sheet.trials[1:]))
    (found,) = robot_successes([real], [half])
    assert (found.real.least, found.real.value, found.real.most) == (1 / 3, 2 / 3, 2 / 3)
    assert np.isnan(found.real.low) and found.open == 1 and found.rendered is None
    ended = [RealOutcome.LIFTED, RealOutcome.SLIPPED]
    done = replace(
        sheet,
        trials=tuple(replace(t, outcome=o) for t, o in zip(sheet.trials, ended, strict=True)),
    )
    (found,) = robot_successes([rendered, real], [done])
    assert (found.tried, found.infeasible, found.open) == (2, 1, 0)
    assert found.real.value == pytest.approx(1 / 3)
    assert found.simulated.value == pytest.approx(2 / 3)
    assert found.agreement == 0.5
    assert found.rendered is not None and found.rendered.value == 1.0
    hopeless = run_benchmark(
        *(suite, f"{PLANNERS}:plan_nothing", tmp_path / "hopeless"),
        settings=replace(settings, name="hopeless"),
        images=photos,
        workers=1,
        progress=False,
    )
    _, failed = robot_successes([rendered, real, hopeless], [done])  # listed without any trial
    assert (failed.name, failed.real.value, failed.infeasible) == ("hopeless", 0.0, 3)
    table = all_tables(compare_by_suite([rendered, real]), [done])[-1]
    assert table.title == "Simulation and robot" and table.rows[0][4:] == ("50", "2", "1", "0")

    with pytest.raises(InvalidInputError, match=r"images: .* there, none here"):
        run_benchmark(suite, planner, real.path, settings=settings)
    slippery = replace(sheet, trials=())
    with pytest.raises(InvalidInputError, match="none of the best grasps"):
        robot_successes([real], [slippery])
    with pytest.raises(InvalidInputError, match="choose the protocol single"):
        run_benchmark(
            *(suite, planner, tmp_path / "clear"),
            settings=replace(settings, protocol="clear"),
            images=photos,
        )
