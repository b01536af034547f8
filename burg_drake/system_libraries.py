"""Which system libraries Drake and its renderer lack on this machine, and how to get them.

Drake's wheel brings everything but a few libraries of the operating system. Without GLib pydrake
cannot be imported; without Mesa's driver a first rendering ends the process with a segmentation
fault, so this is checked first. Only the standard library is imported here, since
tools/setup/set_up.sh runs this file before anything else is known to work.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path


class SystemLibrary:
    """Shared libraries of the operating system, by what is loaded."""

    glib = "libglib-2.0.so.0"  # Needed to import pydrake.
    egl = "libEGL.so.1"  # Needed to render.
    mesa_egl = "libEGL_mesa.so.0"  # Mesa's EGL, for machines without a graphics driver.
    mesa_driver = "swrast_dri.so"  # Mesa's software renderer.
    atomic = "libatomic.so.1"  # Lets a faster memory allocator load.


_DEBIAN_PACKAGES = {
    SystemLibrary.glib: "libglib2.0-0",
    SystemLibrary.egl: "libegl1",
    SystemLibrary.mesa_egl: "libegl-mesa0",
    SystemLibrary.mesa_driver: "libgl1-mesa-dri",
    SystemLibrary.atomic: "libatomic1",
}
"""Packages of Debian and Ubuntu by library."""
_DEBIAN_T64_PACKAGES = _DEBIAN_PACKAGES | {SystemLibrary.glib: "libglib2.0-0t64"}
"""Likewise for releases with a 64-bit time_t, such as Ubuntu 24.04 and Debian 13."""


def missing_import_libraries() -> list[str]:
    """System libraries without which `import pydrake` fails; empty if all is well."""
    if sys.platform != "linux" or _can_load(SystemLibrary.glib):
        return []
    return [SystemLibrary.glib]


def missing_render_libraries() -> list[str]:
    """System libraries without which Drake cannot render; empty if all is well.

    Looks for what Drake itself opens by name at run time: GLib, EGL, and under it the EGL of a
    graphics driver or Mesa's with its software renderer. Empty on other systems than Linux,
    where Drake's wheel is complete.
    """
    if sys.platform != "linux":
        return []
    missing = missing_import_libraries()
    if not _can_load(SystemLibrary.egl):
        missing.append(SystemLibrary.egl)
    if _can_load("libEGL_nvidia.so.0"):  # it needs nothing of Mesa
        return missing
    if not _can_load(SystemLibrary.mesa_egl):
        missing.append(SystemLibrary.mesa_egl)
    if not _has_mesa_driver():
        missing.append(SystemLibrary.mesa_driver)
    return missing


def missing_useful_libraries() -> list[str]:
    """Optional system libraries that make trials faster: without libatomic the allocator of the
    package cmeel-mimalloc cannot be loaded."""
    return (
        [SystemLibrary.atomic]
        if sys.platform == "linux" and not _can_load(SystemLibrary.atomic)
        else []
    )


def apt_packages(missing: Sequence[str]) -> list[str]:
    """Debian and Ubuntu packages with the `missing` libraries, by the names of this release."""
    t64_glibc = (2, 39)  # First glibc of releases with 64-bit time.
    version = platform.libc_ver()[1] or "0"
    glibc = tuple(int(part) for part in version.split(".")[:2])
    names = _DEBIAN_T64_PACKAGES if glibc >= t64_glibc else _DEBIAN_PACKAGES
    return [names[library] for library in missing]


def apt_command(missing: Sequence[str] | None = None) -> str:
    """Command that installs what is missing.

    Args:
        missing: names from `missing_render_libraries`, which is called if None.

    Returns:
        The command line; empty if nothing is missing.
    """
    packages = apt_packages(missing_render_libraries() if missing is None else missing)
    return f"sudo apt-get install {' '.join(packages)}" if packages else ""


def describe_missing(missing: Sequence[str]) -> str:
    """One line: which libraries are missing, what cannot be done without them, what to run."""
    effect = (
        "pydrake cannot be imported"
        if SystemLibrary.glib in missing
        else "Drake cannot render images"
    )
    pronoun = "it" if len(missing) == 1 else "them"
    remedy = (
        f"run: {apt_command(missing)}"
        if shutil.which("apt-get")
        else f"install {pronoun} with the package manager of this system"
    )
    return f"{effect} without {', '.join(missing)}; {remedy}"


def _can_load(soname: str) -> bool:
    """Whether the dynamic linker finds and opens a shared library."""
    try:
        ctypes.CDLL(soname)
    except OSError:
        return False
    return True


def _has_mesa_driver() -> bool:
    """Whether Mesa finds its software renderer.

    Up to Mesa 24.1 that is a file which libEGL_mesa opens when a context is made; since then it
    is libgallium, which libEGL_mesa is linked against.
    """
    folders = [Path(p) for p in os.environ.get("LIBGL_DRIVERS_PATH", "").split(":") if p]
    for root in (Path("/usr/lib"), Path("/usr/lib64")):
        if any(root.glob("libgallium-*.so")) or any(root.glob("*/libgallium-*.so")):
            return True
        folders += [root / "dri", *root.glob("*/dri")]
    return any((folder / SystemLibrary.mesa_driver).exists() for folder in folders)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints what is missing; with `--packages` only Debian's packages, those of optional libraries
    as well.

    Returns:
        0 if nothing is missing, 1 if images cannot be rendered, 2 if pydrake cannot be imported.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    missing = missing_render_libraries()
    if "--packages" in arguments:
        print(" ".join(apt_packages([*missing, *missing_useful_libraries()])))
    elif missing:
        print(describe_missing(missing))
    if not missing:
        return 0
    return 2 if SystemLibrary.glib in missing else 1


if __name__ == "__main__":
    sys.exit(main())
