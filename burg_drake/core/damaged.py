"""What numpy and h5py do with files that are not what they seem to be: damaged or foreign ones."""

from __future__ import annotations

import lzma
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

DAMAGED = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    lzma.LZMAError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What they raise besides OSError. Numpy takes the header of an array for Python and believes the
shape in it; h5py passes on what HDF5 finds in any of its structures."""


@contextmanager
def without_warnings() -> Iterator[None]:
    """Numpy warns of headers that it has to repair, and of numbers that overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def reason(error: Exception) -> str:
    """What an error says, in one line."""
    return str(error).partition("\n")[0] or type(error).__name__
