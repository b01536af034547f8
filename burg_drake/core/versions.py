"""Versions of the software that made a result; written into every file of results."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

JUDGING = {name: name for name in ("drake", "numpy", "scipy", "trimesh", "embreex")}
"""Packages that decide about what becomes of a grasp, as they are called in files and installed."""


def software_versions(
    packages: Mapping[str, str] = JUDGING, *, with_platform: bool = True
) -> dict[str, str]:
    """Versions of what decides about results, and of what may.

    Args:
        packages: names under which they are installed, by names in files.
        with_platform: tell the operating system, too.
    """
    own = sys.modules["burg_drake"]  # not imported: type checkers would see a circle of all faces
    found = {"burg_drake": str(own.__version__)}
    found |= {name: _installed(package) for name, package in packages.items()}
    found["python"] = platform.python_version()
    return found | {"platform": platform.platform()} if with_platform else found


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # built from source, or from another package or the system
        return "unknown"
