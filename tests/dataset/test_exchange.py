"""Data sets in the layouts of others, read back by the words of their documents.

Nothing here is shared with the writers: images follow from formulas (`polyhedra`), models are read
line by line, and drawn triangle by triangle.
"""

from __future__ import annotations

import json
import tarfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from burg_drake.core import InvalidInputError, UnknownNameError
from burg_drake.dataset.exchange import (
    contact_sheet,
    write_bop,
    write_card,
    write_coco,
    write_graspnet,
    write_webdataset,
)
from burg_drake.dataset.exchange.graspnet import grasp_scores
from burg_drake.dataset.exchange.sheet import tag_place
from burg_drake.dataset.exchange.source import StoredSamples
from burg_drake.dataset.samples import load_dataset
from burg_drake.objects.library import ObjectLibrary
from tests.dataset import drawn_samples
from tests.dataset.polyhedra import (
    BOX_CORNERS,
    CAMERA,
    COLORS,
    InMemory,
    scene_of,
    some_grasps,
    write_library,
)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    return write_library(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def samples(library: ObjectLibrary) -> InMemory:
    """Two scenes of two views, the second with two instances of an object."""
    return InMemory((*scene_of(3), *scene_of(5, twice=True)), library)


@pytest.fixture(scope="module")
def single(library: ObjectLibrary) -> InMemory:
    """A scene that has each object once, with grasps."""
    return InMemory(tuple(scene_of(0, grasps=some_grasps())), library)


# --- BOP ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bop(samples: InMemory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bop") / "data"
    write_bop(samples, folder)
    return folder


def read_ply(path: Path) -> tuple[dict[str, NDArray], NDArray]:
    """Properties of the vertices, and triangles, of an ASCII file."""
    head, _, body = path.read_text().partition("end_header\n")
    lines = head.splitlines()
    assert lines[:2] == ["ply", "format ascii 1.0"]
    count = int(next(x for x in lines if x.startswith("element vertex")).split()[-1])
    names = [x.split()[-1] for x in lines if x.startswith("property") and "list" not in x]
    rows = [list(map(float, x.split())) for x in body.splitlines()]
    faces = np.array(rows[count:], dtype=int)
    assert (faces[:, 0] == 3).all()
    return dict(zip(names, np.array(rows[:count]).T, strict=True)), faces[:, 1:]


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


def image(path: Path) -> NDArray:
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


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
    assert "symmetries_discrete" not in gem
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


# --- COCO -----------------------------------------------------------------------------------------


def mask_of(segmentation: dict) -> NDArray:
    """A mask from the text of its run lengths, by the words of COCO's maskApi.h."""
    counts, place = [], 0
    while place < len(segmentation["counts"]):
        number, shift, more = 0, 0, True
        while more:
            c = ord(segmentation["counts"][place]) - 48
            number |= (c & 31) << shift
            more, place, shift = bool(c & 32), place + 1, shift + 5
        if c & 16:
            number -= 1 << shift
        counts.append(number + (counts[-2] if len(counts) > 2 else 0))
    height, width = segmentation["size"]
    pixels = np.repeat(np.arange(len(counts)) % 2, counts)
    return pixels.reshape(width, height).T.astype(bool)


@pytest.fixture(scope="module")
def coco(samples: InMemory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("coco") / "data"
    write_coco(samples, folder, images="png")
    return folder


def test_coco_has_every_visible_instance(coco: Path, samples: InMemory) -> None:
    content = json.loads((coco / "instances.json").read_text())
    names = {c["id"]: c["name"] for c in content["categories"]}
    assert names == {1: "gem", 2: "box"}
    assert [x["id"] for x in content["images"]] == [1, 2, 3, 4]
    found = 0
    for listed, sample in zip(content["images"], samples, strict=True):
        shown = image(coco / "images" / listed["file_name"])[..., ::-1]
        np.testing.assert_array_equal(shown, sample.images.color)
        assert (listed["width"], listed["height"]) == (96, 72)
        own = [x for x in content["annotations"] if x["image_id"] == listed["id"]]
        for annotation in own:
            mask = mask_of(annotation["segmentation"])
            color = COLORS[names[annotation["category_id"]]]
            assert (shown[mask] == color).all()
            assert annotation["area"] == mask.sum() and annotation["iscrowd"] == 0
            x, y, width, height = annotation["bbox"]
            rows, columns = mask.any(axis=1).nonzero()[0], mask.any(axis=0).nonzero()[0]
            assert (x, y) == (columns[0], rows[0])
            assert (x + width - 1, y + height - 1) == (columns[-1], rows[-1])
            found += mask.sum()
        assert found == sum((s.images.labels > 0).sum() for s in samples.samples[: listed["id"]])


def test_coco_is_read_by_its_own_library(coco: Path) -> None:
    api = pytest.importorskip("pycocotools.coco").COCO(coco / "instances.json")
    for annotation in api.loadAnns(api.getAnnIds()):
        mask = api.annToMask(annotation).astype(bool)
        np.testing.assert_array_equal(mask, mask_of(annotation["segmentation"]))
        assert annotation["area"] == mask.sum()


# --- GraspNet -------------------------------------------------------------------------------------


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
    write_graspnet(single, tmp_path / "again")
    meta = tmp_path / "again/scenes/scene_0000/realsense/meta/0001.mat"
    assert meta.read_bytes() == (graspnet / "meta/0001.mat").read_bytes()
    assert b"Created on" not in meta.read_bytes()


# --- WebDataset -----------------------------------------------------------------------------------


def test_webdataset_has_shards_of_whole_samples(samples: InMemory, tmp_path: Path) -> None:
    grasped = replace(samples[0], grasps=some_grasps(), sensor_depth=samples[0].images.depth * 2)
    data = InMemory((grasped, *samples.samples[1:]), samples.library)
    for name in ("one", "two"):
        write_webdataset(data, tmp_path / name, shard_size=3, images="png")
    shards = sorted((tmp_path / "one").iterdir())
    assert [s.name for s in shards] == ["shard-000000.tar", "shard-000001.tar"]
    for shard in shards:
        assert shard.read_bytes() == (tmp_path / "two" / shard.name).read_bytes()
    files = {}
    for shard in shards:
        with tarfile.open(shard) as tar:
            files |= {m.name: tar.extractfile(m).read() for m in tar}
    keys = list(dict.fromkeys(name.partition(".")[0] for name in files))
    assert keys == ["000003_000", "000003_001", "000005_000", "000005_001"]
    assert [n.partition(".")[2] for n in list(files)[:5]] == [
        "png", "depth.png", "seg.png", "sensor.png", "json"]  # fmt: skip
    for key, sample in zip(keys, data, strict=True):
        content = json.loads(files[f"{key}.json"])
        seg = decoded(files[f"{key}.seg.png"])
        np.testing.assert_array_equal(seg, sample.images.labels)
        depth = decoded(files[f"{key}.depth.png"]) * content["depth_unit"]
        assert np.abs(depth - sample.images.depth).max() < 6e-5
        np.testing.assert_array_equal(content["X_SC"], sample.view.X_SC)
        for entry, label in zip(content["instances"], sample.instances, strict=True):
            np.testing.assert_array_equal(mask_of(entry["amodal"]), label.amodal)
            assert data.objects[entry["object_id"] - 1] == label.object
    grasps = json.loads(files["000003_000.json"])["grasps"]
    assert grasps["margins"]["slip"] == [None, 0.0, 0.01, 0.04, None, None]
    twice = decoded(files["000003_000.sensor.png"]).astype(int)
    assert np.abs(twice - 2 * decoded(files["000003_000.depth.png"])).max() <= 1


def test_webdataset_is_read_by_its_own_library(samples: InMemory, tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    write_webdataset(samples, tmp_path / "out", images="png")
    shard = str(tmp_path / "out/shard-000000.tar")
    found = list(webdataset.WebDataset(shard, shardshuffle=False).decode())
    assert [one["__key__"] for one in found] == [sample.key for sample in samples]
    for one, sample in zip(found, samples, strict=True):
        np.testing.assert_array_equal(decoded(one["seg.png"]), sample.images.labels)
        assert [entry["name"] for entry in one["json"]["instances"]] == [
            label.name for label in sample.instances
        ]


def decoded(data: bytes) -> NDArray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


# --- card and sheet -------------------------------------------------------------------------------


def test_card_counts(samples: InMemory, tmp_path: Path) -> None:
    made = InMemory(
        (replace(samples[0], grasps=some_grasps()), *samples.samples[1:]), samples.library
    )
    for _ in range(2):  # a card may be replaced
        write_card(made, tmp_path, facts={"seed": "7"}, licences={"box": "CC0-1.0"})
    text = (tmp_path / "README.md").read_text()
    assert "# bodies" in text and "| scenes | 2 |" in text and "| samples | 4 |" in text
    assert "| 1 | gem | 6 | 6 | gem.stl | gem000000000 | not stated |" in text
    assert "| 2 | box | 4 | 4 | box.stl | box000000000 | CC0-1.0 |" in text
    assert "| lifted | 2 |" in text and "| seed | 7 |" in text and "| burg_drake |" in text
    for name in ("distance", "elevation", "visibility", "objects"):
        assert f"card/{name}.svg" in text
        tree = ElementTree.parse(tmp_path / "card" / f"{name}.svg")
        bars = [b for b in tree.iter() if b.tag.endswith("rect")][1:]
        assert max(float(bar.attrib["height"]) for bar in bars) == pytest.approx(130.0)
    assert [float(b.attrib["height"]) for b in bars] == [0, 0, 130, 130]  # 2 and 3 objects
    assert image(tmp_path / "card/examples.png").shape[1] > 960


def test_card_does_not_replace_what_is_not_its_own(samples: InMemory, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(InvalidInputError, match="no card"):
        write_card(samples, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["README.md"]


def test_sheet_shows_colour_depth_and_labels(samples: InMemory, tmp_path: Path) -> None:
    contact_sheet(samples, tmp_path / "sheet.png", rows=2, columns=2)
    sheet = image(tmp_path / "sheet.png")[..., ::-1]
    panel, height = 320, 240
    assert sheet.shape == (2 * (height + 26) + 6, 2 * (3 * panel + 18) + 6, 3)
    first = sheet[26 : 26 + height, 6:]
    sample = samples[0]
    labels = cv2.resize(sample.images.labels, (panel, height), interpolation=cv2.INTER_NEAREST)
    inner = cv2.erode((labels == 1).astype(np.uint8), np.ones((9, 9))).astype(bool)
    assert (first[:, :panel][inner] == COLORS["box"]).all()
    depth = cv2.resize(sample.images.depth, (panel, height), interpolation=cv2.INTER_NEAREST)
    brightness = first[:, panel + 6 : 2 * panel + 6].mean(axis=-1)
    there = depth > 0
    assert np.corrcoef(depth[there], brightness[there])[0, 1] < -0.9  # bright is near
    beside = first[:, 2 * panel + 12 : 3 * panel + 12].astype(int)
    assert np.ptp(beside[inner], axis=-1).min() > 10  # tinted, and the rest is grey
    assert np.ptp(beside[labels == 0], axis=-1).min() == 0
    contact_sheet(samples, tmp_path / "sheet.html", title="Two <scenes>")
    page = (tmp_path / "sheet.html").read_text()
    assert page.count("data:image/png;base64,") == 4 and "Two &lt;scenes&gt;" in page
    assert "000005_001, camera sphere, 3 of 3 seen" in page


def test_sheet_shows_the_sensor_s_depth_in_the_same_colours(
    samples: InMemory, tmp_path: Path
) -> None:
    exact = samples[0].images.depth
    half = np.where(np.arange(exact.shape[1]) % 2 == 1, exact, 0.0).astype(np.float32)
    contact_sheet([replace(samples[0], sensor_depth=half)], tmp_path / "sheet.png")
    panels = image(tmp_path / "sheet.png")[26:266, 6:].astype(int)
    assert panels.shape[1] == 4 * 320 + 3 * 6 + 6
    one, other = panels[:, 326:646], panels[:, 652:972]
    shown = (other != 70).any(axis=-1)
    assert 0.3 < shown.mean() < 0.6
    np.testing.assert_array_equal(one[shown], other[shown])


def test_names_on_a_sheet_stay_in_it_and_beside_each_other() -> None:
    corners = [(100.0, 100.0), (110.0, 104.0), (128.0, 98.0), (104.0, 118.0)]
    boxes = [np.array([*corner, 40.0, 30.0]) for corner in corners]
    boxes += [np.array([300.0, 230.0, 40.0, 30.0]), np.array([-20.0, -20.0, 30.0, 30.0])]
    taken: list[NDArray] = []
    for box in boxes:
        place = tag_place(box, np.array([55, 15]), (320, 240), taken)
        assert (place[2:] - place[:2]).tolist() == [55, 15]
        assert (place[:2] >= 0).all() and (place[2:] <= [320, 240]).all()
        for other in taken:
            assert (place[:2] >= other[2:]).any() or (place[2:] <= other[:2]).any()
        taken.append(place)


def test_a_data_set_on_disk_is_exported(tmp_path: Path) -> None:
    dataset = load_dataset(drawn_samples.write(tmp_path / "data"))
    stored = StoredSamples(dataset)
    write_webdataset(stored, tmp_path / "out")
    write_card(stored, tmp_path / "card")
    with tarfile.open(tmp_path / "out/shard-000000.tar") as tar:
        for sample in dataset:
            content = json.load(tar.extractfile(f"{sample.key}.json"))
            ids = {x["object"]: x["object_id"] for x in content["instances"]}
            assert ids == {name: k for k, name in enumerate(dataset.document.objects, start=1)}
            seg = decoded(tar.extractfile(f"{sample.key}.seg.png").read())
            np.testing.assert_array_equal(seg, sample.images.labels)
    assert "Object library `household`" in (tmp_path / "card/README.md").read_text()


# --- what cannot be written -----------------------------------------------------------------------


def bent(data: InMemory) -> InMemory:
    lens = replace(CAMERA, distortion=(0.1, 0.0, 0.0, 0.0))
    view = replace(data[1].view, intrinsics=lens)
    return replace(data, samples=(data[0], replace(data[1], view=view)))


def without(data: InMemory, **images: None) -> InMemory:
    return replace(data, samples=(replace(data[0], images=replace(data[0].images, **images)),))


def deep(data: InMemory) -> InMemory:
    return without(data, depth=data[0].images.depth + 70.0)


def shuffled(data: InMemory) -> InMemory:
    return replace(data, samples=(data[0], data[2], data[1]))


def zoomed(data: InMemory) -> InMemory:
    view = replace(data[1].view, intrinsics=replace(CAMERA, focal=(80.0, 80.0)))
    return replace(data, samples=(data[0], replace(data[1], view=view)))


@pytest.mark.parametrize(
    ("write", "changed", "message"),
    [
        (write_bop, bent, "camera sphere of sample 000003_001 has lens distortion, which BOP"),
        (write_graspnet, bent, "has lens distortion, which GraspNet cannot"),
        (write_bop, lambda d: without(d, labels=None), "000003_000 has no labels image, which BOP"),
        (write_coco, lambda d: without(d, color=None), "has no color image, which COCO needs"),
        (write_bop, deep, "depth of sample 000003_000 is up to 7.* m; .* take a larger unit"),
        (write_bop, shuffled, "scene 3 begins twice"),
        (write_graspnet, zoomed, "000003_001 has other intrinsics"),
        (write_graspnet, lambda d: d, "scene 5 has object gem twice"),
        (write_coco, lambda d: replace(d, objects=("gem",)), "object 'box' of sample 000003_000"),
        (lambda d, f: write_bop(d, f, sensor_depth=True), lambda d: d, "no depth of a simulated"),
        (lambda d, f: write_bop(d, f, depth_unit=0.0), lambda d: d, "it must be above 0"),
        (lambda d, f: write_webdataset(d, f, shard_size=0), lambda d: d, "shard size 0 must"),
    ],
)
def test_what_cannot_be_expressed_is_named(
    samples: InMemory, tmp_path: Path, write: object, changed: object, message: str
) -> None:
    with pytest.raises((InvalidInputError, UnknownNameError), match=message):
        write(changed(samples), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []  # nothing half-written stays


@pytest.mark.parametrize("write", [write_bop, write_coco, write_graspnet, write_webdataset])
def test_a_folder_of_something_else_is_refused(
    single: InMemory, tmp_path: Path, write: object
) -> None:
    (tmp_path / "mine").write_text("")
    with pytest.raises(InvalidInputError, match="has files in it; choose a new folder"):
        write(single, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


def test_a_full_disk_leaves_nothing(
    single: InMemory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InvalidInputError, match=r"out: No space left on device"):
        write_coco(single, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
