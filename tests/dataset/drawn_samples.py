"""Samples of the built-in scene of six objects, each of which is drawn as a disc that faces the
camera: labels, depth, boxes and masks by closed forms, and no code of the package."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.dataset import (
    DatasetDocument,
    DatasetWriter,
    Images,
    InstanceLabel,
    LabelledGrasps,
    Sample,
    View,
)
from burg_drake.scene import Scene, load_scene

WIDTH, HEIGHT = 64, 48
RADIUS = 0.05
"""Of the discs [m]."""
TABLE = 0.90007
"""Depth of what is no object [m]."""
DOCUMENT = DatasetDocument(
    name="drawn",
    objects=("mug", "bottle", "box", "screwdriver", "bowl", "banana"),
    library="household",
    versions={"burg_drake": "1", "drake": "2"},
    recipe={"views": {"count": 3, "far": 1.5e-05}, "noise": None, "names": ["a", "2"], "on": True},
)


@functools.cache
def scene() -> Scene:
    """The scene of all samples."""
    return load_scene("tabletop_six")


def view(number: int = 0) -> View:
    """From above, ever more to the right, and with a lens that is none."""
    X_SC = np.eye(4)
    X_SC[:3, :3] = np.diag([1.0, -1.0, -1.0])
    X_SC[:3, 3] = 0.3 + 0.013 * number, 0.2, 0.8
    intrinsics = Intrinsics(
        camera="drawn", width=WIDTH, height=HEIGHT, focal=(61.3, 60.7), center=(31.2, 24.1)
    )
    return View(
        camera="sphere",
        intrinsics=replace(intrinsics, distortion=(1e-9, 0.0, 1e-17, 0.0)),
        X_SC=X_SC,
        depth_range=(0.1, 2.0),
        posture=(0.1, 0.2, 1 / 3),
    )


def draw(scene: Scene, sample: Sample) -> Images:
    """Labels and depth of a view."""
    labels, depth, _ = _drawn(scene, sample.view)
    return Images(labels=labels, depth=depth)


def sample(number: int = 0, scene_number: int = 12, **changes: Any) -> Sample:
    """A view of the scene with all that a sample can have."""
    rng = np.random.default_rng(number)
    labels, depth, instances = _drawn(scene(), view(number))
    normals = rng.normal(size=(HEIGHT, WIDTH, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[:5] = 0.0
    color = rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    X_CG = np.array([one.X_CO for one in instances[:3]])
    made = Sample(
        scene=scene_number,
        number=number,
        view=view(number),
        X_WS=np.eye(4),
        images=Images(color, depth, labels, normals),
        sensor_depth=np.where(depth > 0.7, depth, 0.0).astype(np.float32),
        instances=instances,
        grasps=LabelledGrasps(
            X_CG=X_CG,
            width=np.array([0.04, np.nan, 0.01]),
            number=np.array([1, 2, 2], np.uint16),
            outcome=np.array(["lifted", "", "no_ik"]),
            margins={"clearance_m": np.array([0.1, np.nan, -1 / 3])},
        ),
        appearance={"lights": [1, 2.5, None], "table": {"texture": "wood", "dark": False}},
    )
    return replace(made, **changes)


def write(folder: Path, scenes: Iterable[int] = (12, 13), views: int = 2) -> Path:
    """A whole data set."""
    with DatasetWriter(folder, DOCUMENT) as writer:
        for number in writer.missing(scenes):
            writer.add(number, scene(), [sample(i, number) for i in range(views)])
    return folder


def _drawn(scene: Scene, view: View) -> tuple[Any, Any, tuple[InstanceLabel, ...]]:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    labels = np.zeros((HEIGHT, WIDTH), np.uint16)
    depth = np.full((HEIGHT, WIDTH), TABLE, np.float32)
    found = []
    names = [*scene.instances, *scene.background]
    R, p = view.X_SC[:3, :3], view.X_SC[:3, 3]
    for number, name in enumerate(names, start=1):
        X_CO = np.eye(4)
        X_SO = scene.X_SO(name)
        X_CO[:3, :3], X_CO[:3, 3] = R.T @ X_SO[:3, :3], R.T @ (X_SO[:3, 3] - p)
        x, y, z = X_CO[:3, 3]
        (fx, fy), (cx, cy) = view.intrinsics.focal, view.intrinsics.center
        away = ((columns - cx) * z / fx - x) ** 2 + ((rows - cy) * z / fy - y) ** 2
        mask = away < RADIUS**2
        nearer = mask & (z < depth)
        labels[nearer], depth[nearer] = number, z
        found.append((name, number, X_CO, mask))
    return labels, depth, tuple(_label(scene, labels, *one) for one in found)


def _label(scene: Scene, labels: Any, name: str, number: int, X_CO: Any, mask: Any) -> Any:
    visible, silhouette = int((labels == number).sum()), int(mask.sum())
    return InstanceLabel(
        name=name,
        object=scene.instance(name).object,
        number=number,
        X_CO=X_CO,
        visible_pixels=visible,
        silhouette_pixels=silhouette,
        visibility=visible / silhouette if silhouette else 0.0,
        visible_box=_box(labels == number),
        amodal_box=_box(mask),
        amodal=mask,
    )


def _box(mask: Any) -> Any:
    if not mask.any():
        return None
    y, x = np.argwhere(mask).T.tolist()
    return min(x), min(y), max(x) - min(x) + 1, max(y) - min(y) + 1
