"""What it takes to write and to read samples of a data set, by the kind of file.

    python benchmarks/dataset_io.py [--size 640x480] [--repeats R]

A sample is of six balls on a table, seen from the side, by closed forms; their colours are smooth
(`plain`), or have the grain of a photograph (`grainy`). Figures are CPU time of one thread, the
least of some repeats, and bytes of the file. Last comes what a whole sample takes: written into a
shard, read from it, and read for its depth alone.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.dataset import (
    Dataset,
    DatasetDocument,
    Images,
    InstanceLabel,
    LabelledGrasps,
    Sample,
    View,
    decode_grasps,
    decode_image_of,
    encode_grasps,
    encode_image,
    load_dataset,
    parse_record,
    record_text,
    save_dataset_document,
    write_index,
    write_shard,
)

BALLS = 6
GRASPS = 200
UNIT = 1e-4
NOISE = 1e-3
"""Standard deviation of the sensor's depth [m]."""
GRAIN = 4.0
"""Standard deviation of the colours [of 255]."""
SAMPLES = 10
PARTS = ("color", "depth", "labels", "normals", "sensor_depth")


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--size", default="640x480", help="of the images")
    parser.add_argument("--repeats", type=int, default=10)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    cv2.setNumThreads(1)
    for name, grain in (("plain", 0.0), ("grainy", GRAIN)):
        print(
            f"{name}, {width} x {height}\n  {'file':14s}{'encode':>10s}{'decode':>10s}{'size':>10s}"
        )
        measure(made(width, height, grain), arguments.repeats)


def measure(sample: Sample, repeats: int) -> None:
    """Prints the figures of a sample."""
    size = sample.view.intrinsics.width, sample.view.intrinsics.height
    totals = np.zeros(3)
    images = {**vars(sample.images), "sensor_depth": sample.sensor_depth}
    for name, image in images.items():
        data = encode_image(name, image, UNIT)
        totals += row(
            name,
            least(lambda n=name, i=image: encode_image(n, i, UNIT), repeats),  # type: ignore[misc]
            least(lambda n=name, d=data: decode_image_of(n, d, size, UNIT, n), repeats),  # type: ignore[misc]
            len(data),
        )
    assert sample.grasps is not None
    grasps, text = encode_grasps(sample.grasps), record_text(sample, PARTS)
    totals += row(
        "grasps",
        least(lambda: encode_grasps(sample.grasps), repeats),  # type: ignore[arg-type]
        least(lambda: decode_grasps(grasps, "grasps"), repeats),
        len(grasps),
    )
    totals += row(
        "json",
        least(lambda: record_text(sample, PARTS), repeats),
        least(lambda: parse_record(text, "json"), repeats),
        len(text),
    )
    row("all", *totals)
    with tempfile.TemporaryDirectory() as folder:
        dataset, seconds = written(Path(folder), sample)
        print(f"  written {seconds:.1f} ms a sample", end="; ")
        read = least(lambda: [dataset.read(i) for i in range(SAMPLES)], 3) / SAMPLES
        some = least(lambda: [dataset.read(i, ["depth"]) for i in range(SAMPLES)], 3) / SAMPLES
        print(f"read {read:.1f} ms; its depth alone {some:.1f} ms\n")


def row(name: str, encode: float, decode: float, size: float) -> tuple[float, float, float]:
    """Prints a line, and gives its figures back."""
    print(f"  {name:14s}{encode:7.2f} ms{decode:7.2f} ms{size / 1e3:7.0f} kB")
    return encode, decode, size


def least(task: Callable[[], object], repeats: int) -> float:
    """CPU time of a task [ms]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def written(folder: Path, sample: Sample) -> tuple[Dataset, float]:
    """A data set of one shard, and the CPU time that a sample of it took [ms]."""
    document = DatasetDocument(name="balls", objects=("ball",), library="household")
    save_dataset_document(document, folder / "dataset.yaml")
    samples = [replace(sample, number=i) for i in range(SAMPLES)]
    seconds = least(lambda: write_shard(folder / "shards/000000.tar", samples), 2)
    write_index(folder)
    return load_dataset(folder), seconds / SAMPLES


def made(width: int, height: int, grain: float) -> Sample:
    """Balls on a table, from 0.7 m away and 50 degrees above."""
    rng = np.random.default_rng(0)
    f = 0.95 * width
    center = (width - 1) / 2, (height - 1) / 2
    rows, columns = np.mgrid[:height, :width]
    rays = np.stack([(columns - center[0]) / f, (rows - center[1]) / f, np.ones(rows.shape)], -1)
    up = np.array([0.0, -np.sin(np.deg2rad(50)), -np.cos(np.deg2rad(50))])
    depth = np.minimum(-0.55 / np.minimum(rays @ up, -1e-9), 4.9)
    normals = np.broadcast_to(up, rays.shape).copy()
    labels = np.zeros(rows.shape, np.uint16)
    instances = []
    for number in range(1, BALLS + 1):
        radius = rng.uniform(0.03, 0.06)
        p = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.1), 0.7])
        along, square = rays @ p, (rays**2).sum(-1)
        root = along**2 - square * (p @ p - radius**2)
        t = (along - np.sqrt(np.maximum(root, 0.0))) / square
        hit = root > 0.0
        nearer = hit & (t < depth)
        depth[nearer], labels[nearer] = t[nearer], number
        normals[nearer] = ((rays * t[..., None] - p) / radius)[nearer]
        X_CO = np.eye(4)
        X_CO[:3, 3] = p
        instances.append((number, X_CO, hit))
    shade = np.clip(-normals @ np.array([0.3, -0.4, -0.85]), -1.0, 0.0) * -1.0
    tints = rng.uniform(60, 255, (BALLS + 1, 3))
    color = tints[labels] * (0.3 + 0.7 * shade[..., None]) + grain * rng.normal(size=rays.shape)
    measured = np.where(depth < 2.0, depth + NOISE * rng.normal(size=depth.shape), 0.0)
    return Sample(
        scene=0,
        number=0,
        view=View(
            camera="sphere",
            intrinsics=Intrinsics(width=width, height=height, focal=(f, f), center=center),
            X_SC=np.eye(4),
        ),
        X_WS=np.eye(4),
        images=Images(
            np.clip(color, 0, 255).astype(np.uint8),
            depth.astype(np.float32),
            labels,
            normals.astype(np.float32),
        ),
        sensor_depth=measured.astype(np.float32),
        instances=tuple(label(labels, *one) for one in instances),
        grasps=LabelledGrasps(
            X_CG=np.tile(np.eye(4), (GRASPS, 1, 1))
            + np.pad(rng.normal(size=(GRASPS, 3, 1)), ((0, 0), (0, 1), (3, 0))),
            width=rng.uniform(0, 0.08, GRASPS),
            number=rng.integers(1, BALLS + 1, GRASPS).astype(np.uint16),
            outcome=rng.choice(["lifted", "collision_table", ""], GRASPS),
            margins={"clearance_m": rng.normal(size=GRASPS)},
        ),
        appearance=json.loads('{"lights": [1.5, 2.5]}'),
    )


def label(labels: np.ndarray, number: int, X_CO: np.ndarray, mask: np.ndarray) -> InstanceLabel:
    """What is known of a ball; its boxes are left out."""
    visible, silhouette = int((labels == number).sum()), int(mask.sum())
    return InstanceLabel(
        name=f"ball_{number}",
        object="ball",
        number=number,
        X_CO=X_CO,
        visible_pixels=visible,
        silhouette_pixels=silhouette,
        visibility=visible / max(silhouette, 1),
        visible_box=(0, 0, 1, 1),
        amodal_box=(0, 0, 1, 1),
        amodal=mask,
    )


if __name__ == "__main__":
    main()
