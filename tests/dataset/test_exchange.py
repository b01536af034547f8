"""What no format can be made of, and where none can be written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError, UnknownNameError
from burg_drake.dataset import write_bop, write_coco, write_graspnet, write_webdataset
from tests.dataset.polyhedra import CAMERA, InMemory, zoomed


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


@pytest.mark.parametrize(
    ("write", "changed", "message"),
    [
        (write_bop, bent, "camera sphere of sample 000003_001 has lens distortion, which BOP"),
        (write_graspnet, bent, "has lens distortion, which GraspNet cannot"),
        (write_bop, lambda d: without(d, labels=None), "000003_000 has no labels image, which BOP"),
        (write_coco, lambda d: without(d, color=None), "has no color image, which COCO needs"),
        (write_bop, deep, "000003_000 has depths up to 7.* m, .* give a larger unit"),
        (write_bop, shuffled, "samples of scene 3 are not next to"),
        (write_graspnet, zoomed, "000003_001 has other intrinsics"),
        (write_graspnet, lambda d: d, "scene 5 has object gem twice"),
        (write_coco, lambda d: replace(d, objects=("gem",)), "object 'box' of sample 000003_000"),
        (lambda d, f: write_bop(d, f, sensor_depth=True), lambda d: d, "no depth of a simulated"),
        (lambda d, f: write_bop(d, f, depth_unit=0.0), lambda d: d, "it must be above 0"),
        (lambda d, f: write_webdataset(d, f, shard_size=0), lambda d: d, "shard size is 0"),
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
    with pytest.raises(InvalidInputError, match="is not empty; choose another folder"):
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
