"""The check of a data set finds what was done to it on purpose, and nothing in a sound one."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.dataset import (
    DatasetFinding,
    Images,
    Sample,
    check_dataset,
    encode_image,
    encode_sample,
    write_index,
)
from tests.dataset import drawn_samples as drawn

SHARD = "shards/000012.tar"
Files = dict[str, bytes]


def said(folder: Path, redraw: Any = None) -> list[str]:
    """Findings as texts."""
    return [str(one) for one in check_dataset(folder, redraw)]


def changed(folder: Path, change: Callable[[Files], object]) -> Path:
    """A data set of two scenes, the files in whose first shard were changed, with a new index."""
    drawn.write(folder)
    with tarfile.open(folder / SHARD) as archive:
        files = {one.name: archive.extractfile(one).read() for one in archive}  # type: ignore[union-attr]
    change(files)
    with tarfile.open(folder / SHARD, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    write_index(folder)
    return folder


def record(change: Callable[[Any], object]) -> Callable[[Files], object]:
    """Changes the record of the second sample."""

    def apply(files: Files) -> None:
        values = json.loads(files["000012_001.json"])
        change(values)
        files["000012_001.json"] = json.dumps(values).encode()

    return apply


def other_sample(change: Callable[[Sample], Sample]) -> Callable[[Files], object]:
    """Puts files of a changed sample in place of the second one."""
    return lambda files: files.update(encode_sample(change(drawn.sample(1, 12))))


def unknown_outcome(sample: Sample) -> Sample:
    """Says of a grasp what none is."""
    assert sample.grasps is not None
    outcome = np.array(["lifted", "flew", ""])
    return replace(sample, grasps=replace(sample.grasps, outcome=outcome))


def short_normals(sample: Sample) -> Sample:
    """Halves the normals."""
    assert sample.images.normals is not None
    halves = (sample.images.normals * 0.5).astype(np.float32)
    return replace(sample, images=replace(sample.images, normals=halves))


def swap_poses(values: Any) -> None:
    """The mug's for the bottle's."""
    one, other = values["instances"][:2]
    one["X_CO"], other["X_CO"] = other["X_CO"], one["X_CO"]


def swap_instances(values: Any) -> None:
    """The second for the first."""
    one, other = values["instances"][:2]
    values["instances"][:2] = other, one


def truncated(files: Files) -> None:
    """Takes the end of an image away."""
    files["000012_001.color.png"] = files["000012_001.color.png"][:-100]


def of_another_size(files: Files) -> None:
    """Puts an image of another sample in place of one."""
    small = np.ones((10, 12, 3), np.uint8)
    files["000012_001.color.png"] = encode_image("color", small, 1e-4)


def doubled(files: Files) -> None:
    """The first sample once more, as the third."""
    for name in [name for name in files if name.startswith("000012_000")]:
        files[name.replace("_000", "_002")] = files[name]


def apart(files: Files) -> None:
    """Moves a file of the first sample behind the second."""
    files["000012_000.depth.png"] = files.pop("000012_000.depth.png")


def edit(key: str, value: Any) -> Callable[[Files], object]:
    """Sets a value of the first instance of the second sample."""
    return record(lambda values: values["instances"][0].update({key: value}))


def test_a_sound_data_set_has_no_findings(tmp_path: Path) -> None:
    drawn.write(tmp_path)
    assert said(tmp_path) == said(tmp_path, drawn.draw) == []


@pytest.mark.parametrize(
    ("change", "file", "message"),
    [
        (truncated, "color.png", "is truncated"),
        (of_another_size, "color.png", "has 12 x 10 pixels, but its view has 64 x 48"),
        (lambda files: files.pop("000012_001.labels.png"), "labels.png", "is missing"),
        (lambda files: files.pop("000012_001.json"), "json", "is missing"),
        (other_sample(unknown_outcome), "grasps.npz", "outcome 'flew' does not exist"),
        (other_sample(short_normals), "normals.png", "normals have a length other than 1"),
        (record(lambda v: v["instances"][0].pop("amodal")), "json", "key 'amodal' is missing"),
        (record(lambda v: v["files"].remove("depth")), "depth.png", "it is not in the record"),
        (record(swap_poses), "json", "X_CO of 'mug' is 165 mm and 120 degrees from"),
        (record(swap_instances), "json", "instances are bottle, mug, box"),
        (edit("object", "jug"), "json", "'mug' is object 'jug'; in the scene it is 'mug'"),
        (edit("visible_pixels", 7), "labels.png", "'mug' has"),
        (
            edit("visible_box", [1, 2, 3, 4]),
            "json",
            "visible_box of 'mug' is (1, 2, 3, 4), but its",
        ),
        (edit("amodal", "PP3"), "json", "amodal mask of 'mug' lacks"),
        (edit("amodal_box", None), "json", "amodal_box None does not fit silhouette_pixels"),
        (edit("amodal_box", [0, 0, 2, 2]), "json", "does not contain the mask"),
        (edit("visibility", 0.25), "json", "visibility is 0.25, but"),
        (edit("silhouette_pixels", 1), "json", "silhouette_pixels is 1, less than the"),
        (edit("visibility", -0.1), "json", "visibility is -0.1; it must be 0 to 1"),
        (
            record(lambda v: v["view"].update(depth_range=[0.1, 0.8])),
            "depth.png",
            "are outside the depth range 0.1 to 0.8 m",
        ),
    ],
)
def test_a_broken_sample_is_found(
    tmp_path: Path, change: Callable[[Files], object], file: str, message: str
) -> None:
    found = check_dataset(changed(tmp_path, change))
    assert {one.sample for one in found} == {"000012_001"}
    texts = [one.message for one in found if one.file == f"{SHARD}: 000012_001.{file}"]
    assert any(message in text for text in texts), found


def test_doubled_lost_and_foreign_files_are_found(tmp_path: Path) -> None:
    assert any(
        f"{SHARD}: 000012_002.json: belongs to sample 000012_000" == text
        for text in said(changed(tmp_path / "doubled", doubled))
    )
    assert said(changed(tmp_path / "apart", apart)) == [
        f"{SHARD}: the files of 000012_000 are not next to each other, but in 2 places"
    ]
    foreign = changed(tmp_path / "foreign", lambda files: files.update({"../000012_000.json": b""}))
    assert said(foreign) == [f"{SHARD}: ../000012_000.json: it belongs to no sample"]
    lost = drawn.write(tmp_path / "lost")
    (lost / SHARD).unlink()
    assert said(lost) == [
        "scenes/000012.yaml: the scene has no shard",
        f"{SHARD}: the shard is missing",
    ]
    (lost / "scenes/000012.yaml").unlink()
    (lost / SHARD).write_bytes((lost / "shards/000013.tar").read_bytes())
    texts = said(lost)
    assert f"{SHARD}: 000013_000.json: it belongs to no sample" in texts
    assert f"{SHARD}: it has 0 samples, but the index says 2" in texts
    assert any(text.startswith("scenes/000012.yaml: cannot read") for text in texts)


def test_a_flipped_byte_is_found_wherever_it_is(tmp_path: Path) -> None:
    drawn.write(tmp_path)
    data = (tmp_path / SHARD).read_bytes()
    places = [0, data.index(b"0.8"), data.index(b"IDAT") + 50, data.index(b"X_CG") + 200]
    for place in [*places, len(data) - 1]:
        flipped = bytearray(data)
        flipped[place] ^= 1
        (tmp_path / SHARD).write_bytes(flipped)
        assert any(f"{SHARD}: it was changed: its MD5 is " in text for text in said(tmp_path))
        assert (len(said(tmp_path)) > 1) == (place in places)  # it is read in all but the end


def test_an_unlisted_shard_and_a_broken_document_are_found(tmp_path: Path) -> None:
    drawn.write(tmp_path, [12])
    index = (tmp_path / "index.json").read_bytes()
    drawn.write(tmp_path, [12, 13])
    (tmp_path / "index.json").write_bytes(index)
    assert said(tmp_path) == ["shards/000013.tar: it is not in the index"]
    (tmp_path / "dataset.yaml").write_text("version: 7")
    assert "version 1" in said(tmp_path)[0]


def test_what_is_drawn_anew_tells_a_scene_that_was_swapped(tmp_path: Path) -> None:
    def consistent(files: Files) -> None:
        """Gives the poses of mug and bottle to each other; the scene gets them, too."""
        for name in [name for name in files if name.endswith("json")]:
            values = json.loads(files[name])
            swap_poses(values)
            files[name] = json.dumps(values).encode()

    changed(tmp_path, consistent)
    scene = tmp_path / "scenes/000012.yaml"
    lines = scene.read_text().splitlines()
    poses = [i for i, line in enumerate(lines) if "translation" in line or "rpy_deg" in line]
    mug, bottle = poses[:2], poses[2:4]
    for a, b in zip(mug, bottle, strict=True):
        lines[a], lines[b] = lines[b], lines[a]
    scene.write_text("\n".join(lines))
    assert said(tmp_path) == []
    found = check_dataset(tmp_path, drawn.draw)
    assert {one.file for one in found if "differ when rendered again" in one.message} >= {
        f"{SHARD}: 000012_000.labels.png",
        f"{SHARD}: 000012_001.labels.png",
    }
    assert not any("000013" in one.file for one in found)


def test_a_scene_that_cannot_be_drawn_is_one_finding(tmp_path: Path) -> None:
    def fails(scene: Any, sample: Any) -> Images:
        if sample.key == "000012_001":
            raise InvalidInputError("object 'mug' has no visual mesh")
        return Images()

    message = "it cannot be rendered again: object 'mug' has no visual mesh"
    assert check_dataset(drawn.write(tmp_path), fails) == [
        DatasetFinding("000012_001", f"{SHARD}: 000012_001.json", message)
    ]
