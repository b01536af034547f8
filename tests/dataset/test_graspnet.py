"""GraspNet-1Billion's layout, read by the words of its API."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import trimesh
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from burg_drake.dataset import grasp_scores, write_graspnet
from tests.dataset.exported_files import image, read_ply
from tests.dataset.polyhedra import CAMERA, COLORS, InMemory, some_grasps, zoomed


@pytest.fixture(scope="module")
def graspnet(single: InMemory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("graspnet") / "data"
    write_graspnet(single, folder)
    return folder / "scenes/scene_0000/realsense"


def test_graspnet_has_poses_labels_and_depth(graspnet: Path, single: InMemory) -> None:
    table, cameras = (np.load(graspnet / f"{n}.npy") for n in ("cam0_wrt_table", "camera_poses"))
    np.testing.assert_array_equal(np.load(graspnet / "camK.npy"), CAMERA.K)
    assert (graspnet.parent / "object_id_list.txt").read_text().split() == ["1", "0"]
    for k, sample in enumerate(single):
        np.testing.assert_allclose(table @ cameras[k], sample.view.X_SC, atol=1e-12)
        meta = loadmat(graspnet / f"meta/{k:04d}.mat")
        label, depth = (
            image(graspnet / f"label/{k:04d}.png"),
            image(graspnet / f"depth/{k:04d}.png"),
        )
        assert meta["cls_indexes"].ravel().tolist() == [2, 1]
        color = image(graspnet / f"rgb/{k:04d}.png")[..., ::-1]
        for number, name in ((1, "gem"), (2, "box")):
            np.testing.assert_array_equal(label == number, (color == COLORS[name]).all(axis=-1))
        error = depth / meta["factor_depth"].item() - sample.images.depth
        assert np.abs(error).max() < 6e-4
        tree = ElementTree.parse(graspnet / f"annotations/{k:04d}.xml").getroot()
        for j, (entry, instance) in enumerate(zip(tree, sample.instances, strict=True)):
            texts = [child.text or "" for child in entry]
            assert texts[0] == str(meta["cls_indexes"].ravel()[j] - 1)
            translation, quaternion = (np.array(t.split(), float) for t in texts[3:])
            R = Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix()
            X = np.column_stack([R, translation])
            np.testing.assert_allclose(X, meta["poses"][:, :, j], atol=1e-8)
            np.testing.assert_allclose(X, instance.X_CO[:3], atol=1e-8)


def test_graspnet_has_models_where_its_images_show_them(graspnet: Path) -> None:
    """Corners of the models, read by trimesh and moved by the poses of its annotations, are around
    the pixels of their labels, and their depths around those of the image."""
    K, root = np.load(graspnet / "camK.npy"), graspnet.parents[2]
    seen = Counter[str]()
    for k in range(2):
        label = image(graspnet / f"label/{k:04d}.png")
        depth = image(graspnet / f"depth/{k:04d}.png") / 1000.0
        for entry in ElementTree.parse(graspnet / f"annotations/{k:04d}.xml").getroot():
            text = {child.tag: child.text or "" for child in entry}
            mesh = trimesh.load(root / text["obj_path"] / "nontextured.ply", process=False)
            R = Rotation.from_quat(np.array(text["ori_in_world"].split(), float)[[1, 2, 3, 0]])
            points = R.apply(mesh.vertices) + np.array(text["pos_in_world"].split(), float)
            pixels = (points / points[:, 2:] @ K.T)[:, :2]
            outline = cv2.convexHull(pixels.astype(np.float32))
            shown = label == int(text["obj_id"]) + 1
            seen[text["obj_name"]] += int(shown.sum())
            for v, u in np.argwhere(shown):
                assert cv2.pointPolygonTest(outline, (float(u), float(v)), True) > -0.01
            assert points[:, 2].min() - 1e-3 < depth[shown].min()
            assert depth[shown].max() < points[:, 2].max() + 1e-3
    assert seen.keys() == {"box", "gem"} and min(seen.values()) > 150


def test_graspnet_has_grasps_with_scores(graspnet: Path) -> None:
    grasps = some_grasps()
    known = [1.0, 0.85, 0.4, 0.0]
    np.testing.assert_allclose(grasp_scores(grasps), [np.nan, *known, np.nan])
    rows = np.load(graspnet / "rect/0000.npy")
    np.testing.assert_allclose(rows[:, 5:], [[1, 1], [0.4, 1], [0, 0]])  # the second is oblique
    for row, X_CG in zip(rows, grasps.X_CG[[1, 3, 4]], strict=True):
        p, closing = X_CG[:3, 3], X_CG[:3, 0]
        ends = [(CAMERA.K @ q / q[2])[:2] for q in (p, p + 0.02 * closing, p - 0.02 * closing)]
        np.testing.assert_allclose(row[:2], ends[0], atol=1e-3)
        off = min(np.linalg.norm(row[2:4] - end) for end in ends[1:])  # either finger
        assert off < 1e-3
        assert row[4] == pytest.approx(91 * 0.02 / p[2], rel=0.02)
    rows = np.load(graspnet / "grasps/0000.npy")
    assert rows.shape == (4, 17) and rows[:, 16].tolist() == [1, 0, 1, 0]
    np.testing.assert_allclose(rows[:, 0], known, atol=1e-6)
    R = rows[:, 4:13].reshape(-1, 3, 3)
    np.testing.assert_allclose(R[..., 0], grasps.X_CG[1:5, :3, 2], atol=1e-6)  # approach
    closing = np.abs((R[..., 1] * grasps.X_CG[1:5, :3, 0]).sum(axis=1))
    np.testing.assert_allclose(closing, 1.0, atol=1e-6)  # along x, either finger first


def test_graspnet_has_a_folder_for_each_camera(single: InMemory, tmp_path: Path) -> None:
    wrist = replace(zoomed(single)[1].view, camera="wrist")
    data = replace(single, samples=(single[0], replace(single[1], view=wrist)))
    write_graspnet(data, tmp_path / "out", camera=None)
    scene = tmp_path / "out/scenes/scene_0000"
    assert np.load(scene / "wrist/camK.npy")[0, 0] == 80 and (scene / "sphere/camK.npy").exists()
    np.testing.assert_allclose(np.load(scene / "wrist/cam0_wrt_table.npy"), wrist.X_SC)
    vertices, _ = read_ply(tmp_path / "out/models/000/nontextured.ply")
    assert (vertices["x"].min(), vertices["z"].max()) == (-0.045, 0.045)


def test_graspnet_is_the_same_each_time(graspnet: Path, single: InMemory, tmp_path: Path) -> None:
    lost = " ".join(write_graspnet(single, tmp_path / "again"))
    for missing in ("grasp_label", "collision_label", "textured.sdf", "rs_wrt_kn.npy"):
        assert missing in lost
    assert "'train' has scenes 0 to 99, and here are 1" in lost
    meta = tmp_path / "again/scenes/scene_0000/realsense/meta/0001.mat"
    assert meta.read_bytes() == (graspnet / "meta/0001.mat").read_bytes()
    assert b"Created on" not in meta.read_bytes()
