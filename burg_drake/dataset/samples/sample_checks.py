"""What can be wrong with a sample whose files can all be read: values that contradict one another.

Each function gives pairs: the kind of the file that is at fault, and what is wrong with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Booleans, InvalidInputError, inverse, quoted, rotation_angle
from burg_drake.core.grasps import Outcome
from burg_drake.dataset.labels import Box, InstanceLabel, box_of_mask
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.samples.sample import Sample
from burg_drake.dataset.samples.sample_files import GRASPS, RECORD
from burg_drake.scene.document import SceneDocument

POSE_TOLERANCE = 1e-6
"""Of a pose from that which follows from scene and view [m], and in its rotation's numbers."""
VISIBILITY_TOLERANCE = 1e-6
NORMAL_TOLERANCE = 1e-3
"""Of a normal's length from 1."""
DIFFERENT = 2e-4
"""Share of pixels that may differ from freshly cast ones: on edges, with another version."""

Fault = tuple[str, str]


def label_faults(sample: Sample) -> Iterator[Fault]:
    """Labels against what is said of the instances."""
    labels = sample.images.labels
    if labels is None:
        return
    top = int(labels.max(initial=0))
    if top > len(sample.instances):
        yield "labels", f"label {top} has no instance; there are {len(sample.instances)} instances"
    counts = np.bincount(labels.ravel(), minlength=len(sample.instances) + 1)
    for one in sample.instances:
        count = int(counts[one.number]) if one.number < len(counts) else 0
        if count != one.visible_pixels:
            yield (
                "labels",
                f"{one.name!r} has {count} pixels, but its record says {one.visible_pixels}",
            )
        visible = labels == one.number
        box = box_of_mask(visible)
        if box != one.visible_box:
            yield (
                RECORD,
                f"visible_box of {one.name!r} is {one.visible_box}, but its labels have {box}",
            )
        outside = int(np.count_nonzero(visible & ~one.amodal))
        if outside:
            yield (
                RECORD,
                f"the amodal mask of {one.name!r} lacks {outside} of its {count} visible pixels",
            )


def silhouette_faults(sample: Sample) -> Iterator[Fault]:
    """Numbers of the instances against one another and their masks."""
    for i, one in enumerate(sample.instances, start=1):
        if one.number != i:
            yield RECORD, f"{one.name!r} has number {one.number}; expected {i}"
        yield from ((RECORD, f"{one.name!r}: {text}") for text in _contradictions(one))


def _contradictions(one: InstanceLabel) -> Iterator[str]:
    within, pixels = int(np.count_nonzero(one.amodal)), one.silhouette_pixels
    if within > pixels:
        yield f"silhouette_pixels is {pixels}, less than the {within} of the amodal mask"
    if one.visible_pixels > pixels:
        yield f"visible_pixels is {one.visible_pixels}, more than silhouette_pixels, {pixels}"
    share = one.visible_pixels / pixels if pixels else 0.0
    if abs(share - one.visibility) > VISIBILITY_TOLERANCE:
        yield f"visibility is {one.visibility:g}, but its pixels give {share:g}"
    box = box_of_mask(one.amodal)
    if (one.amodal_box is None) != (pixels == 0):
        yield f"amodal_box {one.amodal_box} does not fit silhouette_pixels {pixels}"
    elif box is not None and one.amodal_box is not None and not _contains(one.amodal_box, box):
        yield f"amodal_box {one.amodal_box} does not contain the mask, whose box is {box}"


def surface_faults(sample: Sample, depth_unit: float) -> Iterator[Fault]:
    """Depth and normals out of their ranges; sensors may measure what they like."""
    near, far = sample.view.depth_range
    depth, normals = sample.images.depth, sample.images.normals
    if depth is not None:
        measured = depth > 0.0
        wrong = measured & ((depth < near - depth_unit) | (depth > far + depth_unit))
        if wrong.any():
            yield (
                "depth",
                f"{np.count_nonzero(wrong)} pixels are outside the depth range {near:g} to {far:g}"
                " m of the view",
            )
    if normals is not None:
        length = np.linalg.norm(normals, axis=-1)
        wrong = (length > 0.0) & (np.abs(length - 1.0) > NORMAL_TOLERANCE)
        if wrong.any():
            yield "normals", f"{np.count_nonzero(wrong)} normals have a length other than 1"


def grasp_faults(sample: Sample) -> Iterator[Fault]:
    """Grasps with values that no grasp has."""
    if sample.grasps is None:
        return
    known = {"", *(outcome.value for outcome in Outcome)}
    unknown = sorted(set(sample.grasps.outcome.tolist()) - known)
    if unknown:
        yield GRASPS, f"outcome {quoted(unknown[0])} does not exist"
    if (sample.grasps.width < 0.0).any() or np.isinf(sample.grasps.width).any():
        yield GRASPS, "widths are negative or infinite"


def scene_faults(
    sample: Sample, scene: SceneDocument, X_SO: Mapping[str, Array]
) -> Iterator[Fault]:
    """Instances against the scene: which they are, their order, and their poses.

    Args:
        sample: its record.
        scene: of the data set.
        X_SO: (4, 4) poses of all instances by name.
    """
    placed = {one.name or one.object: one.object for one in (*scene.instances, *scene.background)}
    names = [one.name for one in sample.instances]
    if names != list(placed):
        yield RECORD, f"instances are {', '.join(names)}; the scene has {', '.join(placed)}"
    for one in sample.instances:
        if one.name not in placed:
            continue
        if one.object != placed[one.name]:
            yield (
                RECORD,
                f"{one.name!r} is object {one.object!r}; in the scene it is {placed[one.name]!r}",
            )
        X_CO = inverse(sample.view.X_SC) @ X_SO[one.name]
        if np.abs(one.X_CO - X_CO).max() > POSE_TOLERANCE:
            distance = 1e3 * float(np.linalg.norm(one.X_CO[:3, 3] - X_CO[:3, 3]))
            angle = float(np.rad2deg(rotation_angle(one.X_CO[:3, :3].T @ X_CO[:3, :3])))
            yield (
                RECORD,
                f"X_CO of {one.name!r} is {distance:.3g} mm and {angle:.3g} degrees from its pose"
                " in the scene",
            )


def drawing_faults(sample: Sample, drawn: Images, depth_unit: float) -> Iterator[Fault]:
    """Labels and depth against freshly drawn ones; what is None on either side is left aside."""
    labels, depth = sample.images.labels, sample.images.depth
    if labels is not None and drawn.labels is not None:
        yield from _different("labels", labels, drawn.labels != labels)
    if depth is not None and drawn.depth is not None:
        apart = np.abs(drawn.depth - depth) > depth_unit
        yield from _different("depth", depth, apart)


def _different(kind: str, image: NDArray[np.generic], differs: Booleans) -> Iterator[Fault]:
    if differs.shape != image.shape:
        raise InvalidInputError(
            f"{kind} rendered again has shape {differs.shape}, not {image.shape}"
        )
    count = int(np.count_nonzero(differs))
    if count > DIFFERENT * differs.size:
        y, x = np.argwhere(differs)[0]
        yield (
            kind,
            f"{count} pixels differ when rendered again, the first in column {x} of row {y}",
        )


def _contains(outer: Box, inner: Box) -> bool:
    return all(
        outer[i] <= inner[i] and inner[i] + inner[i + 2] <= outer[i] + outer[i + 2] for i in (0, 1)
    )
