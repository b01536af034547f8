"""What the doctor looks at, one check for each feature."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from burg_drake.apps.doctor.packages import (
    how_to_install,
    import_error,
    pip_install,
    unmet_requirements,
    version,
)
from burg_drake.system_libraries import (
    ATOMIC,
    apt_command,
    missing_import_libraries,
    missing_render_libraries,
    missing_useful_libraries,
)

Finding = Literal["ok", "missing", "broken", "low"]

OLDEST_PYTHON = (3, 11)
DRAKE_MODULES = "pydrake.common"
ALWAYS_NEEDED_MODULES = "numpy, cv2, coacd, embreex, manifold3d, h5py"
"""Those that are compiled; the others hardly break."""
MIN_MEMORY = 2.0  # GiB; a worker takes 0.3 to 0.5
MIN_DISK = 1.0  # GiB
BYTES_PER_GIB = 1 << 30
CGROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
CGROUP_CPU = Path("/sys/fs/cgroup/cpu.max")
BROWSER_PROGRAMS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "firefox",
    "microsoft-edge",
    "safari",
)
RECIPE_FOR_LIBRARIES = "install with the package manager of this system"


@dataclass(frozen=True)
class Check:
    """What was found about one feature.

    Attributes:
        feature: what a person wants.
        state: ok, missing, broken (it is installed, and does not work), or low.
        found: version, path or number; why it does not work.
        remedy: what to do, if anything.
        required: `burg-drake evaluate` needs it.
    """

    feature: str
    state: Finding
    found: str = ""
    remedy: str = ""
    required: bool = False

    @property
    def prevents_evaluation(self) -> bool:
        """Whether `evaluate` cannot run."""
        return self.required and self.state != "ok"


@dataclass(frozen=True)
class Extra:
    """An optional part: packages that an extra of burg_drake brings.

    Attributes:
        name: of the extra.
        feature: what it is for.
        package: whose version is told.
        modules: tried by an import: those that are compiled, which break most and load fast.
    """

    name: str
    feature: str
    package: str
    modules: str


OPTIONAL_PARTS = (
    Extra("mujoco", "second opinion by MuJoCo", "mujoco", "mujoco"),
    Extra("ui", "scene editor (burg-drake setup)", "viser", "msgspec"),
    Extra("parquet", "tables in Parquet", "pyarrow", "pyarrow.lib"),
    Extra("frame", "results in pandas", "pandas", "pandas"),
    Extra("dask", "clusters over Dask", "distributed", "msgpack"),
    Extra("jobqueue", "batch systems (SLURM, PBS)", "dask-jobqueue", "cryptography"),
    Extra("usd", "export to USD", "usd-core", "pxr.Usd"),
)
BLENDER_PART = Extra("blender", "photorealistic images (Blender)", "bpy", "bpy")
BLENDER_VARIABLE = "BURG_DRAKE_BLENDER"
BLENDER_PYTHONS = ((3, 11), (3, 13))
"""Versions of Python that bpy has wheels for."""


def all_checks() -> list[Check]:
    """Everything, in the order in which it is shown."""
    installed = [extra for extra in OPTIONAL_PARTS if version(extra.package)]
    tried = [DRAKE_MODULES, ALWAYS_NEEDED_MODULES, *(extra.modules for extra in installed)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # of processes; answers are kept
        list(pool.map(import_error, tried))
    names = [extra.name for extra in installed]
    checks = [_python(), _drake(), _packages(), _cores_and_memory(), _disk(), _cache()]
    checks += [_renderer(), _allocator(), *(_extra(extra, names) for extra in OPTIONAL_PARTS)]
    return [*checks, _blender(names), _ros(), _cameras(), _browser(), _gpu()]


def _python() -> Check:
    found = platform.python_version()
    if sys.version_info[:2] >= OLDEST_PYTHON:
        return Check("Python", "ok", found, required=True)
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return Check("Python", "low", found, f"install Python {oldest} or later", required=True)


def _drake() -> Check:
    feature = "simulation (Drake)"
    found = version("drake")
    if missing := missing_import_libraries():
        return Check(
            feature, "broken", f"lacks {', '.join(missing)}", _libraries(missing), required=True
        )
    install = pip_install()
    if error := import_error(DRAKE_MODULES):
        state: Finding = "broken" if found else "missing"
        return Check(feature, state, error if found else "", f"{install} drake", required=True)
    return Check(feature, "ok", f"drake {found or 'of unknown version'}", required=True)


def _packages() -> Check:
    feature = "packages it always needs"
    install = pip_install()
    if unmet := unmet_requirements():
        return Check(feature, "missing", ", ".join(unmet), f"{install} --upgrade burg-drake", True)
    if error := import_error(ALWAYS_NEEDED_MODULES):
        return Check(feature, "broken", error, f"{install} --force-reinstall burg-drake", True)
    return Check(
        feature, "ok", f"numpy {version('numpy')}, scipy {version('scipy')}, ...", "", True
    )


def _cores_and_memory() -> Check:
    memory = usable_memory() / BYTES_PER_GIB
    found = f"{usable_cores():g} cores, {memory:.1f} GiB of memory"
    if memory < MIN_MEMORY:
        return Check("processor", "low", found, "use --workers 1")
    return Check("processor", "ok", found)


def _disk() -> Check:
    here = Path.cwd()
    free = free_bytes(here) / BYTES_PER_GIB
    found = f"{free:.0f} GiB free here"
    if not can_write_in(here):
        return Check("disk", "broken", f"{here} cannot be written to", "work in another folder")
    if free < MIN_DISK:
        return Check("disk", "low", f"{free:.1f} GiB free here", "free some space")
    return Check("disk", "ok", found)


def _cache() -> Check:
    try:
        from burg_drake.core import BurgError, cache_folder
    except ImportError as error:  # numpy is broken, which another check tells
        return Check("cache", "broken", str(error))
    try:
        folder = cache_folder()
    except BurgError as error:
        return Check("cache", "broken", str(error), "set BURG_DRAKE_CACHE to a folder")
    if folder is None:
        return Check("cache", "ok", "off, by BURG_DRAKE_CACHE")
    if not can_write_in(folder):
        return Check(
            "cache", "broken", f"{folder} cannot be written to", "set BURG_DRAKE_CACHE to a folder"
        )
    return Check("cache", "ok", f"{folder_bytes(folder) / 1e6:.0f} MB in {folder}")


def _libraries(missing: list[str]) -> str:
    return apt_command(missing) if shutil.which("apt-get") else RECIPE_FOR_LIBRARIES


def _renderer() -> Check:
    feature = "camera images (Drake's renderer)"
    if missing := missing_render_libraries():
        return Check(feature, "missing", ", ".join(missing), _libraries(missing))
    return Check(feature, "ok")


def _allocator() -> Check:
    feature = "faster memory (mimalloc)"
    if sys.platform != "linux":
        return Check(feature, "ok", "not used on this system")
    from burg_drake.core.workers import PRELOAD, worker_preload

    if missing_useful_libraries():
        return Check(feature, "missing", ATOMIC, _libraries([ATOMIC]))
    if found := worker_preload().get(PRELOAD):
        return Check(feature, "ok", Path(found.rpartition(":")[2]).name)
    return Check(
        feature, "missing", "trials are a quarter slower", f"{pip_install()} cmeel-mimalloc"
    )


def _extra(extra: Extra, installed: list[str]) -> Check:
    remedy = how_to_install(extra.name, [name for name in installed if name != extra.name])
    found = version(extra.package)
    if found is None:
        return Check(extra.feature, "missing", "", remedy)
    if unmet := unmet_requirements(extra.name):
        return Check(extra.feature, "broken", f"needs {', '.join(unmet)}", remedy)
    if error := import_error(extra.modules):
        return Check(extra.feature, "broken", error, remedy)
    return Check(extra.feature, "ok", f"{extra.package} {found}")


def _blender(installed: list[str]) -> Check:
    given = os.environ.get(BLENDER_VARIABLE)
    if given:
        program = shutil.which(given)
        if program is None:
            return Check(
                BLENDER_PART.feature,
                "broken",
                f"{BLENDER_VARIABLE}={given} is not a program",
                f"set {BLENDER_VARIABLE} to a Blender, or to a Python that has bpy",
            )
        return Check(BLENDER_PART.feature, "ok", program)
    if importlib.util.find_spec("bpy") is None and sys.version_info[:2] not in BLENDER_PYTHONS:
        return Check(
            BLENDER_PART.feature,
            "missing",
            f"bpy has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]}",
            f"install Blender and set {BLENDER_VARIABLE} to it",
        )
    return _extra(BLENDER_PART, installed)


def _ros() -> Check:
    from burg_drake.ros import CLIENTS, ROS_1_HINT, ROS_2_HINT, SYSTEM_PACKAGES

    feature = "ROS node (burg-drake ros)"
    for number, client in sorted(CLIENTS.items(), reverse=True):
        places = [str(SYSTEM_PACKAGES)] if (SYSTEM_PACKAGES / client).is_dir() else []
        if places or importlib.util.find_spec(client):
            path = f"sys; sys.path += {places!r}; import {client}"
            if error := import_error(path):
                return Check(feature, "broken", error, (ROS_1_HINT, ROS_2_HINT)[number - 1])
            return Check(feature, "ok", f"ROS {number} ({client})")
    return Check(feature, "missing", "", f"{ROS_2_HINT}; {ROS_1_HINT}")


def _cameras() -> Check:
    feature = "cameras"
    if sys.platform != "linux":
        return Check(feature, "ok", "burg-drake camera list finds them")
    found = camera_devices()
    if not found:
        return Check(feature, "missing", "", "plug one in; photos and videos need none")
    closed = [path for path in found if not os.access(path, os.R_OK | os.W_OK)]
    if closed:
        remedy = "sudo usermod -aG video $USER, then log in again"
        return Check(feature, "broken", f"no permission for {', '.join(closed)}", remedy)
    return Check(feature, "ok", ", ".join(found))


def _browser() -> Check:
    found = browser()
    if found is None:
        return Check(
            "browser", "missing", "", "open pages on another computer; --html writes files"
        )
    return Check("browser", "ok", found)


def _gpu() -> Check:
    found = "NVIDIA" if Path("/dev/nvidia0").exists() else "no NVIDIA card"
    return Check("GPU", "ok", f"{found}; none is needed, physics runs on the processor")


def summary_lines(checks: list[Check]) -> Iterator[str]:
    """What it comes to, in a line or two."""
    prevented = [check.feature for check in checks if check.prevents_evaluation]
    missing = [check.feature for check in checks if check.state != "ok" and not check.required]
    if prevented:
        yield f"burg-drake evaluate cannot run: see {', '.join(prevented)} above."
    else:
        yield "burg-drake evaluate has all that it needs. Try: burg-drake demo"
    if missing:
        yield "Install the rest only if you want the feature."


def usable_cores() -> float:
    """Processors that this process may use: of the machine, its affinity, its control group."""
    cores = float(len(os.sched_getaffinity(0))) if sys.platform == "linux" else os.cpu_count() or 1
    try:
        quota, period = CGROUP_CPU.read_text().split()
        return min(cores, int(quota) / int(period))
    except (OSError, ValueError):  # none, or `max`
        return cores


def usable_memory() -> int:
    """Memory that this process may use [bytes]: of the machine, or of its control group."""
    found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for path in CGROUP_LIMITS:
        try:
            found = min(found, int(Path(path).read_text()))
        except (OSError, ValueError):  # none, or `max`
            continue
    return found


def can_write_in(folder: Path) -> bool:
    """Whether files can be made in a folder, or the folder in the nearest one that there is."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def free_bytes(folder: Path) -> int:
    """Free space of the disk that a folder is on."""
    return shutil.disk_usage(folder).free


def folder_bytes(folder: Path) -> int:
    """Size of the files that lie directly in a folder."""
    total = 0
    for entry in folder.iterdir() if folder.is_dir() else ():
        try:
            total += entry.stat().st_size
        except OSError:  # removed meanwhile, by another process
            continue
    return total


def camera_devices() -> list[str]:
    """Video devices of this machine; Linux names them, other systems do not."""
    return sorted(str(path) for path in Path("/dev").glob("video*"))


def browser() -> str | None:
    """A browser that is installed here."""
    if sys.platform == "darwin":
        return "the system's"
    return next((found for name in BROWSER_PROGRAMS if (found := shutil.which(name))), None)
