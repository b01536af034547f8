"""BOP: the layout of the benchmark for 6D object poses, by scenes ("scenewise").

As documented in github.com/thodan/bop_toolkit, docs/bop_datasets_format.md. Lengths are in
millimetres, pixel centres at integers, cameras as OpenCV has them, as here. `scene_gt_info.json`
has the numbers of scripts/calc_gt_info.py, which counts a silhouette up to one image size beyond
each edge, as `InstanceLabel` does; widths and heights of its boxes are differences of the outermost
pixels, one less than ours. What is visible follows from the labels here, which are exact; there
from a comparison of depths within 15 mm.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, inverse
from burg_drake.dataset.exchange.bop_models import write_models
from burg_drake.dataset.exchange.folder import new_folder
from burg_drake.dataset.exchange.image_files import color_file, depth_numbers
from burg_drake.dataset.exchange.source import (
    Samples,
    depth_of,
    lost_depth,
    object_index,
    require_images,
    require_pinhole,
    scenes_of,
)
from burg_drake.dataset.labels import Box, InstanceLabel
from burg_drake.dataset.samples import Sample, encode_png

DEPTH_UNIT = 1e-4
"""What 1 stands for in a depth image [m], as in BOP's own rendered images: up to 6.5 m."""
MM = 1e3
NO_BOX = [-1, -1, -1, -1]
TARGET_VISIBILITY = 0.1
"""Instances that are seen less are no targets (Hodan et al., "BOP Challenge 2020", section 2.4)."""


def write_bop(
    samples: Samples,
    folder: str | Path,
    *,
    split: str = "train_pbr",
    depth_unit: float = DEPTH_UNIT,
    sensor_depth: bool = False,
) -> tuple[str, ...]:
    """Writes a data set in BOP's layout.

    Object ids are positions in `samples.objects`, from 1; ids of images are the numbers of views.
    Models keep the frame of the library's objects, whose origin is not the middle of their box.

    Args:
        samples: with colour, depth and labels.
        folder: new or empty.
        split: name of the folder of scenes. Those that end in `_pbr` have colours as JPEG, where
            the toolkit expects it, others as PNG. Those that begin with `test` get a list of
            targets.
        depth_unit: what 1 stands for in a depth image [m].
        sensor_depth: depth of the simulated sensor, and not the exact one.

    Returns:
        What BOP cannot carry, one sentence each.

    Raises:
        InvalidInputError: a sample lacks an image, a lens has distortion, a depth is too large, or
            the folder has something in it or cannot be written.
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
        for number, views in scenes_of(samples):
            scene = _Scene(samples.objects, fresh / split / f"{number:06d}", suffix, depth_unit)
            for sample in views:
                if not (fresh / "camera.json").exists():
                    _write_json(fresh / "camera.json", _camera(sample, depth_unit))
                scene.add(sample, depth_of(sample, "BOP", sensor=sensor_depth))
                lost |= {*_losses(sample), *lost_depth(sample, "BOP", sensor=sensor_depth)}
            scene.finish()
            targets += scene.targets(number)
        if split.startswith("test"):
            _write_json(fresh / "test_targets_bop19.json", targets)
        (fresh / "dataset_info.md").write_text(_about(samples), encoding="utf-8")
    return tuple(sorted(lost))


class _Scene:
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
        require_images(sample, "BOP", "color", "labels")
        require_pinhole(sample, "BOP")
        color, labels = sample.images.color, sample.images.labels
        assert color is not None and labels is not None
        view, name = str(sample.number), f"{sample.number:06d}"
        numbers = depth_numbers(depth, self._unit, sample.key)
        self._write("rgb", f"{name}{self._suffix}", color_file(color, self._suffix))
        self._write("depth", f"{name}.png", encode_png(numbers))
        self._cameras[view] = _scene_camera(sample, self._unit)
        self._poses[view], self._infos[view] = [], []
        for k, label in enumerate(sample.instances):
            visible = labels == label.number
            self._write("mask", f"{name}_{k:06d}.png", _mask(label.amodal))
            self._write("mask_visib", f"{name}_{k:06d}.png", _mask(visible))
            number = object_index(self._objects, sample, label) + 1
            self._poses[view].append({**_pose(label.X_CO, "m2c"), "obj_id": number})
            self._infos[view].append(_info(label, int(visible.sum()), numbers))

    def finish(self) -> None:
        """Writes what is known of all views."""
        _write_json(self._folder / "scene_camera.json", self._cameras)
        _write_json(self._folder / "scene_gt.json", self._poses)
        _write_json(self._folder / "scene_gt_info.json", self._infos)

    def targets(self, scene: int) -> list[dict[str, int]]:
        """What a pose estimator is asked for: objects in each image, and how many of each."""
        found = []
        for view, poses in self._poses.items():
            seen = [
                pose["obj_id"]
                for pose, info in zip(poses, self._infos[view], strict=True)
                if info["visib_fract"] >= TARGET_VISIBILITY
            ]
            for number in sorted(set(seen)):
                target = {"im_id": int(view), "inst_count": seen.count(number)}
                found.append({**target, "obj_id": number, "scene_id": scene})
        return found

    def _write(self, kind: str, name: str, content: bytes) -> None:
        (self._folder / kind / name).write_bytes(content)


def _camera(sample: Sample, depth_unit: float) -> dict[str, float]:
    intrinsics = sample.view.intrinsics
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    size = {"width": intrinsics.width, "height": intrinsics.height}
    return {"cx": cx, "cy": cy, "fx": fx, "fy": fy, **size, "depth_scale": MM * depth_unit}


def _scene_camera(sample: Sample, depth_unit: float) -> dict[str, Any]:
    X_CW = inverse(sample.X_WS @ sample.view.X_SC)
    K = sample.view.intrinsics.K.reshape(-1).tolist()
    return {"cam_K": K, "depth_scale": MM * depth_unit, **_pose(X_CW, "w2c")}


def _pose(X: Array, frames: str) -> dict[str, list[float]]:
    """Rotation, row by row, and translation in millimetres."""
    return {
        f"cam_R_{frames}": X[:3, :3].reshape(-1).tolist(),
        f"cam_t_{frames}": (MM * X[:3, 3]).tolist(),
    }


def _info(label: InstanceLabel, visible: int, depth: NDArray[np.uint16]) -> dict[str, Any]:
    silhouette = label.silhouette_pixels
    return {
        "bbox_obj": _box(label.amodal_box if visible else None),
        "bbox_visib": _box(label.visible_box if visible else None),
        "px_count_all": silhouette,
        "px_count_valid": int((depth[label.amodal] > 0).sum()),
        "px_count_visib": visible,
        "visib_fract": visible / silhouette if silhouette else 0.0,
    }


def _box(box: Box | None) -> list[int]:
    """A box from its first pixel to its last."""
    return NO_BOX if box is None else [box[0], box[1], box[2] - 1, box[3] - 1]


def _mask(mask: NDArray[np.bool_]) -> bytes:
    return encode_png(np.where(mask, np.uint8(255), np.uint8(0)))


def _losses(sample: Sample) -> Iterator[str]:
    if sample.grasps is not None:
        yield "BOP has no grasps."
    if sample.images.normals is not None:
        yield "BOP has no images of normals."
    if sample.view.posture is not None:
        yield "BOP has no postures of an arm."


def _about(samples: Samples) -> str:
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
