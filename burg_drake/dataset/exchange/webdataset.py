"""WebDataset: tar files of samples, each a few files of the same name, one after the other.

As described at github.com/webdataset/webdataset: the key of a sample is the name up to the first
dot, what follows says what it is. Tar files here are the same, byte for byte, whoever writes them
and when.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.dataset.exchange.folder import new_folder
from burg_drake.dataset.exchange.image_files import color_file, depth_numbers
from burg_drake.dataset.exchange.source import Samples, object_index
from burg_drake.dataset.labels import InstanceLabel, LabelledGrasps, encode_mask
from burg_drake.dataset.samples import TAR_END, Sample, encode_png, tar_member

DEPTH_UNIT = 1e-4
"""What 1 stands for in a depth image [m]."""
SHARD_SIZE = 1000
"""Samples in a shard."""


def write_webdataset(
    samples: Samples,
    folder: str | Path,
    *,
    shard_size: int = SHARD_SIZE,
    images: Literal["jpg", "png"] = "jpg",
    depth_unit: float = DEPTH_UNIT,
) -> tuple[str, ...]:
    """Writes `shard-000000.tar` and so on.

    Of a sample there are KEY.jpg (or .png), KEY.depth.png, KEY.sensor.png (depth of a simulated
    sensor), KEY.seg.png (numbers of instances) and KEY.json; an image that it lacks is left out.

    Args:
        samples: the data set.
        folder: new or empty.
        shard_size: samples in each; the last one has what is left.
        images: format of the colours.
        depth_unit: what 1 stands for in a depth image [m].

    Returns:
        What was left out, one sentence each.

    Raises:
        InvalidInputError: a number is out of its range, a depth is too large, or the folder has
            something in it or cannot be written.
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
                    for name, content in _files(samples.objects, sample, images, depth_unit):
                        stream.write(tar_member(f"{sample.key}.{name}", content))
                    if sample.images.normals is not None:
                        lost.add("Images of normals are left out.")
                stream.write(TAR_END)
    return tuple(sorted(lost))


def _files(
    objects: tuple[str, ...], sample: Sample, images: str, depth_unit: float
) -> Iterator[tuple[str, bytes]]:
    """Names without the key, and contents."""
    seen = sample.images
    if seen.color is not None:
        yield images, color_file(seen.color, f".{images}")
    if seen.depth is not None:
        yield "depth.png", encode_png(depth_numbers(seen.depth, depth_unit, sample.key))
    if seen.labels is not None:
        yield "seg.png", encode_png(seen.labels.astype(np.uint16))
    if sample.sensor_depth is not None:
        yield "sensor.png", encode_png(depth_numbers(sample.sensor_depth, depth_unit, sample.key))
    content = _description(objects, sample, depth_unit)
    yield "json", json.dumps(content, sort_keys=True, allow_nan=False).encode()


def _description(objects: tuple[str, ...], sample: Sample, depth_unit: float) -> dict[str, Any]:
    """What is known of a sample. Lengths are in metres, matrices row by row, masks as COCO has
    them; None stands for what is not known."""
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
        "instances": [_instance(objects, sample, label) for label in sample.instances],
        "grasps": None if sample.grasps is None else _grasps(sample.grasps),
        "appearance": dict(sample.appearance),
    }


def _instance(objects: tuple[str, ...], sample: Sample, label: InstanceLabel) -> dict[str, Any]:
    return {
        "name": label.name,
        "object": label.object,
        "object_id": object_index(objects, sample, label) + 1,
        "number": label.number,
        "X_CO": label.X_CO.tolist(),
        "visible_pixels": label.visible_pixels,
        "silhouette_pixels": label.silhouette_pixels,
        "visibility": label.visibility,
        "visible_box": label.visible_box,
        "amodal_box": label.amodal_box,
        "amodal": {"size": list(label.amodal.shape), "counts": encode_mask(label.amodal)},
    }


def _grasps(grasps: LabelledGrasps) -> dict[str, Any]:
    return {
        "X_CG": grasps.X_CG.tolist(),
        "width": _known(grasps.width.tolist()),
        "number": grasps.number.tolist(),
        "outcome": grasps.outcome.tolist(),
        "margins": {name: _known(values.tolist()) for name, values in grasps.margins.items()},
    }


def _known(values: list[float]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values]
