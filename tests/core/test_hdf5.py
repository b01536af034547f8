"""HDF5 files that lead elsewhere, or unpack to more than they say."""

from __future__ import annotations

import resource
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from burg_drake.core import NUMBER_KINDS, InvalidInputError, open_hdf5


def external_storage(file: Any, other: Path) -> None:
    file.create_dataset("x", (4,), "f8", external=[(str(other), 0, h5py.h5f.UNLIMITED)])


def external_link(file: Any, other: Path) -> None:
    file["x"] = h5py.ExternalLink(str(other), "x")


def soft_link(file: Any, other: Path) -> None:
    file["out"] = h5py.ExternalLink(str(other), "/")
    file["x"] = h5py.SoftLink("/out/x")


def virtual(file: Any, other: Path) -> None:
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "x", (4,))
    file.create_virtual_dataset("x", layout)


@pytest.mark.parametrize("make", [external_storage, external_link, soft_link, virtual])
def test_nothing_outside_of_the_file_is_read(
    tmp_path: Path, make: Callable[[Any, Path], None]
) -> None:
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["x"] = np.arange(4.0)
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        make(file, other)
    with h5py.File(path) as file:
        assert file["x"].shape == (4,)  # HDF5 itself would follow it
    with open_hdf5(path) as tree, pytest.raises(InvalidInputError) as caught:
        tree.array("x").read("f")
    assert str(caught.value).startswith((f"{path}: x is a link", f"{path}: x keeps its data in"))


def most_memory() -> int:
    """Bytes that this process has ever had."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def unallocated(file: Any) -> None:
    file.create_dataset("x", (750_000_000,), "f8", chunks=(1000,))


def huge_chunk(file: Any) -> None:
    file.create_dataset("x", (10,), "f8", chunks=(450_000_000,), maxshape=(None,))


def inflating_chunk(file: Any) -> None:
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(1 << 24)) for _ in range(12)) + packer.flush()
    data = file.create_dataset("x", (10_000,), "f8", chunks=(10_000,), compression="gzip")
    data.id.write_direct_chunk((0,), packed)


def shared_text(file: Any) -> None:
    data = file.create_dataset("x", (1000,), h5py.string_dtype(), chunks=(1000,))
    data[0] = "x" * 1_000_000
    file.flush()
    _, packed = data.id.read_direct_chunk((0,))
    data.id.write_direct_chunk((0,), packed[:16] * 1000)


def one_long_text(file: Any) -> None:
    data = file.create_dataset("x", (10_000,), h5py.string_dtype(), compression="gzip")
    data[:] = ["x" * 1_000_000, *["" for _ in range(9_999)]]


def long_fixed_text(file: Any) -> None:
    file.create_dataset("x", (1000,), h5py.string_dtype("utf-8", 4_000_000), chunks=(1,))


@pytest.mark.parametrize(
    "make",
    [unallocated, huge_chunk, inflating_chunk, shared_text, one_long_text, long_fixed_text],
)
def test_bombs_are_refused_before_they_take_memory(
    tmp_path: Path, make: Callable[[Any], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.core.array_files.MAX_ARRAY_BYTES", 50_000_000)
    path = tmp_path / "bomb.h5"
    with h5py.File(path, "w", libver="latest") as file:
        make(file)
    before = most_memory()
    said = rf"^{path}: x (would take|is damaged)"
    with open_hdf5(path) as tree, pytest.raises(InvalidInputError, match=said) as caught:
        tree.array("x").read(NUMBER_KINDS + "U")
    assert "\n" not in str(caught.value)
    assert most_memory() - before < 100_000_000


def test_what_is_no_plain_dataset_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["empty"] = h5py.Empty("f8")
        file["lzf"] = file.create_dataset("l", (1000,), "f8", compression="lzf")
        file["lists"] = file.create_dataset("v", (2,), h5py.vlen_dtype(np.float64))
        file["pointer"] = file["empty"].ref
        file.attrs["many"] = [1, 2]
    for name in ("empty", "lzf", "lists", "pointer", "missing"):
        with open_hdf5(path) as tree, pytest.raises(InvalidInputError, match=f"^{path}: {name} "):
            tree.array(name).read("f")
    with open_hdf5(path) as tree, pytest.raises(InvalidInputError, match="many must be a single"):
        tree.attribute("many")


def test_texts_of_any_storage_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    texts = ["", "a", "größer", "x" * 100]
    with h5py.File(path, "w") as file:
        file["free"] = np.array(texts, dtype=object)
        file["fixed"] = np.char.encode(texts, "utf-8")
        file["one"] = "größer"
        packed = {"compression": "gzip", "dtype": h5py.string_dtype(), "chunks": (3,)}
        file.create_dataset("packed", data=texts, **packed)
        file.create_dataset("shuffled", data=texts, shuffle=True, **packed)
    with open_hdf5(path) as tree:
        for name in ("free", "fixed", "packed", "shuffled"):
            assert tree.array(name).read("U", (4,)).tolist() == texts
        assert tree.array("one").read("U", ()).item() == "größer"
