"""BOP: models are read line by line, drawn triangle by triangle, and compared with its images."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from burg_drake.dataset import diameter, find_symmetries, visual_model, write_bop
from burg_drake.objects import load_library
from tests.dataset.exported_files import image, read_ply
from tests.dataset.polyhedra import BOX_CORNERS, CAMERA, COLORS, InMemory, write_library


@pytest.fixture(scope="module")
def bop(samples: InMemory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bop") / "data"
    write_bop(samples, folder)
    return folder


def rendered(path: Path, camera: dict, pose: dict) -> NDArray:
    """Depth of a model in millimetres over three images side by side each way; inf outside
    (Möller and Trumbore 1997)."""
    vertices, faces = read_ply(path)
    points = np.stack([vertices[k] for k in "xyz"], axis=1)
    R = np.reshape(pose["cam_R_m2c"], (3, 3))
    corners = (points @ R.T + pose["cam_t_m2c"])[faces]
    width, height = CAMERA.width, CAMERA.height
    v, u = np.mgrid[-height : 2 * height, -width : 2 * width]
    pixels = np.stack([u, v, np.ones_like(u)], axis=-1)
    lines = pixels @ np.linalg.inv(np.reshape(camera["cam_K"], (3, 3))).T
    depth = np.full(u.shape, np.inf)
    for a, b, c in corners:
        across = np.cross(lines, c - a)
        volume = across @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = across @ -a / volume
            y = lines @ np.cross(-a, b - a) / volume
            t = (c - a) @ np.cross(-a, b - a) / volume
        hit = (x >= 0) & (y >= 0) & (x + y <= 1) & (t > 0)
        depth[hit] = np.minimum(depth, t)[hit]
    return depth


def test_bop_has_models_and_poses_that_give_its_masks_and_depth(bop: Path) -> None:
    inside = np.s_[CAMERA.height : 2 * CAMERA.height, CAMERA.width : 2 * CAMERA.width]
    seen = hidden = cut = 0
    for scene in ("000003", "000005"):
        place = bop / "train_pbr" / scene
        cameras, poses, infos = (
            json.loads((place / f"scene_{name}.json").read_text())
            for name in ("camera", "gt", "gt_info")
        )
        assert list(cameras) == list(poses) == list(infos) == ["0", "1"]
        for view in cameras:
            depth = image(place / "depth" / f"{int(view):06d}.png")
            scale = cameras[view]["depth_scale"]
            for k, (pose, info) in enumerate(zip(poses[view], infos[view], strict=True)):
                model = bop / "models" / f"obj_{pose['obj_id']:06d}.ply"
                whole = rendered(model, cameras[view], pose)
                near = whole[inside]
                name = f"{int(view):06d}_{k:06d}.png"
                mask, visible = image(place / "mask" / name), image(place / "mask_visib" / name)
                assert set(np.unique(mask)) <= {0, 255}
                assert (np.isfinite(near) != (mask > 0)).sum() <= 2  # corners of a pixel
                shown = (visible > 0) & np.isfinite(near)
                assert np.abs(near[shown] - scale * depth[shown]).max() < 0.06
                count = np.isfinite(whole).sum()
                assert abs(info["px_count_all"] - count) <= 2
                assert info["px_count_visib"] == (visible > 0).sum()
                assert info["px_count_valid"] == ((mask > 0) & (depth > 0)).sum()
                assert info["visib_fract"] == pytest.approx((visible > 0).sum() / count, abs=0.01)
                v, u = np.nonzero(visible)
                size = [u.max() - u.min(), v.max() - v.min()]
                assert info["bbox_visib"] == [u.min(), v.min(), *size]
                v, u = np.nonzero(np.isfinite(whole))
                u, v = u - CAMERA.width, v - CAMERA.height
                size = [u.max() - u.min(), v.max() - v.min()]
                assert np.abs(np.subtract(info["bbox_obj"], [u.min(), v.min(), *size])).max() <= 1
                seen += 1
                hidden += info["px_count_visib"] < (mask > 0).sum() - 5
                cut += info["px_count_all"] > (mask > 0).sum() + 5
    assert seen == 10 and hidden and cut  # what the scenes are made for


def test_bop_has_the_cameras_in_the_world(bop: Path, samples: InMemory) -> None:
    cameras = json.loads((bop / "train_pbr/000003/scene_camera.json").read_text())
    sample = samples[1]
    R = np.reshape(cameras["1"]["cam_R_w2c"], (3, 3))
    p_WC = -R.T @ cameras["1"]["cam_t_w2c"] / 1000
    p_SC = np.append(sample.view.X_SC[:3, 3], 1)
    np.testing.assert_allclose(p_WC, (sample.X_WS @ p_SC)[:3], atol=1e-12)
    forward = (sample.X_WS @ sample.view.X_SC)[:3, 2]
    np.testing.assert_allclose(R @ forward, [0, 0, 1], atol=1e-12)
    camera = json.loads((bop / "camera.json").read_text())
    assert (camera["fx"], camera["cy"], camera["width"]) == (90.0, 36.9, 96)


def test_bop_describes_its_models(bop: Path) -> None:
    infos = json.loads((bop / "models/models_info.json").read_text())
    gem, box = infos["1"], infos["2"]
    assert gem["diameter"] == pytest.approx(90.0) and gem["size_z"] == pytest.approx(90.0)
    assert box["diameter"] == pytest.approx(np.linalg.norm([80, 60, 50]))
    assert [box[f"min_{x}"] for x in "xyz"] == pytest.approx([-10, -30, 0])
    assert len(gem["symmetries_discrete"]) == 23  # of an octahedron, besides the identity
    vertices, _ = read_ply(bop / "models/obj_000002.ply")
    assert [vertices[c][0] for c in ("red", "green", "blue")] == list(COLORS["box"])
    points = np.stack([vertices[k] for k in "xyz"])
    outward = np.stack([vertices[f"n{k}"] for k in "xyz"]) * (points - [[30], [0], [25]])
    assert (outward.sum(axis=0) > 0).all()
    turns = [np.reshape(X, (4, 4)) for X in box["symmetries_discrete"]]
    assert len(turns) == 3  # half turns
    for X in turns:
        moved = (X @ np.vstack([points, np.ones(points.shape[1])]))[:3]
        gaps = np.linalg.norm(moved[:, :, None] - points[:, None], axis=0).min(axis=1)
        assert gaps.max() < 1e-6


def test_symmetries_are_those_of_the_mesh_and_its_colours() -> None:
    """A bowl turns by any angle, a bottle by half a turn about its height; the band around a can is
    above its middle, so that it has an up and a down."""
    library = load_library("household")
    found = {}
    for name in ("bowl", "bottle", "can", "mug"):
        model = visual_model(library, name)
        found[name] = find_symmetries(model, diameter(model.vertices))
    assert found["mug"] == {}
    assert found["bowl"].keys() == found["can"].keys() == {"symmetries_continuous"}
    (axis,) = found["bowl"]["symmetries_continuous"]
    assert np.abs(axis["axis"]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    assert axis["offset"][:2] == pytest.approx([0.0, 0.0], abs=0.1)
    assert found["bottle"].keys() == {"symmetries_discrete"}
    (turn,) = found["bottle"]["symmetries_discrete"]
    assert np.reshape(turn, (4, 4)) == pytest.approx(np.diag([-1.0, -1.0, 1.0, 1.0]), abs=0.1)


def test_bop_has_models_to_measure_errors_with(bop: Path) -> None:
    for name, corners, (lower, upper) in (("1", 6, (-45, 45)), ("2", 8, (-30, 70))):
        vertices, faces = read_ply(bop / f"models_eval/obj_00000{name}.ply")
        points = np.stack([vertices[k] for k in "xyz"], axis=1)
        assert len(np.unique(points, axis=0)) == corners and len(faces) == 2 * corners - 4
        assert (points.min(), points.max()) == (lower, upper)
    assert (bop / "models_eval/models_info.json").exists()


def test_bop_has_textures(samples: InMemory, tmp_path: Path) -> None:
    picture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    library = write_library(tmp_path / "library", cv2.imencode(".png", picture)[1].tobytes())
    write_bop(replace(samples, library=library), tmp_path / "out")
    models = tmp_path / "out/models"
    assert "comment TextureFile obj_000002.png\n" in (models / "obj_000002.ply").read_text()
    np.testing.assert_array_equal(image(models / "obj_000002.png"), picture)
    vertices, _ = read_ply(models / "obj_000002.ply")
    points = np.stack([vertices[k] for k in "xyz"], axis=1)
    for point, u, v in zip(points, vertices["texture_u"], vertices["texture_v"], strict=True):
        k = np.linalg.norm(1000 * BOX_CORNERS - point, axis=1).argmin()
        assert (u, v) == (k / 8, k / 16)
    infos = json.loads((models / "models_info.json").read_text())
    assert "symmetries_discrete" not in infos["2"]  # nobody knows what is on it


def test_bop_has_targets_of_what_is_tested(samples: InMemory, tmp_path: Path) -> None:
    assert write_bop(samples, tmp_path / "out", split="test") == ()
    targets = json.loads((tmp_path / "out/test_targets_bop19.json").read_text())
    gems = {x["im_id"]: x["inst_count"] for x in targets if x["scene_id"] == 5 and x["obj_id"] == 1}
    shares = [[g.visibility for g in s.instances if g.object == "gem"] for s in samples[2:]]
    assert 0.0 < shares[0][0] < 0.1 < shares[0][1] and min(shares[1]) > 0.1
    assert gems == {0: 1, 1: 2}  # what is hardly seen is no target
    assert (tmp_path / "out/test/000003/rgb/000001.png").exists()
