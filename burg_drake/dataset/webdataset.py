"""Exports as WebDataset: tar files with several files of the same name per sample."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.dataset.export_common import (
    Samples,
    depth_in_units,
    encode_color_image,
    new_folder,
    object_index,
)
from burg_drake.dataset.sample import InstanceLabel, LabelledGrasps, Sample
from burg_drake.dataset.sample_encoding import encode_mask, encode_png
from burg_drake.dataset.shards import TAR_END, tar_member


def write_webdataset(
    samples: Samples,
    folder: str | Path,
    *,
    shard_size: int = 1000,
    images: Literal["jpg", "png"] = "jpg",
    depth_unit: float = 1e-4,
) -> tuple[str, ...]:
    """Writes a data set as WebDataset shards `shard-000000.tar` and so on.

    The files of a sample are KEY.jpg (or .png), KEY.depth.png, KEY.sensor.png (depth of a simulated
    sensor), KEY.seg.png (instance numbers) and KEY.json. Missing images are left out.

    Args:
        samples: the data set.
        folder: new or empty folder.
        shard_size: samples per shard; the last shard has the remaining ones.
        images: format of colour images.
        depth_unit: unit of depth images [m].

    Returns:
        Data that the format cannot represent, one sentence each.

    Raises:
        InvalidInputError: a number is out of its range, a depth is too large, or the folder is not
            empty or cannot be written.
        UnknownNameError: an object is not in the list.
    """
    if shard_size < 1 or not depth_unit > 0.0:
        raise InvalidInputError(
            f"shard size is {shard_size} and unit of depth {depth_unit:g} m; the size must be at"
            " least 1, the unit above 0"
        )
    lost: set[str] = set()
    with new_folder(folder) as fresh:
        for shard, part in groupby(enumerate(samples), key=lambda one: one[0] // shard_size):
            path = fresh / f"shard-{shard:06d}.tar"
            with path.open("wb") as stream:
                for _, sample in part:
                    for name, content in _sample_members(
                        samples.objects, sample, images, depth_unit
                    ):
                        stream.write(tar_member(f"{sample.key}.{name}", content))
                    if sample.images.normals is not None:
                        lost.add("Images of normals are left out.")
                stream.write(TAR_END)
    return tuple(sorted(lost))


def _sample_members(
    objects: tuple[str, ...], sample: Sample, images: str, depth_unit: float
) -> Iterator[tuple[str, bytes]]:
    """Names, without the key, and contents of a sample's files."""
    seen = sample.images
    if seen.color is not None:
        yield images, encode_color_image(seen.color, f".{images}")
    if seen.depth is not None:
        yield "depth.png", encode_png(depth_in_units(seen.depth, depth_unit, sample.key))
    if seen.labels is not None:
        yield "seg.png", encode_png(seen.labels.astype(np.uint16))
    if sample.sensor_depth is not None:
        yield "sensor.png", encode_png(depth_in_units(sample.sensor_depth, depth_unit, sample.key))
    content = _sample_values(objects, sample, depth_unit)
    yield "json", json.dumps(content, sort_keys=True, allow_nan=False).encode()


def _sample_values(objects: tuple[str, ...], sample: Sample, depth_unit: float) -> dict[str, Any]:
    """Metadata of a sample. Lengths are in metres, matrices row by row, masks in COCO's encoding;
    None stands for an unknown value."""
    view, camera = sample.view, sample.view.intrinsics
    return {
        "scene": sample.scene,
        "view": sample.number,
        "camera": view.camera,
        "width": camera.width,
        "height": camera.height,
        "K": camera.K.tolist(),
        "distortion": list(camera.distortion),
        "X_SC": view.X_SC.tolist(),
        "X_WS": sample.X_WS.tolist(),
        "posture": None if view.posture is None else list(view.posture),
        "depth_range": list(view.depth_range),
        "depth_unit": depth_unit,
        "instances": [_instance_values(objects, sample, label) for label in sample.instances],
        "grasps": None if sample.grasps is None else _grasp_values(sample.grasps),
        "appearance": dict(sample.appearance),
    }


def _instance_values(
    objects: tuple[str, ...], sample: Sample, label: InstanceLabel
) -> dict[str, Any]:
    return vars(label) | {
        "object_id": object_index(objects, sample, label) + 1,
        "X_CO": label.X_CO.tolist(),
        "amodal": {"size": list(label.amodal.shape), "counts": encode_mask(label.amodal)},
    }


def _grasp_values(grasps: LabelledGrasps) -> dict[str, Any]:
    return {
        "X_CG": grasps.X_CG.tolist(),
        "width": _finite_or_none(grasps.width.tolist()),
        "number": grasps.number.tolist(),
        "outcome": grasps.outcome.tolist(),
        "margins": {
            name: _finite_or_none(values.tolist()) for name, values in grasps.margins.items()
        },
    }


def _finite_or_none(values: list[float]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values]
