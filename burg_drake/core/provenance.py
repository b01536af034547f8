"""Provenance of results: content hashes, random generators seeded by content, software versions."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.files import open_regular


def content_hash(*parts: Any) -> str:
    """SHA-256 of a sequence of parts, each with its type and length, so that parts are separated.

    Args:
        parts: `str`, `bytes`, `int`, `float`, `bool`, `None`, `numpy.ndarray`, `Path` (the file's
            bytes are hashed, not its name) or nested lists, tuples and dicts (by sorted key).

    Returns:
        64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for part in parts:
        _hash_part(digest, part)
    return digest.hexdigest()


def rng_from(*parts: Any) -> np.random.Generator:
    """Random generator seeded by content: the same parts give the same stream everywhere."""
    return np.random.default_rng(int(content_hash(*parts)[:32], 16))


def _hash_part(digest: Any, part: Any) -> None:
    if isinstance(part, Path):
        with open_regular(part) as stream:
            tag, data = "file", stream.read()
    elif isinstance(part, np.ndarray) and not part.dtype.hasobject:
        array = np.ascontiguousarray(part)
        digest.update(f"array{array.dtype.str}{array.shape}{array.nbytes}:".encode())
        digest.update(array.reshape(-1).view(np.uint8) if array.nbytes else b"")
        return
    elif isinstance(part, dict):
        digest.update(f"dict{len(part)}:".encode())
        for key in sorted(part):
            _hash_part(digest, key)
            _hash_part(digest, part[key])
        return
    elif isinstance(part, Sequence) and not isinstance(part, (str, bytes)):
        digest.update(f"list{len(part)}:".encode())
        for item in part:
            _hash_part(digest, item)
        return
    elif isinstance(part, bytes):
        tag, data = "bytes", part
    elif part is None or isinstance(part, (str, bool, int, float, np.generic)):
        value = part.item() if isinstance(part, np.generic) else part
        tag, data = type(value).__name__, repr(value).encode()
    else:
        raise TypeError(f"cannot hash a {type(part).__name__}")
    digest.update(f"{tag}{len(data)}:".encode())
    digest.update(data)


JUDGING_PACKAGES = {name: name for name in ("drake", "numpy", "scipy", "trimesh", "embreex")}
"""Packages that affect the outcome of a grasp: name in files to installed name."""


def software_versions(
    packages: Mapping[str, str] = JUDGING_PACKAGES, *, with_platform: bool = True
) -> dict[str, str]:
    """Versions of the software that affects results.

    Args:
        packages: installed package names, by names in files.
        with_platform: include the operating system.
    """
    own = sys.modules["burg_drake"]  # not imported: type checkers would see a circular import
    found = {"burg_drake": str(own.__version__)}
    found |= {name: package_version(package) for name, package in packages.items()}
    found["python"] = platform.python_version()
    return found | {"platform": platform.platform()} if with_platform else found


def package_version(package: str, missing: str = "unknown") -> str:
    """The installed version of a package; `missing` if it has no metadata, as a Drake that was
    built from source.
    """
    try:
        return version(package)
    except PackageNotFoundError:
        return missing


def provenance_parts(provenance: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The provenances of the sets that were joined, which `parts` has as a list or by name."""
    parts = provenance.get("parts")
    if isinstance(parts, Mapping):
        parts = list(parts.values())
    return [p for p in parts if isinstance(p, Mapping)] if isinstance(parts, (list, tuple)) else []
