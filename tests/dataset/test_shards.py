"""Shards: what is written comes back, with other programs' eyes too; what is hostile is refused."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.dataset import Images, Sample, load_dataset, write_index, write_shard
from tests.dataset import drawn_samples as drawn

NAMES = ("json", "color.png", "depth.png", "labels.png", "normals.png", "sensor_depth.png")
TOLERANCES = {"depth": 0.5001e-4, "sensor_depth": 0.5001e-4, "normals": 0.5001 / 32767}
"""Half a unit, and the rounding of single precision."""


def differences(one: Any, other: Any, name: str = "") -> list[str]:
    """Fields of two values that are not the same, to the last bit but for `TOLERANCES`."""
    if is_dataclass(one):
        assert type(one) is type(other)
        pairs = [(f.name, getattr(one, f.name), getattr(other, f.name)) for f in fields(one)]
    elif isinstance(one, dict):
        assert one.keys() == other.keys()
        pairs = [(key, one[key], other[key]) for key in one]
    elif isinstance(one, tuple) and len(one) == len(other):
        pairs = [(f"{name}[{i}]", *both) for i, both in enumerate(zip(one, other, strict=True))]
    elif isinstance(one, np.ndarray):
        same = one.dtype.kind == other.dtype.kind and one.shape == other.shape
        if name in TOLERANCES:
            return [] if same and np.abs(one - other).max() <= TOLERANCES[name] else [name]
        equal = np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
        return [] if same and equal else [name]
    else:
        return [] if type(one) is type(other) and one == other else [name]
    return [found for key, a, b in pairs for found in differences(a, b, key)]


def packed(folder: Path, change: Callable[[dict[str, bytes]], object]) -> Path:
    """A data set of one scene with two samples, whose files have been changed."""
    drawn.write(folder, [12])
    shard = folder / "shards/000012.tar"
    with tarfile.open(shard) as archive:
        files = {one.name: archive.extractfile(one).read() for one in archive}  # type: ignore[union-attr]
    change(files)
    with tarfile.open(shard, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    write_index(folder)
    return folder


def test_every_field_comes_back(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path / "data"))
    assert [s.key for s in dataset] == ["000012_000", "000012_001", "000013_000", "000013_001"]
    for i, (scene, number) in enumerate([(12, 0), (12, 1), (13, 0), (13, 1)]):
        assert differences(drawn.sample(number, scene), dataset[i]) == []
    moved = drawn.sample(0)
    moved.instances[3].X_CO[0, 3] += 1e-16
    assert differences(moved, dataset[0]) == ["X_CO"]


def test_what_is_none_stays_none(tmp_path: Path) -> None:
    bare = replace(
        drawn.sample(), images=Images(), sensor_depth=None, grasps=None, appearance={}, instances=()
    )
    bare = replace(bare, view=replace(bare.view, posture=None))
    write_shard(tmp_path / "shards/000012.tar", [bare])
    drawn.write(tmp_path / "data", [])
    (tmp_path / "shards/000012.tar").rename(tmp_path / "data/shards/000012.tar")
    write_index(tmp_path / "data")
    assert differences(bare, load_dataset(tmp_path / "data")[0]) == []


def test_many_instances_have_labels_of_16_bits(tmp_path: Path) -> None:
    one = drawn.sample()
    labels = np.zeros((drawn.HEIGHT, drawn.WIDTH), np.uint16)
    labels[0, 0] = 300
    many = tuple(replace(one.instances[0], number=i + 1) for i in range(300))
    sample = replace(one, images=Images(labels=labels), instances=many)
    drawn.write(tmp_path, [])
    write_shard(tmp_path / "shards/000012.tar", [sample])
    write_index(tmp_path)
    assert load_dataset(tmp_path).read(0, "labels").images.labels.tolist() == labels.tolist()  # type: ignore[union-attr]


def test_the_same_samples_give_the_same_bytes(tmp_path: Path) -> None:
    paths = [tmp_path / name / "000012.tar" for name in "ab"]
    entries = [write_shard(path, (drawn.sample(i) for i in range(2))) for path in paths]
    one, other = (path.read_bytes() for path in paths)
    assert one == other and entries[0] == entries[1]
    assert entries[0].filesize == len(one) and entries[0].nsamples == 2
    assert entries[0].md5sum == hashlib.md5(one).hexdigest()
    appearance = dict(reversed(drawn.sample(0).appearance.items()))
    write_shard(paths[1], [drawn.sample(0, appearance=appearance), drawn.sample(1)])
    assert paths[1].read_bytes() == one
    write_shard(paths[1], [drawn.sample(0), drawn.sample(1, sensor_depth=None)])
    assert paths[1].read_bytes() != one


def test_other_programs_read_a_shard(tmp_path: Path) -> None:
    path, sample = tmp_path / "000012.tar", drawn.sample()
    write_shard(path, [sample, drawn.sample(1)])
    with tarfile.open(path) as archive:
        members = archive.getmembers()
        files = {one.name: archive.extractfile(one).read() for one in members}  # type: ignore[union-attr]
    expected = [f"000012_00{i}.{name}" for i in (0, 1) for name in (*NAMES, "grasps.npz")]
    assert list(files) == expected
    assert {(m.mtime, m.uid, m.gid, m.uname, m.mode) for m in members} == {(0, 0, 0, "", 0o644)}

    def image(name: str) -> np.ndarray:
        return np.asarray(PIL.Image.open(io.BytesIO(files[f"000012_000.{name}.png"])))

    images = sample.images
    assert (image("color") == images.color).all()
    assert (image("labels") == images.labels).all() and image("labels").dtype == np.uint8
    assert np.abs(image("depth") * 1e-4 - images.depth).max() < 0.5001e-4
    values = json.loads(files["000012_000.json"])
    assert values["view"]["intrinsics"]["focal"] == [61.3, 60.7]
    assert values["depth_unit"] == 1e-4 and values["instances"][1]["name"] == "bottle"
    with np.load(io.BytesIO(files["000012_000.grasps.npz"])) as grasps:
        assert grasps["outcome"].tolist() == ["lifted", "", "no_ik"]
        assert grasps["margin.clearance_m"][2] == -1 / 3
    with zipfile.ZipFile(io.BytesIO(files["000012_000.grasps.npz"])) as archive:
        assert {one.date_time for one in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_webdataset_reads_a_shard(tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    write_shard(tmp_path / "000012.tar", [drawn.sample(), drawn.sample(1)])
    found = list(webdataset.WebDataset(str(tmp_path / "000012.tar"), shardshuffle=False))
    assert [one["__key__"] for one in found] == ["000012_000", "000012_001"]
    assert {*NAMES, "grasps.npz"} <= found[0].keys()


def huge(sample: Sample, width: int, height: int) -> Sample:
    """A sample without images whose camera would make large ones."""
    intrinsics = replace(sample.view.intrinsics, width=width, height=height)
    view = replace(sample.view, intrinsics=intrinsics)
    return replace(sample, view=view, images=Images(), sensor_depth=None, instances=(), grasps=None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: replace(s, scene=13), "sample 000013_000 to {path}: it is of another scene"),
        (lambda s: replace(s, sensor_depth=np.ones((4, 4), np.float32)), "intrinsics are for 64 x"),
        (
            lambda s: replace(s, sensor_depth=s.sensor_depth * -1),
            "sensor depth has values that are",
        ),
        (lambda s: replace(s, sensor_depth=s.sensor_depth * np.nan), "not finite or above 6.5535"),
        (lambda s: replace(s, instances=s.instances[:3]), "label 6 has no instance"),
        (lambda s: replace(s, instances=s.instances[::-1]), "have numbers [6, 5, 4, 3, 2, 1]"),
        (lambda s: replace(s, appearance={"x": np.nan}), "values that cannot be written as JSON"),
        (lambda s: replace(s, appearance={"x": object()}), "values that cannot be written as JSON"),
        (lambda s: replace(s, view=replace(s.view, depth_range=(1, 99))), "up to 99 m cannot be"),
        (lambda s: replace(s, images=replace(s.images, color=s.images.normals)), "float32"),
        (lambda s: huge(s, 10_000, 10_000), "too large with 10000 x 10000 pixels"),
    ],
)
def test_samples_that_cannot_be_kept_are_refused(
    tmp_path: Path, change: Callable[[Sample], Sample], message: str
) -> None:
    path = tmp_path / "000012.tar"
    with pytest.raises(InvalidInputError) as refused:
        write_shard(path, [drawn.sample(1), change(drawn.sample())])
    assert message.format(path=path) in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_sample_can_be_in_a_shard_once(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"000012_000 to .* it is there already"):
        write_shard(tmp_path / "000012.tar", [drawn.sample(), drawn.sample()])
    assert list(tmp_path.iterdir()) == []


def png(width: int, height: int, bits: int = 8, color: int = 2) -> bytes:
    """A file that announces an image, and has no pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")
        )

    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([bits, color, 0, 0, 0])
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IEND", b"")


def pickled() -> bytes:
    """Grasps with a column of Python objects."""
    data = io.BytesIO()
    np.savez(data, X_CG=np.eye(4)[None], outcome=np.array([{}]), width=[0.0], number=[1])
    return data.getvalue()


def announcing(shape: str) -> bytes:
    """Grasps whose poses announce more than there is."""
    data = io.BytesIO()
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("X_CG.npy", b"\x93NUMPY\x01\x00" + b"\x76\x00" + header.encode())
    return data.getvalue()


def edited(key: str, value: Any) -> Callable[[dict[str, bytes]], object]:
    """Changes a value in the record of the first sample; dots lead inwards."""

    def change(files: dict[str, bytes]) -> None:
        values = inner = json.loads(files["000012_000.json"])
        *path, last = [int(step) if step.isdigit() else step for step in key.split(".")]
        for step in path:
            inner = inner[step]
        inner[last] = value
        files["000012_000.json"] = json.dumps(values).encode()

    return change


def flipped(name: str, near: bytes) -> Callable[[dict[str, bytes]], object]:
    """Flips a bit of the first sample, where this is."""

    def change(files: dict[str, bytes]) -> None:
        data = bytearray(files[f"000012_000.{name}"])
        data[data.index(near) + (50 if near == b"IDAT" else 0)] ^= 1
        files[f"000012_000.{name}"] = bytes(data)

    return change


def file(name: str, data: bytes) -> Callable[[dict[str, bytes]], object]:
    """Puts another file in place of one of the first sample."""
    return lambda files: files.update({f"000012_000.{name}": data})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            file("color.png", png(60000, 60000)),
            "000012_000.color.png has 60000 x 60000 pixels, but its",
        ),
        (file("color.png", png(64, 48)), "000012_000.color.png is damaged: its pixels"),
        (file("color.png", png(64, 48, 16)), "has bit depth 16 and PNG colour type 2; expected 8"),
        (file("depth.png", png(64, 48, 16)), "PNG colour type 2; expected 16 bits"),
        (file("color.png", b"GIF89a"), "000012_000.color.png is not a PNG"),
        (
            file("color.png", png(64, 48) + b"x"),
            "color.png is truncated, or has data after its end",
        ),
        (flipped("color.png", b"IDAT"), "color.png is damaged: its pixels"),
        (flipped("normals.png", b"IEND"), "normals.png is truncated, or has data"),
        (file("grasps.npz", pickled()), "000012_000.grasps.npz: outcome hold"),
        (file("grasps.npz", announcing("(9999999, 4, 4)")), "000012_000.grasps.npz: X_CG"),
        (file("grasps.npz", b"PK"), "000012_000.grasps.npz is not a .npz file of grasps"),
        (file("json", b"[" * 100000), "000012_000.json: nested more than 64"),
        (file("json", b"\xff"), "000012_000.json is not text"),
        (file("json", b"[]"), "000012_000.json: expected keys with values"),
        (edited("version", 2), "000012_000.json: version: 2 cannot be read; this"),
        (edited("number", 1), "000012_000.json belongs to sample 000012_001"),
        (edited("scene", True), "000012_000.json: scene: 'True' is not a whole number"),
        (edited("view.intrinsics.width", 10**9), "view.intrinsics: image of 1000000000 x 48"),
        (edited("view.intrinsics.focal", [1, -1]), "view.intrinsics: width, height and focal"),
        (edited("view.intrinsics.model", "fisheye"), "view.intrinsics has the keys"),
        (edited("scene", "1_0"), "000012_000.json: scene: '1_0' is not a whole number"),
        (edited("view.camera", 7), "view.camera: '7' is not a text"),
        (edited("X_WS.0.0", "1"), "X_WS is [['1'"),
        (edited("view.X_SC", [[1, 0], [0]]), "view: X_SC is [[1, 0], [0]]; expected a pose"),
        (edited("X_WS.0.0", 2.0), "000012_000.json: X_WS is not a rigid"),
        (edited("depth_unit", float("nan")), "depth_unit: 'nan' is not a finite number"),
        (
            edited("instances.2.amodal", "4"),
            "instances[2]: the run lengths of a mask have 4 pixels",
        ),
        (edited("instances.2.vsible", 4), "instances[2]: unknown key 'vsible'; did you mean"),
        (edited("view.posture", ["a"]), "view.posture[0]: 'a' is not a finite number"),
        (lambda files: files.pop("000012_000.labels.png"), "000012_000.labels.png is missing"),
    ],
)
def test_hostile_and_damaged_files_are_refused(
    tmp_path: Path, change: Callable[[dict[str, bytes]], object], message: str
) -> None:
    dataset = load_dataset(packed(tmp_path, change))
    with pytest.raises(InvalidInputError) as refused:
        dataset.read(0)
    assert str(refused.value).startswith(f"{tmp_path}/shards/000012.tar: 000012_000.")
    assert message in str(refused.value)
    assert dataset.read(1).key == "000012_001"  # the rest goes on


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: data[:100], "is truncated after its beginning"),
        (lambda data: data[:-1024], "is truncated after 000012_001.grasps.npz"),
        (lambda data: data[:700], "is truncated within 000012_000.json"),
        (lambda data: b"1" + data[1:], "the checksum of a header is wrong"),
        (lambda data: b"x" * 2048, "the header is not that of a tar archive"),
        (lambda data: data[:-1024] + data, "contains 000012_000.json twice"),
        (lambda data: linked(), "'000012_000.json' is not a regular file"),
    ],
)
def test_damaged_archives_are_refused(
    tmp_path: Path, damage: Callable[[bytes], bytes], message: str
) -> None:
    shard = drawn.write(tmp_path, [12]) / "shards/000012.tar"
    shard.write_bytes(damage(shard.read_bytes()))
    with pytest.raises(InvalidInputError) as refused:
        load_dataset(tmp_path).read(0)
    assert str(shard) in str(refused.value) and message in str(refused.value)


def linked() -> bytes:
    """An archive with a link to a file of the system."""
    info = tarfile.TarInfo("000012_000.json")
    info.type, info.linkname = tarfile.SYMTYPE, "/etc/passwd"
    return info.tobuf(tarfile.USTAR_FORMAT) + bytes(1024)
