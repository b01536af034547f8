"""Exports in the layout of GraspNet-1Billion that graspnetAPI reads."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from burg_drake.core import (
    Array,
    Booleans,
    GraspSet,
    InvalidInputError,
    Outcome,
    inverse,
    quaternion_from_rotation,
)
from burg_drake.dataset.export_common import (
    Samples,
    depth_in_units,
    describe_lost_depth,
    exported_depth,
    group_by_scene,
    new_folder,
    object_index,
    require_pinhole,
    required_image,
)
from burg_drake.dataset.grasp_labels import grasp_rectangles
from burg_drake.dataset.model_files import visual_model, write_ply
from burg_drake.dataset.sample import LabelledGrasps, Sample
from burg_drake.dataset.sample_encoding import encode_png
from burg_drake.formats import write_grasp_file

GRASPNET_DEPTH_UNIT = 1e-3
"""Metres per unit of a depth image."""


def grasp_scores(grasps: LabelledGrasps) -> Array:
    """Scores in [0, 1] for graspnetAPI; higher is better.

    In GraspNet the score is 1.1 minus the friction coefficient that a grasp needs, and grasps from
    0.7 on are loaded by default. Here a grasp that lifts its object gets 1, or 0.7 if it disturbed
    other objects or the object turned in the hand; minus up to 0.3 in proportion to the object's
    slip in the hand (`slip`, up to 20 mm). A grasp that was tried and failed gets 0.

    Returns:
        (N,) scores; nan for grasps that were not judged, that are reachable and were not tried, or
        whose simulation failed.
    """
    unknown = ("", Outcome.REACHABLE.value, Outcome.SIMULATION_FAILED.value)
    slip = np.nan_to_num(grasps.margins.get("slip", np.zeros(len(grasps))), nan=0.0)
    cost = 0.3 * np.clip(slip / 0.02, 0.0, 1.0)
    scores = np.zeros(len(grasps))
    scores[np.isin(grasps.outcome, unknown)] = np.nan
    for outcome, best in (
        (Outcome.LIFTED, 1.0),
        (Outcome.LIFTED_DISTURBED, 0.7),
        (Outcome.LIFTED_TURNED, 0.7),
    ):
        held = grasps.outcome == outcome.value
        scores[held] = best - cost[held]
    return scores


def write_graspnet(
    samples: Samples,
    folder: str | Path,
    *,
    camera: str | None = "realsense",
    opening: float | None = None,
    sensor_depth: bool = False,
) -> tuple[str, ...]:
    """Writes a data set in the layout of GraspNet-1Billion.

    Object ids are positions in `samples.objects`, from 0; views are counted from 0 in each scene.

    Args:
        samples: data set with colour, depth and labels.
        folder: new or empty folder.
        camera: name of the folder of all views; None for one folder per camera, named after it.
        opening: distance between the pads for grasp rectangles [m]; each grasp's own width if None,
            without rectangles for unknown widths.
        sensor_depth: whether to write the simulated sensor's depth instead of the exact one.

    Returns:
        Data that the layout cannot represent, one sentence each.

    Raises:
        InvalidInputError: a sample lacks an image, a lens has distortion, a depth is too large, a
            scene has an object twice, views of one folder have different intrinsics, or the folder
            is not empty or cannot be written.
        UnknownNameError: an object is not in the list or the library.
        MeshError: a mesh of the library is damaged.
    """
    train_scenes = 100  # Scenes of the split `train`, all of which graspnetAPI reads at the start.
    lost = {
        "GraspNet has no amodal masks and no visibilities.",
        "graspnetAPI's loadGrasp of 6D grasps and its evaluation do not work: grasp_label and"
        " collision_label have 300 directions, 12 angles and 4 depths at each of thousands of"
        " points, but only some were judged; these are in the folder grasps of each camera.",
        "graspnetAPI's evaluation also needs models/*/textured.obj and textured.sdf, and its check"
        " of completeness rs_wrt_kn.npy of two cameras; none of them is written.",
    }
    numbers: set[int] = set()
    with new_folder(folder) as fresh:
        for k, name in enumerate(samples.objects):
            place = fresh / "models" / f"{k:03d}"
            place.mkdir(parents=True)
            write_ply(visual_model(samples.library, name), place / "nontextured.ply", unit=1.0)
        for number, views in group_by_scene(samples):
            scene = fresh / "scenes" / f"scene_{number:04d}"
            numbers.add(number)
            camera_folders: dict[str, _CameraFolder] = {}
            for sample in views:
                name = camera or sample.view.camera
                if name not in camera_folders:
                    camera_folders[name] = _CameraFolder(samples.objects, scene, name, opening)
                camera_folders[name].add(
                    sample, exported_depth(sample, "GraspNet", sensor=sensor_depth)
                )
                lost |= describe_lost_depth(sample, "GraspNet", sensor=sensor_depth)
            for camera_folder in camera_folders.values():
                camera_folder.finish()
    if not numbers >= set(range(train_scenes)):
        lost.add(
            "graspnetAPI opens a data set only if a split is complete; 'train' has scenes 0 to"
            f" {train_scenes - 1}, and here are {len(numbers)} scenes: read the files without it."
        )
    return tuple(sorted(lost))


class _CameraFolder:
    """The folder of a camera in a scene while it is written."""

    def __init__(
        self, objects: tuple[str, ...], scene: Path, name: str, opening: float | None
    ) -> None:
        self._objects, self._scene, self._folder = objects, scene, scene / name
        self._opening = opening
        self._X_SC: list[Array] = []
        self._K: Array | None = None
        self._ids: list[int] = []
        for kind in ("rgb", "depth", "label", "meta", "annotations"):
            (self._folder / kind).mkdir(parents=True)

    def add(self, sample: Sample, depth: NDArray[np.float32]) -> None:
        """Writes all files of a view."""
        require_pinhole(sample, "GraspNet")
        color = required_image(sample, "GraspNet", "color")
        labels = required_image(sample, "GraspNet", "labels")
        K = sample.view.intrinsics.K
        if self._K is not None and not np.array_equal(K, self._K):
            raise InvalidInputError(
                f"sample {sample.key} has other intrinsics than the views before it, but GraspNet"
                " has one camera matrix for all views of a camera; write a folder for each camera"
                " of the scene (camera=None), or generate views with the same intrinsics"
            )
        self._K, self._ids = K, self._object_ids(sample)
        ids = self._ids
        name = f"{len(self._X_SC):04d}"
        self._X_SC.append(sample.view.X_SC)
        self._write("rgb", f"{name}.png", encode_png(color))
        numbers = depth_in_units(depth, GRASPNET_DEPTH_UNIT, sample.key)
        self._write("depth", f"{name}.png", encode_png(numbers))
        self._write("label", f"{name}.png", encode_png(self._object_labels(sample, labels, ids)))
        self._write("meta", f"{name}.mat", _meta_mat_file(sample, ids))
        self._write("annotations", f"{name}.xml", _pose_annotations(sample, ids))
        if sample.grasps is not None:
            self._write_grasps(sample, sample.grasps, ids, name)

    def finish(self) -> None:
        """Writes the files that all views share."""
        assert self._K is not None
        X_SC = np.stack(self._X_SC)
        np.save(self._folder / "camera_poses.npy", inverse(X_SC[0]) @ X_SC)
        np.save(self._folder / "cam0_wrt_table.npy", X_SC[0])
        np.save(self._folder / "camK.npy", self._K)
        ids = "".join(f"{k}\n" for k in self._ids)
        (self._scene / "object_id_list.txt").write_text(ids, encoding="ascii")

    def _object_ids(self, sample: Sample) -> list[int]:
        """Object ids of the instances."""
        ids = [object_index(self._objects, sample, label) for label in sample.instances]
        for k, number in enumerate(ids):
            if number in ids[:k]:
                raise InvalidInputError(
                    f"scene {sample.scene} has object {self._objects[number]} twice, but GraspNet"
                    " labels objects, not instances; write BOP or COCO instead"
                )
        return ids

    def _object_labels(
        self, sample: Sample, labels: NDArray[np.uint16], ids: list[int]
    ) -> NDArray[Any]:
        """(H, W) object ids from 1; 0 for all else."""
        shown = np.zeros(int(labels.max(initial=0)) + 1, dtype=np.uint16)
        for label, number in zip(sample.instances, ids, strict=True):
            if label.number < len(shown):
                shown[label.number] = number + 1
        small = len(self._objects) <= np.iinfo(np.uint8).max
        return np.asarray(shown[labels], dtype=np.uint8 if small else np.uint16)

    def _write_grasps(
        self, sample: Sample, grasps: LabelledGrasps, ids: list[int], name: str
    ) -> None:
        by_number = {label.number: k for label, k in zip(sample.instances, ids, strict=True)}
        objects = np.array([by_number[int(n)] for n in grasps.number], dtype=np.int64)
        scores = grasp_scores(grasps)
        known = np.isfinite(scores)
        for kind in ("grasps", "rect"):
            (self._folder / kind).mkdir(exist_ok=True)
        chosen = GraspSet.create(
            grasps.X_CG[known],
            object=np.array(self._objects)[objects[known]],
            width=grasps.width[known],
            score=scores[known],
            columns={"object_id": objects[known]},
        )
        write_grasp_file(chosen, self._folder / "grasps" / f"{name}.npy", "graspnet")
        rows = self._rectangles(sample, grasps, np.column_stack([scores, objects]))
        np.save(self._folder / "rect" / f"{name}.npy", rows.astype(np.float32))

    def _rectangles(self, sample: Sample, grasps: LabelledGrasps, rated: Array) -> Array:
        """(K, 7) rows of `rect` of grasps with known score and opening; `rated` has scores and
        object ids."""
        known = np.isfinite(rated[:, 0])
        if self._opening is None:
            known &= np.isfinite(grasps.width)
        found = grasp_rectangles(
            _select_grasps(grasps, known), sample.view.intrinsics, opening=self._opening
        )
        along = np.stack([np.cos(found.angle), np.sin(found.angle)], axis=-1)
        edge = found.center + 0.5 * found.opening[:, None] * along
        return np.column_stack([found.center, edge, found.height, rated[known][found.grasp]])

    def _write(self, kind: str, name: str, content: bytes) -> None:
        (self._folder / kind / name).write_bytes(content)


def _select_grasps(grasps: LabelledGrasps, kept: Booleans) -> LabelledGrasps:
    return LabelledGrasps(
        X_CG=grasps.X_CG[kept],
        width=grasps.width[kept],
        number=grasps.number[kept],
        outcome=grasps.outcome[kept],
        margins={name: values[kept] for name, values in grasps.margins.items()},
    )


def _meta_mat_file(sample: Sample, ids: list[int]) -> bytes:
    """Reproducible bytes of a MAT file."""
    header_size = 116  # Bytes of text at the start of a MAT file, in which scipy writes the time.
    poses = np.zeros((3, 4, len(ids)))
    for k, label in enumerate(sample.instances):
        poses[:, :, k] = label.X_CO[:3]
    content = {
        "cls_indexes": np.array([ids], dtype=np.int32) + 1,
        "factor_depth": np.array([[1.0 / GRASPNET_DEPTH_UNIT]]),
        "intrinsic_matrix": sample.view.intrinsics.K,
        "poses": poses,
    }
    stream = io.BytesIO()
    savemat(stream, content)
    return b"MATLAB 5.0 MAT-file".ljust(header_size) + stream.getvalue()[header_size:]


def _pose_annotations(sample: Sample, ids: list[int]) -> bytes:
    """Object poses as XML, in the camera's frame, which the format calls world."""
    top = ElementTree.Element("scene")
    for label, number in zip(sample.instances, ids, strict=True):
        entry = ElementTree.SubElement(top, "obj")
        quaternion = quaternion_from_rotation(label.X_CO[:3, :3])
        for tag, text in (
            ("obj_id", str(number)),
            ("obj_name", label.object),
            ("obj_path", f"models/{number:03d}"),
            ("pos_in_world", _format_values(label.X_CO[:3, 3])),
            ("ori_in_world", _format_values(quaternion)),
        ):
            ElementTree.SubElement(entry, tag).text = text
    ElementTree.indent(top, "    ")
    return bytes(ElementTree.tostring(top, encoding="utf-8", xml_declaration=True)) + b"\n"


def _format_values(values: Array) -> str:
    return " ".join(f"{value:.9f}" for value in values)
