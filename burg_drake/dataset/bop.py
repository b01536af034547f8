"""Exports in the layout of the BOP benchmark for 6D object poses ("scenewise")."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import QhullError
from scipy.spatial.distance import cdist

from burg_drake.core import Array, InvalidInputError, inverse
from burg_drake.dataset.export_common import (
    Samples,
    depth_in_units,
    describe_lost_depth,
    encode_color_image,
    exported_depth,
    group_by_scene,
    new_folder,
    object_index,
    require_pinhole,
    required_image,
)
from burg_drake.dataset.model_files import find_symmetries, uncolored_model, visual_model, write_ply
from burg_drake.dataset.sample import Box, InstanceLabel, Sample
from burg_drake.dataset.sample_encoding import encode_png
from burg_drake.geometry import convex_hull
from burg_drake.objects import ObjectLibrary, decimate


def write_bop(
    samples: Samples,
    folder: str | Path,
    *,
    split: str = "train_pbr",
    depth_unit: float = 1e-4,
    sensor_depth: bool = False,
) -> tuple[str, ...]:
    """Writes a data set in BOP's layout.

    Object ids are positions in `samples.objects`, from 1; image ids are the numbers of views.
    Models keep the frame of the library's objects, whose origin is not the centre of their box.

    Args:
        samples: data set with colour, depth and labels.
        folder: new or empty folder.
        split: name of the folder of scenes. Names ending in `_pbr` get colours as JPEG, where
            the toolkit expects it, others as PNG. Names starting with `test` get a list of
            targets.
        depth_unit: unit of depth images [m].
        sensor_depth: whether to write the simulated sensor's depth instead of the exact one.

    Returns:
        Data that BOP cannot represent, one sentence each.

    Raises:
        InvalidInputError: a sample lacks an image, a lens has distortion, a depth is too large, or
            the folder is not empty or cannot be written.
        UnknownNameError: an object is not in the list or the library.
        MeshError: a mesh of the library is damaged.
    """
    if not depth_unit > 0.0:
        raise InvalidInputError(f"unit of depth is {depth_unit:g} m; it must be above 0").about(
            "depth_unit"
        )
    suffix = ".jpg" if split.endswith("_pbr") else ".png"
    lost: set[str] = set()
    targets: list[dict[str, int]] = []
    with new_folder(folder) as fresh:
        write_models(samples.library, samples.objects, fresh)
        for number, views in group_by_scene(samples):
            scene = _SceneFolder(
                samples.objects, fresh / split / f"{number:06d}", suffix, depth_unit
            )
            for sample in views:
                if not (fresh / "camera.json").exists():
                    _write_json(fresh / "camera.json", _camera_values(sample, depth_unit))
                scene.add(sample, exported_depth(sample, "BOP", sensor=sensor_depth))
                lost |= {
                    *_bop_losses(sample),
                    *describe_lost_depth(sample, "BOP", sensor=sensor_depth),
                }
            scene.finish()
            targets += scene.targets(number)
        if split.startswith("test"):
            _write_json(fresh / "test_targets_bop19.json", targets)
        (fresh / "dataset_info.md").write_text(_bop_readme(samples), encoding="utf-8")
    return tuple(sorted(lost))


class _SceneFolder:
    """The folder of a scene while it is written."""

    def __init__(
        self, objects: tuple[str, ...], folder: Path, suffix: str, depth_unit: float
    ) -> None:
        self._objects, self._folder = objects, folder
        self._suffix, self._unit = suffix, depth_unit
        self._cameras: dict[str, dict[str, Any]] = {}
        self._poses: dict[str, list[dict[str, Any]]] = {}
        self._infos: dict[str, list[dict[str, Any]]] = {}
        for name in ("rgb", "depth", "mask", "mask_visib"):
            (folder / name).mkdir(parents=True)

    def add(self, sample: Sample, depth: NDArray[np.float32]) -> None:
        """Writes the images of a view."""
        require_pinhole(sample, "BOP")
        color = required_image(sample, "BOP", "color")
        labels = required_image(sample, "BOP", "labels")
        view, name = str(sample.number), f"{sample.number:06d}"
        numbers = depth_in_units(depth, self._unit, sample.key)
        self._write("rgb", f"{name}{self._suffix}", encode_color_image(color, self._suffix))
        self._write("depth", f"{name}.png", encode_png(numbers))
        self._cameras[view] = _scene_camera_values(sample, self._unit)
        self._poses[view], self._infos[view] = [], []
        for k, label in enumerate(sample.instances):
            visible = labels == label.number
            self._write("mask", f"{name}_{k:06d}.png", _mask_png(label.amodal))
            self._write("mask_visib", f"{name}_{k:06d}.png", _mask_png(visible))
            number = object_index(self._objects, sample, label) + 1
            self._poses[view].append({**_camera_pose_values(label.X_CO, "m2c"), "obj_id": number})
            self._infos[view].append(_instance_info(label, int(visible.sum()), numbers))

    def finish(self) -> None:
        """Writes the annotations of all views."""
        _write_json(self._folder / "scene_camera.json", self._cameras)
        _write_json(self._folder / "scene_gt.json", self._poses)
        _write_json(self._folder / "scene_gt_info.json", self._infos)

    def targets(self, scene: int) -> list[dict[str, int]]:
        """Targets for pose estimators: objects in each image, with their instance counts."""
        # Less visible instances are no targets (BOP Challenge 2020, section 2.4).
        min_visibility = 0.1
        found = []
        for view, poses in self._poses.items():
            seen = [
                pose["obj_id"]
                for pose, info in zip(poses, self._infos[view], strict=True)
                if info["visib_fract"] >= min_visibility
            ]
            for number in sorted(set(seen)):
                target = {"im_id": int(view), "inst_count": seen.count(number)}
                found.append({**target, "obj_id": number, "scene_id": scene})
        return found

    def _write(self, kind: str, name: str, content: bytes) -> None:
        (self._folder / kind / name).write_bytes(content)


def _camera_values(sample: Sample, depth_unit: float) -> dict[str, float]:
    intrinsics = sample.view.intrinsics
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    size = {"width": intrinsics.width, "height": intrinsics.height}
    return {"cx": cx, "cy": cy, "fx": fx, "fy": fy, **size, "depth_scale": 1e3 * depth_unit}


def _scene_camera_values(sample: Sample, depth_unit: float) -> dict[str, Any]:
    X_CW = inverse(sample.X_WS @ sample.view.X_SC)
    K = sample.view.intrinsics.K.reshape(-1).tolist()
    return {"cam_K": K, "depth_scale": 1e3 * depth_unit, **_camera_pose_values(X_CW, "w2c")}


def _camera_pose_values(X: Array, frames: str) -> dict[str, list[float]]:
    """Rotation, row by row, and translation in millimetres."""
    return {
        f"cam_R_{frames}": X[:3, :3].reshape(-1).tolist(),
        f"cam_t_{frames}": (1e3 * X[:3, 3]).tolist(),
    }


def _instance_info(label: InstanceLabel, visible: int, depth: NDArray[np.uint16]) -> dict[str, Any]:
    silhouette = label.silhouette_pixels
    return {
        "bbox_obj": _bop_box(label.amodal_box if visible else None),
        "bbox_visib": _bop_box(label.visible_box if visible else None),
        "px_count_all": silhouette,
        "px_count_valid": int((depth[label.amodal] > 0).sum()),
        "px_count_visib": visible,
        "visib_fract": visible / silhouette if silhouette else 0.0,
    }


def _bop_box(box: Box | None) -> list[int]:
    """A box in BOP's convention, from its first pixel to its last."""
    return [-1, -1, -1, -1] if box is None else [box[0], box[1], box[2] - 1, box[3] - 1]


def _mask_png(mask: NDArray[np.bool_]) -> bytes:
    return encode_png(np.where(mask, np.uint8(255), np.uint8(0)))


def _bop_losses(sample: Sample) -> Iterator[str]:
    if sample.grasps is not None:
        yield "BOP has no grasps."
    if sample.images.normals is not None:
        yield "BOP has no images of normals."
    if sample.view.posture is not None:
        yield "BOP has no postures of an arm."


def _bop_readme(samples: Samples) -> str:
    rows = [f"| {k} | {name} |" for k, name in enumerate(samples.objects, start=1)]
    return "\n".join(
        [
            f"# {samples.name}",
            "",
            "Simulated scenes, written by burg_drake. Models are in the frame in which the object"
            " library has them; the origin is not the middle of their box.",
            "",
            "| obj_id | object |",
            "|---|---|",
            *rows,
            "",
        ]
    )


def _write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content), encoding="utf-8")


BOP_MODEL_UNIT = 1e-3
"""Metres per unit of the model files."""


def write_models(library: ObjectLibrary, objects: Sequence[str], folder: Path) -> None:
    """Writes `models` and `models_eval`, each with its `models_info.json`.

    Args:
        library: library of the objects.
        objects: names, in the order of their ids from 1.
        folder: folder of the data set.
    """
    evaluation_faces = 5000  # Faces of the models for computing pose errors.
    display, evaluation = folder / "models", folder / "models_eval"
    display.mkdir()
    evaluation.mkdir()
    infos: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(objects, start=1):
        file = f"obj_{number:06d}.ply"
        visual = visual_model(library, name)
        write_ply(visual, display / file, unit=BOP_MODEL_UNIT)
        surface, _ = decimate(library.surface(name), evaluation_faces)
        write_ply(uncolored_model(surface), evaluation / file, unit=BOP_MODEL_UNIT)
        infos[str(number)] = model_info(visual.vertices)
        infos[str(number)] |= find_symmetries(visual, diameter(visual.vertices))
    for place in (display, evaluation):
        (place / "models_info.json").write_text(json.dumps(infos, indent=2), encoding="utf-8")


def model_info(vertices: Array) -> dict[str, float]:
    """Box and diameter of a model's vertices (V, 3) [m], in millimetres, by BOP's names."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    info = {"diameter": diameter(vertices)}
    info |= {f"min_{axis}": float(lower[k]) for k, axis in enumerate("xyz")}
    info |= {f"size_{axis}": float(upper[k] - lower[k]) for k, axis in enumerate("xyz")}
    return {name: round(length / BOP_MODEL_UNIT, 6) + 0.0 for name, length in info.items()}


def diameter(vertices: Array) -> float:
    """Largest distance between two vertices (V, 3), found among the corners of their hull."""
    batch_points = 1000  # Points whose distances to all others are in memory at a time.
    points = np.unique(vertices, axis=0)
    with suppress(QhullError):  # a flat model has no hull; all points are used
        points = points[convex_hull(points).vertices]
    parts = np.array_split(points, 1 + len(points) // batch_points)
    return float(max(cdist(part, points).max() for part in parts))
