"""All formats: round trips, ways through several of them, recognition, what is imported."""

from __future__ import annotations

import dataclasses
import itertools
import re
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import burg_drake.formats
from burg_drake.core import Array, GraspSet, InvalidInputError, UnknownNameError, rotation_angle
from burg_drake.formats import (
    GRASP_FORMATS,
    PANDA_GRIPPER,
    Gripper,
    GripperJoint,
    format_by_suffix,
    format_of,
    object_description,
    read_grasp_file,
    write_grasp_file,
)

SINGLE_PRECISION = ("graspnet", "burg")
WITH_WIDTH = ("burg_drake", "acronym", "isaac_grasp", "vgn")
WITH_SCORE = ("burg_drake", "acronym", "isaac_grasp", "graspgen", "graspgen_yaml", "graspnet")
WITH_OBJECT = ("burg_drake", "acronym", "isaac_grasp", "graspgen")

OTHER = Gripper(
    name="other",
    body="palm",
    X_HG=np.array(
        [[0.0, 0.0, 1.0, 0.2], [0.6, 0.8, 0.0, 0.01], [-0.8, 0.6, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    ),
    tip=0.02,
    opening=(0.01, 0.12),
    joints=(GripperJoint("left", 0.3, -0.2), GripperJoint("right", 0.0, 0.05)),
)
"""A hand whose approach is x of its body, whose fingers run apart from 10 mm on."""


def written(grasps: GraspSet, name: str, folder: Path, gripper: Gripper = PANDA_GRIPPER) -> Path:
    path = folder / f"{name}{GRASP_FORMATS[name].suffixes[0]}"
    write_grasp_file(grasps, path, name, gripper)
    return path


def assert_same_poses(found: Array, expected: Array, *formats: str) -> None:
    rough = bool(set(formats) & set(SINGLE_PRECISION))
    np.testing.assert_allclose(found[:, :3, 3], expected[:, :3, 3], atol=1e-7 if rough else 1e-12)
    R = np.swapaxes(found[:, :3, :3], 1, 2) @ expected[:, :3, :3]
    assert rotation_angle(R).max() < (1e-6 if rough else 1e-12)


@pytest.mark.parametrize("name", GRASP_FORMATS)
@pytest.mark.parametrize("gripper", [PANDA_GRIPPER, OTHER], ids=lambda gripper: gripper.name)
def test_what_is_written_is_read_again(
    name: str, gripper: Gripper, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(60, 11, success=name == "graspgen")
    read = read_grasp_file(written(grasps, name, tmp_path, gripper), gripper=gripper)
    assert read.frame == GRASP_FORMATS[name].frame
    assert_same_poses(read.grasps.X_OG, grasps.X_OG, name)
    tolerance = 1e-7 if name in SINGLE_PRECISION else 1e-12
    if name in WITH_WIDTH:
        np.testing.assert_allclose(read.grasps.width, grasps.width, atol=tolerance)
    if name in WITH_SCORE:
        np.testing.assert_allclose(read.grasps.score, grasps.score, atol=tolerance)
    if name in WITH_OBJECT:
        np.testing.assert_array_equal(read.grasps.object, grasps.object)


@pytest.mark.parametrize(("one", "other"), list(itertools.permutations(GRASP_FORMATS, 2)))
def test_ways_through_two_formats_end_where_they_began(
    one: str, other: str, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(8, 12, success=True)
    once = read_grasp_file(written(grasps, one, tmp_path), one).grasps
    twice = read_grasp_file(written(once, other, tmp_path), other).grasps
    last = read_grasp_file(written(twice, "burg_drake", tmp_path / "last")).grasps
    assert_same_poses(last.X_OG, grasps.X_OG, one, other)


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_no_file_tells_where_things_are_on_this_machine(
    name: str, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    mesh = tmp_path / "lib" / "mug" / "mesh.obj"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    told = {
        **{key: str(mesh.parent) for key in ("scene", "library", "station", "run", "file")},
        "hand": {"name": "palm", "document": str(mesh)},
        "object_files": {"mug": {"file": str(mesh), "scale": 1.0}},
    }
    grasps = dataclasses.replace(random_grasps(3, 11, success=True), provenance={"parts": [told]})
    path = written(grasps, name, tmp_path / "out")
    texts = [path.read_bytes()]
    if name == "burg_drake":
        grasps.save(path.with_suffix(".npz"))
        assert GraspSet.load(path).provenance == GraspSet.load(path.with_suffix(".npz")).provenance
        with zipfile.ZipFile(path.with_suffix(".npz")) as archive:
            texts += [archive.read(entry).replace(b"\0", b"") for entry in archive.namelist()]
        assert all(b"../lib/mug/mesh.obj" in text for text in texts[:2])
    assert not any(str(tmp_path).encode() in text for text in texts)
    if name in ("burg_drake", "acronym", "graspgen"):
        again = object_description(read_grasp_file(path).grasps, "mug")
        assert again["file"] == (str(mesh) if name == "burg_drake" else "../lib/mug/mesh.obj")


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_frames_of_formats_are_rigid_and_follow_the_hand(name: str) -> None:
    for gripper in (PANDA_GRIPPER, OTHER):
        X_GF = GRASP_FORMATS[name].X_GF(gripper)
        np.testing.assert_allclose(X_GF[:3, :3].T @ X_GF[:3, :3], np.eye(3), atol=1e-12)
        assert np.linalg.det(X_GF[:3, :3]) > 0.0
        np.testing.assert_array_equal(X_GF[3], [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_each_file_is_of_one_format(
    name: str, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    path = written(random_grasps(3, 13, success=True), name, tmp_path)
    disguised = path.rename(tmp_path / "something.dat")
    assert [n for n, format in GRASP_FORMATS.items() if format.recognises(disguised)] == [name]
    assert format_of(disguised).name == name


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"hello",
        b"{}",
        b'{"a": 1}',
        b"a: 1\n",
        b"a,b\n1,2\n",
        b"\x89HDF\r\n\x1a\n",
        b"PK\x03\x04",
    ],
)
def test_other_files_are_of_no_format(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match=r"a\.txt is not a file of grasps") as caught:
        read_grasp_file(path)
    assert all(name in str(caught.value) for name in GRASP_FORMATS)
    assert len(str(caught.value)) < len(str(path)) + 200


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_what_is_too_deep_to_be_read_is_said_to_be(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text("[" * 70 + "]" * 70)
    with pytest.raises(InvalidInputError, match="nested more than 64 levels deep"):
        read_grasp_file(path)


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_other_files_are_one_clear_error_if_the_format_is_named(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    for content in (b"", b"hello", b"\x00\xff" * 40, b"[]", b"PK\x03\x04abc"):
        path.write_bytes(content)
        with pytest.raises(InvalidInputError) as caught:
            read_grasp_file(path, name)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", GRASP_FORMATS)
def test_a_file_cut_anywhere_is_an_error_or_holds_the_grasps_before_the_cut(
    name: str, tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(30, 14, success=True)
    content = written(grasps, name, tmp_path).read_bytes()
    cut = tmp_path / "cut.dat"
    for end in range(0, len(content) - 1, max(1, len(content) // 40)):
        cut.write_bytes(content[:end])
        try:
            found = read_grasp_file(cut, name).grasps
        except InvalidInputError as error:
            assert str(cut) in str(error)
            continue
        whole = len(found) - 1  # of text, the last line may be cut within a number
        assert_same_poses(found.X_OG[:whole], grasps.X_OG[:whole], name)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("header", ["{'descr': '<f4', 'shape': (", "{'descr': '<f4'", "(" * 300])
def test_headers_of_numpy_that_are_no_python(header: str, tmp_path: Path) -> None:
    text = header.encode().ljust(117) + b"\n"
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(64))
    for name in ("graspnet", "burg"):
        assert not GRASP_FORMATS[name].recognises(path)
        with pytest.raises(InvalidInputError, match=r"a\.npy is not a \.npy file of numbers: ."):
            read_grasp_file(path, name)


@pytest.mark.parametrize("start", [b"format: isaac_grasp\n", b'{"a": [', b"x,y,", b"PK\x03\x04"])
def test_large_files_are_not_read_to_tell_their_format(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "large.dat"
    with path.open("wb") as stream:
        stream.write(start)
        stream.truncate(1 << 26)
    for format in GRASP_FORMATS.values():
        format.recognises(path)  # whatever it imports is not counted below
    tracemalloc.start()
    for format in GRASP_FORMATS.values():
        format.recognises(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 22


def test_messages_of_formats_do_not_name_options() -> None:
    """They are read by those who call them from Python, too, and not every verb has each."""
    options = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
    for path in (Path(burg_drake.formats.__file__).parent).glob("*.py"):
        assert not options.findall(path.read_text(encoding="utf-8")), path.name


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="does not exist"):
        read_grasp_file(tmp_path / "none.h5")
    with pytest.raises(InvalidInputError, match="is a folder"):
        read_grasp_file(tmp_path)


def test_unknown_formats_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'graspgen'"):
        read_grasp_file(__file__, "graspgem")
    with pytest.raises(UnknownNameError, match="did you mean 'acronym'"):
        write_grasp_file(GraspSet.create(np.eye(4), object="a"), tmp_path / "a.h5", "acronim")


def test_suffixes_choose_a_format() -> None:
    assert format_by_suffix("a.h5").name == "burg_drake"
    assert format_by_suffix("a.NPZ").name == "burg_drake"
    assert format_by_suffix("a.json").name == "graspgen"
    assert format_by_suffix("a.csv").name == "vgn"
    with pytest.raises(InvalidInputError, match="isaac_grasp or graspgen_yaml"):
        format_by_suffix("a.yaml")
    with pytest.raises(InvalidInputError, match=r"no format of grasps has the suffix '\.txt'"):
        format_by_suffix("a.txt")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    both = GraspSet.create(np.repeat(np.eye(4)[None], 2, 0), object=["a", "b"])
    with pytest.raises(InvalidInputError, match="2 objects"):
        write_grasp_file(both, path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"] and path.read_text() == "old"


def test_no_format_needs_drake_and_only_hdf5_needs_h5py(
    tmp_path: Path, random_grasps: Callable[..., GraspSet]
) -> None:
    grasps = random_grasps(3, 15, success=True)
    paths = {name: str(written(grasps, name, tmp_path)) for name in GRASP_FORMATS}
    script = f"""
import pkgutil, importlib, sys
import burg_drake.formats
for module in pkgutil.iter_modules(burg_drake.formats.__path__):
    importlib.import_module("burg_drake.formats." + module.name)
from burg_drake.formats.grasp_files import read_grasp_file, write_grasp_file
paths = {paths!r}
for name, path in paths.items():
    if not path.endswith(".h5"):
        write_grasp_file(read_grasp_file(path).grasps, path + ".again", name)
assert "h5py" not in sys.modules
for name, path in paths.items():
    write_grasp_file(read_grasp_file(path).grasps, path, name)
assert not [name for name in sys.modules if name.split(".")[0] == "pydrake"]
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
