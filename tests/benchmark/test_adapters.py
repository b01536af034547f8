"""Adapters of published methods: grasps and inputs agree with the definitions of each method.

The networks are not here. Their answers are written by hand in the published layout, for one grasp
of a box that is defined by its contacts, its approach and its finger tips.
"""

from __future__ import annotations

import ast
import importlib.util
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import msgpack
import numpy as np
import pytest
import zmq
from scipy.spatial.transform import Rotation

from burg_drake.benchmark import Observation, answers, burg_planner
from burg_drake.formats import PANDA_GRIPPER
from tests.benchmark.planner_programs import COPIED, command

FOLDER = Path(__file__).parents[2] / "examples" / "planners"
ADAPTERS = ("contact_graspnet", "anygrasp", "graspgen", "vgn")


def load(name: str) -> ModuleType:
    """The module of an adapter."""
    spec = importlib.util.spec_from_file_location(f"{name}_planner", FOLDER / f"{name}_planner.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


contact_graspnet, anygrasp, graspgen, vgn = map(load, ADAPTERS)

# The scene: a box, turned about the vertical, on a table; a camera looks down at it.
BOX_SIZE = np.array([0.06, 0.1, 0.08])
R_SB = Rotation.from_euler("z", 30, degrees=True).as_matrix()
P_SB = np.array([0.2, 0.15, 0.04])
X_SC = np.eye(4)
X_SC[:3, :3] = Rotation.from_euler("xyz", (-145, 8, 15), degrees=True).as_matrix()
X_SC[:3, 3] = (0.17, -0.17, 0.55)
X_WS = np.eye(4)
X_WS[:3, :3] = Rotation.from_euler("z", -90, degrees=True).as_matrix()
X_WS[:3, 3] = (0.3, 0.2, 0.0)
K = np.array([[260.0, 0.0, 160.3], [0.0, 255.0, 119.6], [0.0, 0.0, 1.0]])

# The grasp: the pads meet the box at its two sides that are 0.06 m apart, 15 mm below its top.
CLOSING = R_SB[:, 0]
APPROACH = Rotation.from_rotvec(np.deg2rad(20) * CLOSING).apply([0.0, 0.0, -1.0])
CONTACTS = P_SB + [0.0, 0.0, 0.025] + np.array([[-0.03], [0.03]]) * CLOSING
MIDDLE = CONTACTS.mean(axis=0)
TIPS = MIDDLE + PANDA_GRIPPER.tip * APPROACH
EXPECTED = np.eye(4)
EXPECTED[:3, :3] = np.column_stack([CLOSING, np.cross(APPROACH, CLOSING), APPROACH])
EXPECTED[:3, 3] = MIDDLE


def hit_distances(origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(...) distances along rays (..., 3) in S to the table or the box, and which hit the box."""
    table = np.where(directions[..., 2] < 0.0, -origin[..., 2] / directions[..., 2], np.inf)
    start, along = (origin - P_SB) @ R_SB, directions @ R_SB
    with np.errstate(divide="ignore"):
        sides = np.sort([(s * BOX_SIZE / 2.0 - start) / along for s in (-1.0, 1.0)], axis=0)
    enter, leave = sides[0].max(axis=-1), sides[1].min(axis=-1)
    box = np.where((enter < leave) & (enter > 0.0), enter, np.inf)
    return np.minimum(table, box), box < table


def observe(target: int | None = None, **changes: Any) -> Observation:
    """The scene as the camera sees it, without noise; the box is object 2."""
    v, u = np.mgrid[:240, :320]
    rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)], axis=-1)
    depth, on_box = hit_distances(X_SC[:3, 3], rays @ X_SC[:3, :3].T)
    parts: dict[str, Any] = {
        "color": np.where(on_box[..., None], [255, 51, 0], [0, 102, 255]).astype(np.uint8),
        "depth": depth.astype(np.float32),
        "K": K,
        "X_WC": X_WS @ X_SC,
        "X_WS": X_WS,
        "bounds": np.array([[0.0, 0.0, 0.0], [0.6, 0.4, 0.4]]),
        "hand": {"name": "panda_hand", "opening": [0.0, 0.08], "tip": PANDA_GRIPPER.tip},
        "segmentation": np.where(on_box, 2, 0).astype(np.uint16),
        "target": target,
    }
    return Observation(id="5eed" * 16, **{**parts, **changes})


OBSERVATION = observe()
NOTHING = observe(depth=np.zeros((240, 320), np.float32))
X_CS = np.linalg.inv(X_SC)


def pose_in(X_AS: np.ndarray, axes: list[np.ndarray], origin: np.ndarray) -> np.ndarray:
    """(4, 4) pose in A of a frame with these axes and this origin in S."""
    X = np.eye(4)
    X[:3] = np.column_stack([*axes, origin])
    return X_AS @ X


def read(answer: dict[str, Any]) -> answers.PlannedGrasps:
    return answers.read_answer(answer, OBSERVATION, PANDA_GRIPPER)


def assert_expected(answer: dict[str, Any], count: int = 1, tolerance: float = 1e-9) -> None:
    found = read(answer)
    assert len(found.X_SG) == count and found.notes == ()
    np.testing.assert_allclose(found.X_SG, np.tile(EXPECTED, (count, 1, 1)), atol=tolerance)


# Contact-GraspNet: `build_6d_grasp` of contact_graspnet/contact_graspnet.py.
CONTACT_POSE = pose_in(
    X_CS,
    [CLOSING, np.cross(APPROACH, CLOSING), APPROACH],
    CONTACTS[0] + 0.06 / 2.0 * CLOSING - 0.1034 * APPROACH,
)
NO_POSES, NO_NUMBERS = np.empty((0, 4, 4)), np.empty(0)


def test_contact_graspnet_grasps_lie_between_the_contacts() -> None:
    poses = {2: CONTACT_POSE[None], 5: NO_POSES, -1: np.tile(CONTACT_POSE, (2, 1, 1))}
    scores = {2: np.array([0.4]), 5: NO_NUMBERS, -1: np.array([0.9, 0.1])}
    # An array of one opening has lost its dimension; the hand opens 5 mm more, at most 80 mm.
    openings = {2: np.array(0.065), 5: NO_NUMBERS, -1: np.array([0.065, 0.08])}
    answer = contact_graspnet.make_answer(poses, scores, openings)
    assert_expected(answer, 3)
    np.testing.assert_allclose(answer["width"], [0.06, 0.06, 0.075], atol=1e-9)
    assert answer["score"].tolist() == [0.4, 0.9, 0.1]


def test_contact_graspnet_files_hold_dicts_of_segments(tmp_path: Path) -> None:
    """np.savez of inference.py stores each dict as an array without dimensions."""
    path = tmp_path / "predictions.npz"
    poses: Any = {2: CONTACT_POSE[None].astype(np.float32)}
    scores: Any = {2: np.array([0.4], np.float32)}
    np.savez(path, pred_grasps_cam=poses, scores=scores)
    with np.load(path, allow_pickle=True) as file:
        found = file["pred_grasps_cam"].item(), file["scores"].item()
    answer = contact_graspnet.make_answer(*found)
    assert_expected(answer, tolerance=1e-6)
    assert "width" not in answer


@pytest.mark.parametrize("poses", [{}, {-1: NO_POSES}])
def test_contact_graspnet_may_find_nothing(poses: dict[int, np.ndarray]) -> None:
    numbers = dict.fromkeys(poses, NO_NUMBERS)
    assert read(contact_graspnet.make_answer(poses, numbers, numbers)).X_SG.shape == (0, 4, 4)


def test_contact_graspnet_is_given_the_images() -> None:
    found = contact_graspnet.make_input(OBSERVATION)
    assert found["depth"] is OBSERVATION.depth and found["K"] is OBSERVATION.K
    assert np.unique(found["segmap"]).tolist() == [0, 2]
    other = contact_graspnet.make_input(observe(target=3))
    assert not other["segmap"].any()
    assert contact_graspnet.make_input(observe(segmentation=None))["segmap"] is None


# GraspNet: columns of graspnetAPI/grasp.py, geometry of `plot_gripper_pro_max`.
def graspnet_row(depth: float, score: float = 0.5, opening: float = 0.075) -> list[float]:
    X = pose_in(X_CS, [APPROACH, CLOSING, np.cross(APPROACH, CLOSING)], TIPS - depth * APPROACH)
    return [score, opening, 0.02, depth, *X[:3, :3].ravel(), *X[:3, 3], -1.0]


def test_graspnet_finger_tips_are_kept_at_each_depth() -> None:
    rows = np.array([graspnet_row(depth) for depth in (0.0, 0.01, 0.02, 0.03, 0.04)])
    answer = anygrasp.make_answer(rows, PANDA_GRIPPER.tip)
    assert_expected(answer, 5)
    assert "width" not in answer  # an opening is not the distance of the contacts
    found = read(anygrasp.make_answer(rows * ([-3.0, *np.ones(16)]), PANDA_GRIPPER.tip))
    assert found.score.tolist() == [-1.5] * 5


def test_graspnet_may_find_nothing() -> None:
    for rows in (np.empty((0, 17), np.float32), []):
        assert read(anygrasp.make_answer(rows, 0.01)).X_SG.shape == (0, 4, 4)


def test_anygrasp_is_given_the_points_of_the_workspace() -> None:
    points, colors, limits = anygrasp.make_input(OBSERVATION)
    assert points.dtype == colors.dtype == np.float32 and points.shape == colors.shape
    p_S = points @ X_SC[:3, :3].T + X_SC[:3, 3]
    assert (p_S > -0.0501).all() and (p_S < [0.6501, 0.4501, 0.45]).all()
    inside = (np.abs((p_S - P_SB) @ R_SB) < BOX_SIZE / 2.0 + 1e-5).all(axis=1)
    box = np.isclose(colors, [1.0, 0.2, 0.0]).all(axis=1)
    np.testing.assert_array_equal(inside & (p_S[:, 2] > 1e-5), box & (p_S[:, 2] > 1e-5))
    assert box.sum() == (OBSERVATION.segmentation == 2).sum()
    np.testing.assert_allclose(p_S[~box, 2], 0.0, atol=1e-5)
    np.testing.assert_allclose(colors[~box], np.tile([0.0, 0.4, 1.0], ((~box).sum(), 1)))
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose(limits, [low[0], high[0], low[1], high[1], low[2], high[2]])


def test_anygrasp_searches_at_the_target() -> None:
    points, colors, limits = anygrasp.make_input(observe(target=2, color=None))
    assert len(points) == len(anygrasp.make_input(OBSERVATION)[0])
    assert np.unique(colors).tolist() == [np.float32(128 / 255)]
    on_box = OBSERVATION.points()[OBSERVATION.segmentation == 2]
    np.testing.assert_allclose(limits[::2], on_box.min(axis=0))
    np.testing.assert_allclose(limits[1::2], on_box.max(axis=0))
    rows = np.array([graspnet_row(0.02 + beyond) for beyond in (0.0, 0.3)])
    assert anygrasp.select_within(rows, limits).tolist() == rows[:1].tolist()
    assert anygrasp.make_input(observe(target=7))[2] == []
    assert [len(part) for part in anygrasp.make_input(NOTHING)] == [0, 0, 0]


@pytest.mark.parametrize("count", [3, 10, 25])
def test_points_are_sampled_without_repetition_if_there_are_enough(count: int) -> None:
    points = np.arange(30.0).reshape(10, 3)
    found = anygrasp.sample_points(points, count, np.random.default_rng(1))
    assert found.shape == (count, 3)
    assert len(np.unique(found, axis=0)) == min(count, 10)
    assert set(found[:, 0]) <= set(points[:, 0])


# GraspGen: poses of the Panda's hand, whose finger pads meet 0.1034 m before its base.
PANDA_BASE = pose_in(
    X_CS, [CLOSING, np.cross(APPROACH, CLOSING), APPROACH], MIDDLE - 0.1034 * APPROACH
)


def packed_array(values: Any, kind: str) -> dict[bytes, Any]:
    """An array as msgpack-numpy packs it."""
    array = np.asarray(values, kind)
    return {
        b"nd": True,  # codespell:ignore
        b"type": kind,
        b"kind": b"",
        b"shape": array.shape,
        b"data": array.tobytes(),
    }


def reply_with(poses: Any, confidences: Any, kind: str = "<f8") -> bytes:
    """A reply of GraspGen's server; its own arrays are in single precision."""
    packed: bytes = msgpack.packb(
        {
            "grasps": packed_array(poses, kind),
            "confidences": packed_array(confidences, kind),
            "num_grasps": len(poses),
            "timing": {"infer_ms": 42.0},
        },
        use_bin_type=True,
    )
    return packed


def test_graspgen_poses_are_those_of_the_hand() -> None:
    X, confidence = graspgen.read_reply(reply_with([PANDA_BASE, PANDA_BASE], [0.25, 0.75]))
    answer = graspgen.make_answer([(X, confidence), (X[:1], confidence[:1])])
    assert_expected(answer, 3)
    assert answer["score"].tolist() == [0.25, 0.75, 0.25]


def test_graspgen_may_find_nothing() -> None:
    nothing = graspgen.read_reply(reply_with(NO_POSES, NO_NUMBERS, "<f4"))
    for parts in ([], [nothing], [nothing, nothing]):
        assert read(graspgen.make_answer(parts)).X_SG.shape == (0, 4, 4)


def test_graspgen_errors_are_told() -> None:
    with pytest.raises(RuntimeError, match=r"^GraspGen: point_cloud must be \(N, 3\)$"):
        graspgen.read_reply(msgpack.packb({"error": "point_cloud must be (N, 3)"}))


def test_graspgen_is_asked_for_one_object() -> None:
    (points,) = graspgen.make_input(OBSERVATION)
    np.testing.assert_array_equal(
        points, OBSERVATION.points()[OBSERVATION.segmentation == 2].astype(np.float32)
    )
    request = msgpack.unpackb(graspgen.make_request(points), raw=False)
    cloud = request.pop("point_cloud")
    assert (cloud[b"nd"], cloud[b"kind"]) == (True, b"")  # codespell:ignore
    sent = np.ndarray(buffer=cloud[b"data"], dtype=cloud[b"type"], shape=cloud[b"shape"])
    np.testing.assert_array_equal(sent, points)
    assert request == {
        "action": "infer",
        "grasp_threshold": -1.0,
        "num_grasps": 200,
        "topk_num_grasps": 100,
        "min_grasps": 40,
        "max_tries": 6,
        "remove_outliers": True,
    }


def test_graspgen_inputs_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    assert graspgen.make_input(NOTHING) == []
    assert graspgen.make_input(observe(target=7)) == []
    with pytest.raises(ValueError, match="has no segmentation"):
        graspgen.make_input(observe(segmentation=None))
    monkeypatch.setattr(graspgen, "MAX_POINTS", 100)
    (few,), (again,) = graspgen.make_input(OBSERVATION), graspgen.make_input(observe(target=2))
    assert few.shape == (100, 3) and few.tolist() == again.tolist()


@contextmanager
def graspgen_server(answer: Callable[[Any], bytes]) -> Iterator[str]:
    """A server with the socket and the messages of GraspGen's; its address."""
    with zmq.Context() as context, context.socket(zmq.REP) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        port = socket.bind_to_random_port("tcp://127.0.0.1")
        stop = threading.Event()

        def serve() -> None:
            while not stop.is_set():
                if socket.poll(20):
                    cloud = msgpack.unpackb(socket.recv(), raw=False)["point_cloud"]
                    kind, shape = cloud[b"type"], cloud[b"shape"]
                    socket.send(answer(np.ndarray(shape, kind, cloud[b"data"])))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"tcp://127.0.0.1:{port}"
        finally:
            stop.set()
            thread.join()


def test_graspgen_server_is_asked_with_centred_points(monkeypatch: pytest.MonkeyPatch) -> None:
    centre = OBSERVATION.points()[OBSERVATION.segmentation == 2].mean(axis=0)
    X_centred = PANDA_BASE.copy()
    X_centred[:3, 3] -= centre

    def answer(points: np.ndarray) -> bytes:
        assert np.abs(points.mean(axis=0)).max() < 1e-6 and np.ptp(points, axis=0).max() < 0.2
        return reply_with([X_centred], [0.5])

    with graspgen_server(answer) as address:
        monkeypatch.setattr(graspgen, "SERVER", address)
        for _ in range(2):
            assert_expected(graspgen.plan(OBSERVATION), tolerance=1e-7)  # points are in float32


def test_graspgen_server_may_be_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graspgen, "SERVER", "tcp://127.0.0.1:9")
    monkeypatch.setattr(graspgen, "REPLY_TIMEOUT", 0.05)
    with pytest.raises(
        TimeoutError, match=r"server at tcp://127\.0\.0\.1:9 sent no reply in 0\.05 s"
    ):
        graspgen.plan(OBSERVATION)


# VGN: fingers begin at the origin and end 0.05 m beyond it; y closes (src/vgn/vis.py).
CORNER = np.array([0.05, -0.02, -0.05])


def vgn_grasp(corner: np.ndarray = CORNER, width: float = 0.06) -> Any:
    X_VS = np.eye(4)
    X_VS[:3, 3] = -corner
    X_VF = pose_in(X_VS, [np.cross(CLOSING, APPROACH), CLOSING, APPROACH], TIPS - 0.05 * APPROACH)
    return SimpleNamespace(pose=SimpleNamespace(as_matrix=lambda: X_VF), width=width)


def test_vgn_grasps_are_measured_in_their_cube() -> None:
    other = np.array([0.12, 0.1, -0.05])
    parts = [
        (CORNER, [vgn_grasp(), vgn_grasp(width=0.05)], np.array([0.91, 0.95], np.float32)),
        (other, [vgn_grasp(other)], [0.99]),
        (CORNER, np.asarray([]), np.asarray([])),
    ]
    answer = vgn.make_answer(parts)
    assert_expected(answer, 3)
    assert answer["width"].tolist() == [0.06, 0.05, 0.06]
    np.testing.assert_allclose(answer["score"], [0.91, 0.95, 0.99])


def test_vgn_may_find_nothing() -> None:
    for parts in ([], [(CORNER, [], [])]):
        assert read(vgn.make_answer(parts)).X_SG.shape == (0, 4, 4)


def distances(volume: Any) -> np.ndarray:
    """(n, n, n) distances in front of the surface [m]; NaN where the volume has none."""
    grid = volume.get_grid()
    n = grid.shape[-1]
    assert grid.shape == (1, n, n, n) and grid.dtype == np.float32
    assert (grid == 0.0).any() and grid.min() >= 0.0 and grid.max() < 0.99
    return np.where(grid[0] > 0.0, (2.0 * grid[0] - 1.0) * 4.0 * volume.voxel_size, np.nan)


@pytest.mark.parametrize("resolution", [40, 60])
def test_volume_has_the_surface_where_it_is(resolution: int) -> None:
    """The value changes its sign at the top of the box and at the table, within a voxel."""
    volume = vgn.make_input(OBSERVATION, CORNER, resolution=resolution)
    voxel = 0.3 / resolution
    assert volume.voxel_size == pytest.approx(voxel) and volume.size == 0.3
    found = distances(volume)
    for (x, y), height in {(0.2, 0.15): 0.08, (0.19, 0.17): 0.08, (0.1, 0.05): 0.0}.items():
        i, j = int((x - CORNER[0]) / voxel), int((y - CORNER[1]) / voxel)
        centres = CORNER[2] + voxel * (np.arange(resolution) + 0.5)
        column = found[i, j]
        assert centres[column < 0.0].max() < height + voxel
        assert centres[column > 0.0].min() > height - voxel
        near = np.abs(centres - height) < 2.0 * voxel
        assert np.isfinite(column[near]).all()


def test_volume_holds_distances_along_rays() -> None:
    """As rays through the centres of the voxels have them, which miss those of pixels a little."""
    centres = 0.3 / 40 * (np.arange(40) + 0.5)
    p_S = np.stack(np.meshgrid(*3 * [centres], indexing="ij"), axis=-1) + CORNER
    away = p_S - X_SC[:3, 3]
    length = np.linalg.norm(away, axis=-1)
    exact = hit_distances(X_SC[:3, 3], away / length[..., None])[0] - length
    found = distances(vgn.make_input(OBSERVATION, CORNER))
    both = np.isfinite(found)
    assert both.sum() > 4000
    error = np.abs(found - exact)[both]
    assert np.median(error) < 1e-3 and np.quantile(error, 0.95) < 4e-3
    limit = 0.98 * 4 * 0.3 / 40
    assert np.abs(found[both]).max() <= limit + 1e-6
    assert (~both & (np.abs(exact) < 0.9 * limit)).sum() < 0.02 * both.sum()


def test_volume_is_the_one_of_open3d() -> None:
    """Values of UniformTSDFVolume of Open3D 0.20 for the same depth image."""
    grid = vgn.make_input(OBSERVATION, CORNER).get_grid()[0]
    values = {
        (0, 25, 3): 0.03575525,
        (11, 35, 4): 0.16121742,
        (2, 36, 6): 0.48466220,
        (20, 0, 7): 0.61504424,
        (34, 5, 9): 0.89237261,
        (15, 21, 12): 0.68850315,
        (13, 26, 13): 0.39776397,
        (18, 17, 14): 0.50653874,
        (19, 28, 18): 0.68755990,
        (23, 17, 19): 0.83182472,
    }
    found = {index: float(grid[index]) for index in values}
    assert found == pytest.approx(values, abs=2e-5)


def test_nothing_is_known_without_depth() -> None:
    assert not vgn.make_input(NOTHING, CORNER).get_grid().any()
    behind = observe(X_WC=X_WS @ X_SC @ np.diag([1.0, -1.0, -1.0, 1.0]))
    assert not vgn.make_input(behind, CORNER).get_grid().any()


@pytest.mark.parametrize("size", [(0.6, 0.4), (0.594, 0.42), (0.25, 0.3), (0.31, 1.0)])
def test_cubes_cover_the_board(size: tuple[float, float]) -> None:
    bounds = np.array([[0.1, -0.2, 0.0], [0.1 + size[0], -0.2 + size[1], 0.4]])
    corners = vgn.cube_corners(observe(bounds=bounds))
    assert (corners[:, 2] == -0.05).all()
    for axis in (0, 1):
        starts = np.unique(corners[:, axis].round(9))
        assert starts[0] <= bounds[0, axis] and starts[-1] + 0.3 >= bounds[1, axis] - 1e-9
        assert (np.diff(starts) <= 0.2 + 1e-9).all()  # they overlap by 0.1 m at least
        middle = (starts[0] + starts[-1] + 0.3) / 2.0
        assert middle == pytest.approx(bounds[:, axis].mean())


def test_one_cube_is_around_the_target() -> None:
    (corner,) = vgn.cube_corners(observe(target=2))
    np.testing.assert_allclose(corner[:2] + 0.15, P_SB[:2], atol=0.03)  # sides are hidden
    assert corner[2] == -0.05
    assert vgn.cube_corners(observe(target=7)).shape == (0, 3)


# Methods that are not here, with the calls that are published, for programs as users run them.
FAKES: dict[str, dict[str, str]] = {
    "contact_graspnet": {
        "config_utils.py": """
def load_config(checkpoint_dir, batch_size=None, arg_configs=None):
    return {"dir": checkpoint_dir, "batch": batch_size}
""",
        "tensorflow/compat/v1.py": """
from types import SimpleNamespace
def disable_eager_execution(): pass
def ConfigProto(allow_soft_placement): return SimpleNamespace(gpu_options=SimpleNamespace())
def Session(config): return "session"
class train:
    def Saver(save_relative_paths): return "saver"
""",
        "contact_grasp_estimator.py": """
import numpy as np
class GraspEstimator:
    def __init__(self, cfg): assert cfg["batch"] == 1
    def build_network(self): pass
    def load_weights(self, sess, saver, log_dir, mode="test"):
        assert (sess, saver, mode) == ("session", "saver", "test") and "scene_test" in log_dir
    def extract_point_clouds(self, depth, K, segmap=None, rgb=None, z_range=[0.2, 1.8]):
        assert depth.shape == segmap.shape and K.shape == (3, 3)
        return "points", {2: "segment"}, None
    def predict_scene_grasps(self, sess, pc_full, pc_segments={}, local_regions=False,
                             filter_grasps=False, forward_passes=1):
        assert (sess, pc_full, pc_segments) == ("session", "points", {2: "segment"})
        assert local_regions and filter_grasps
        X = np.load("pose.npy")[None]
        return {2: X}, {2: np.array([0.5])}, {2: X[0, :3, 3]}, {2: np.array(0.065)}
""",
    },
    "anygrasp": {
        "gsnet.py": """
from types import SimpleNamespace
import numpy as np
class AnyGrasp:
    def __init__(self, cfgs): assert cfgs.max_gripper_width == 0.08 and cfgs.checkpoint_path
    def load_net(self): self.is_loaded = True
    def get_grasp(self, points, colors, lims=None, apply_object_mask=True, dense_grasp=False,
                  collision_detection=True):
        assert self.is_loaded and len(points) == len(colors) > 1000 and len(lims) == 6
        return SimpleNamespace(grasp_group_array=np.load("pose.npy")[None]), "cloud"
"""
    },
    "vgn": {
        "vgn/detection.py": """
from pathlib import Path
from types import SimpleNamespace
import numpy as np
class VGN:
    def __init__(self, model_path, rviz=False): assert isinstance(model_path, Path)
    def __call__(self, state):
        assert state.tsdf.get_grid().shape == (1, 40, 40, 40) and state.tsdf.voxel_size == 0.0075
        pose = SimpleNamespace(as_matrix=lambda: np.load("pose.npy"))
        return [SimpleNamespace(pose=pose, width=0.06)], np.array([0.9]), 0.01
"""
    },
}
SAVED: dict[str, Any] = {"contact_graspnet": CONTACT_POSE, "anygrasp": graspnet_row(0.03)}


@pytest.mark.parametrize("name", FAKES)
def test_adapter_runs_beside_its_method(name: str, tmp_path: Path) -> None:
    """The copied files run without burg_drake, and no module of the method is hidden by them."""
    for path in (COPIED, FOLDER / f"{name}_planner.py"):
        shutil.copy(path, tmp_path)
    for file, text in FAKES[name].items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    observation = observe(target=2)
    saved = SAVED.get(name)
    if saved is None:
        saved = vgn_grasp(vgn.cube_corners(observation)[0]).pose.as_matrix()
    np.save(tmp_path / "pose.npy", saved)
    burg_planner.write_arrays(tmp_path / "observation.npz", observation.arrays())
    program = [*command(tmp_path / f"{name}_planner.py"), "observation.npz", "answer.npz"]
    subprocess.run(program, cwd=tmp_path, check=True, timeout=60.0)
    answer = burg_planner.read_arrays(tmp_path / "answer.npz")
    assert_expected(answer)
    assert answer.get("width", [0.06])[0] == pytest.approx(0.06)
    assert 0.0 < answer["time"] < 10.0


def test_giga_is_called_as_vgn_is(monkeypatch: pytest.MonkeyPatch) -> None:
    (corner,) = vgn.cube_corners(observe(target=2))

    class VGNImplicit:
        def __init__(self, model_path: Path, model_type: str, **options: Any) -> None:
            assert (model_type, options["resolution"]) == ("giga", 40)

        def __call__(self, state: Any) -> Any:
            assert state.tsdf.get_grid().any() and not hasattr(state, "tsdf_process")
            return [vgn_grasp(corner)], np.array([0.9]), 0.01

    module: Any = ModuleType("vgn.detection_implicit")
    module.VGNImplicit = VGNImplicit
    monkeypatch.setitem(sys.modules, "vgn", ModuleType("vgn"))
    monkeypatch.setitem(sys.modules, "vgn.detection_implicit", module)
    monkeypatch.setattr(vgn, "MODEL_TYPE", "giga")
    vgn.load_method.cache_clear()
    assert_expected(vgn.plan(observe(target=2)))
    vgn.load_method.cache_clear()


def test_graspnet_baseline_is_called_as_in_its_demo(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.array([graspnet_row(0.02), graspnet_row(0.3), graspnet_row(0.03, opening=0.01)])

    class Array:  # a tensor
        def __init__(self, values: np.ndarray) -> None:
            self.values = values

        def __getattr__(self, name: str) -> Any:
            return lambda *_: self.values if name == "numpy" else self

    class GraspNet(SimpleNamespace):
        def __call__(self, inputs: dict[str, Array]) -> str:
            values = inputs["point_clouds"].values
            assert values.shape == (1, 20000, 3) and values.dtype == np.float32
            return "end_points"

        def __getattr__(self, name: str) -> Any:
            return lambda *_: self

        def parameters(self) -> Iterator[Any]:
            yield SimpleNamespace(device="cpu")

    class ModelFreeCollisionDetector:
        def __init__(self, points: np.ndarray, voxel_size: float) -> None:
            assert points.shape[1] == 3

        def detect(self, group: Any, approach_dist: float, collision_thresh: float) -> Any:
            return np.array([False, False, True])

    modules: dict[str, dict[str, Any]] = {
        "torch": {
            "no_grad": nullcontext,
            "from_numpy": Array,
            "load": lambda *_, **__: {"model_state_dict": {}},
            "cuda": SimpleNamespace(is_available=lambda: False),
        },
        "graspnet": {
            "GraspNet": GraspNet,
            "pred_decode": lambda end_points: [Array(rows)] if end_points == "end_points" else [],
        },
        "collision_detector": {"ModelFreeCollisionDetector": ModelFreeCollisionDetector},
        "graspnetAPI": {"GraspGroup": lambda rows: rows},
    }
    for name, contents in modules.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(sys, "path", list(sys.path))
    anygrasp.load_baseline.cache_clear()
    assert_expected(anygrasp.plan_with_baseline(observe(target=2)))
    anygrasp.load_baseline.cache_clear()
    for empty in (NOTHING, observe(target=7)):
        assert len(anygrasp.plan_with_baseline(empty)["X_CG"]) == 0


@pytest.mark.parametrize("name", ADAPTERS)
def test_adapters_are_written_for_old_pythons(name: str) -> None:
    """Methods need Pythons from 3.8 on, and importing an adapter imports no method."""
    text = (FOLDER / f"{name}_planner.py").read_text()
    tree = ast.parse(text, feature_version=(3, 8))
    assert "from __future__ import annotations" in text
    allowed = {"__future__", "argparse", "burg_planner", "functools", "numpy", "os", "pathlib"}
    allowed |= {"time", "types", "typing", "burg_drake.benchmark.burg_planner"}
    at_import = [node for node in tree.body if not isinstance(node, ast.FunctionDef)]
    for node in at_import:
        for part in ast.walk(node):
            if isinstance(part, ast.Import):
                assert {alias.name for alias in part.names} <= allowed
            if isinstance(part, ast.ImportFrom):
                assert part.module in allowed
