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
from pathlib import Path

from burg_drake.core.errors import InvalidInputError

READ_ERRORS = (
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

LONGEST = 200
"""Characters of what another library says; numpy repeats whole headers."""


@contextmanager
def without_warnings() -> Iterator[None]:
    """Numpy warns of headers that it has to repair, and of numbers that overflow."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def reporting_read_errors(path: str | Path, kind: str) -> Iterator[None]:
    """Makes one line that names the file of every error that reading it ends with.

    Args:
        path: the file.
        kind: what it should be, such as `a .npy file of numbers`.

    Raises:
        InvalidInputError: in place of what is raised within; one that names the file stays.
    """
    try:
        with without_warnings():
            yield
    except InvalidInputError as error:
        if str(path) in str(error):
            raise
        raise InvalidInputError(f"{path}: {error}") from error
    except OSError as error:
        raise InvalidInputError(
            f"cannot read {path}: {error.strerror or short_message(error)}"
        ) from error
    except READ_ERRORS as error:
        raise InvalidInputError(f"{path} is not {kind}: {short_message(error)}") from error


def short_message(error: Exception) -> str:
    """What an error says, in one line that is not too long."""
    text = str(error).partition("\n")[0] or type(error).__name__
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
