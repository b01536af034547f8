"""Exports as COCO: images, and one JSON file of all instances."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.dataset.export_common import (
    Samples,
    encode_color_image,
    new_folder,
    object_index,
    required_image,
)
from burg_drake.dataset.sample import Sample
from burg_drake.dataset.sample_encoding import encode_mask


def write_coco(
    samples: Samples, folder: str | Path, *, images: Literal["jpg", "png"] = "jpg"
) -> tuple[str, ...]:
    """Writes a data set as images and `instances.json`.

    Category ids are positions in `samples.objects`, from 1. Instances that are not visible have no
    annotation; every image is listed.

    Args:
        samples: data set with colour and labels.
        folder: new or empty folder.
        images: format of colour images.

    Returns:
        Data that COCO cannot represent, one sentence each.

    Raises:
        InvalidInputError: a sample lacks an image, or the folder is not empty or cannot be written.
        UnknownNameError: an object is not in the list.
    """
    listed: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    with new_folder(folder) as fresh:
        (fresh / "images").mkdir()
        for number, sample in enumerate(samples, start=1):
            color = required_image(sample, "COCO", "color")
            labels = required_image(sample, "COCO", "labels")
            file = f"{sample.key}.{images}"
            data = encode_color_image(color, f".{images}")
            (fresh / "images" / file).write_bytes(data)
            height, width = color.shape[:2]
            size = {"width": width, "height": height}
            listed.append({"id": number, "file_name": file, **size, "scene": sample.scene})
            for annotation in _instance_annotations(samples.objects, sample, labels):
                identity = {"id": len(annotations) + 1, "image_id": number}
                annotations.append({**identity, **annotation})
        content = {
            "info": {"description": samples.name},
            "licenses": [],
            "images": listed,
            "annotations": annotations,
            "categories": [
                {"id": k, "name": name, "supercategory": "object"}
                for k, name in enumerate(samples.objects, start=1)
            ],
        }
        (fresh / "instances.json").write_text(json.dumps(content), encoding="utf-8")
    return ("COCO has instances in colour images alone: no depth, poses, cameras or grasps.",)


def _instance_annotations(
    objects: tuple[str, ...], sample: Sample, labels: NDArray[np.uint16]
) -> list[dict[str, Any]]:
    """Annotations of a sample's visible instances, without ids."""
    found = []
    for label in sample.instances:
        mask = labels == label.number
        if label.visible_box is None or not mask.any():
            continue
        found.append(
            {
                "category_id": object_index(objects, sample, label) + 1,
                "bbox": list(label.visible_box),
                "area": int(mask.sum()),
                "segmentation": {"size": list(mask.shape), "counts": encode_mask(mask)},
                "iscrowd": 0,
            }
        )
    return found
