"""Numpy's files whose headers promise more than they hold, or than anybody can keep."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import (
    InvalidInputError,
    npy_shape,
    open_npy,
    open_npz,
    report_read_errors,
    write_npy,
)


def header(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    stream = io.BytesIO()
    described = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, described)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (header((10**9,)), r"is damaged or cut off: .* needs 8000000000 bytes, but the file has 0"),
        (header((-1,)), "lengths cannot be negative"),
        (
            header((1,), "|O") + b"\x80\x04]\x94.",
            "holds pickled Python objects, which are not read; save plain numbers or texts",
        ),
        (header((2,), "<c16") + bytes(32), "values of type complex128; expected numbers"),
        (b"\x93NUMPY\x01\x00\x40\x9c" + b"[" * 40_000, "is not a .npy file of numbers"),
        (b"\x93NUMPY\x07\x00\x00\x00", "is not a .npy file of numbers"),
    ],
)
def test_headers_are_not_believed(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.npy"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match=rf"^{path}.*{said}") as caught, open_npy(path) as a:
        a.read("fiu")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/zero"), tmp_path / "a\0b"):
        with pytest.raises(InvalidInputError, match=r"^cannot read"), open_npy(path):
            pass
        assert npy_shape(path) is None


def test_entries_are_looked_at_before_they_are_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.core.array_files.MAX_ARRAY_BYTES", 10_000_000)
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.npy", header((2_000_000,)) + bytes(16_000_000))
        for name in ("half", "other"):
            archive.writestr(f"{name}.npy", header((1_000_000,)) + bytes(8_000_000))
        archive.writestr("rare.npy", header((0,)), zipfile.ZIP_LZMA)
    with open_npz(path) as file:
        assert file.names == ["bomb", "half", "other", "rare"]
        with pytest.raises(InvalidInputError, match=r"a.npz: bomb would take 0.0149 GiB of memory"):
            file.array("bomb").read("f")
        file.array("half").read("f")
        with pytest.raises(InvalidInputError, match=r"a.npz: other would take"):
            file.array("other").read("f")
        with pytest.raises(InvalidInputError, match=r"other has shape .*; expected \(3,\)"):
            file.array("other").read("f", (3,))
        with pytest.raises(InvalidInputError, match="rare is compressed"):
            file.array("rare")


def test_numbers_are_restored(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    values = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    write_npy(path, values)
    assert npy_shape(path) == (2, 3)
    with open_npy(path) as stored:
        assert stored.shape == (2, 3)
        np.testing.assert_array_equal(stored.read("fiu"), values)


def test_errors_of_others_become_one_line_that_names_the_file() -> None:
    for error, said in {
        KeyError("x"): "'x'",
        ValueError("one\ntwo"): "one",
        MemoryError(): "MemoryError",
        ValueError("9" * 1000): "9" * 200 + "...",
    }.items():
        message = rf"^a.b is not good: {re.escape(said)}$"
        with pytest.raises(InvalidInputError, match=message), report_read_errors("a.b", "good"):
            raise error
    with (
        pytest.raises(InvalidInputError, match=r"^a.b: width is bad$"),
        report_read_errors("a.b", "good"),
    ):
        raise InvalidInputError("width is bad")
    with pytest.raises(InvalidInputError, match=r"^in a.b$"), report_read_errors("a.b", "good"):
        raise InvalidInputError("in a.b")
