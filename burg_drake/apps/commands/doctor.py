"""`burg-drake doctor`: what is installed, what is missing for which feature, how to install it."""

from __future__ import annotations

import argparse
import functools
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from burg_drake import __version__
from burg_drake.apps import options
from burg_drake.core import AllocatorSettings
from burg_drake.system_libraries import (
    SystemLibrary,
    apt_command,
    missing_import_libraries,
    missing_render_libraries,
    missing_useful_libraries,
)

if TYPE_CHECKING:
    from packaging.requirements import Requirement

PACKAGE_NAME = "burg-drake"  # Name of this package in package indexes.


def installed_version(package: str) -> str | None:
    """The installed version of a package; None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


@functools.cache
def import_error(modules: str) -> str | None:
    """Why modules cannot be imported, in one line; None if they can.

    Args:
        modules: names as after `import`.
    """
    import_timeout = 60.0  # Seconds.
    try:
        tried = subprocess.run(
            [sys.executable, "-c", f"import {modules}"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=import_timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"import {modules} takes more than {import_timeout:g} s"
    if tried.returncode < 0:
        return f"import {modules} ends the process (signal {-tried.returncode})"
    lines = tried.stderr.strip().splitlines() or ["no reason given"]
    return lines[-1] if tried.returncode else None


def unmet_requirements(extra: str = "") -> list[str]:
    """Requirements of burg_drake or one of its extras that this environment does not meet.

    Returns:
        Texts such as `mujoco>=3.10` and `viser<1.2,>=1.1 (1.3.0 is installed)`.
    """
    unmet = []
    for requirement in _requirements(extra):
        found = installed_version(requirement.name)
        if found is None:
            unmet.append(str(requirement))
        elif not requirement.specifier.contains(found, prereleases=True):
            unmet.append(f"{requirement} ({found} is installed)")
    return unmet


def _requirements(extra: str) -> list[Requirement]:
    """The declared requirements of an extra, or of the package if empty; none if not installed."""
    from packaging.requirements import Requirement

    try:
        declared = importlib.metadata.requires(PACKAGE_NAME) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    found = []
    for requirement in map(Requirement, declared):
        marker, requirement.marker = requirement.marker, None
        if f'extra == "{extra}"' in str(marker) if extra else marker is None:
            found.append(requirement)
    return found


def install_command(extra: str, installed: list[str]) -> str:
    """The command that installs an extra into the environment of this process.

    Args:
        extra: such as `mujoco`.
        installed: installed extras, which uv would else remove.
    """
    if _is_pipx_environment():
        quoted = [f"'{requirement}'" for requirement in _requirements(extra)]
        return f"pipx inject {PACKAGE_NAME} {' '.join(quoted)}"
    if _is_uv_tool_environment():
        return f"uv tool install '{PACKAGE_NAME}[{','.join([*installed, extra])}]'"
    return f"{pip_install()} '{PACKAGE_NAME}[{extra}]'"


def pip_install() -> str:
    """The command that installs packages into the environment of this process."""
    if _is_pipx_environment():
        return f"pipx runpip {PACKAGE_NAME} install"
    if _is_uv_tool_environment():
        return f"uv pip install --python {sys.prefix}"
    return "pip install" if importlib.util.find_spec("pip") else "uv pip install"


def _is_pipx_environment() -> bool:
    return Path(sys.prefix, "pipx_metadata.json").exists()


def _is_uv_tool_environment() -> bool:
    return Path(sys.prefix, "uv-receipt.toml").exists()


Finding = Literal["ok", "missing", "broken", "low"]

COMPILED_MODULES = "numpy, cv2, coacd, embreex, manifold3d, h5py"
"""Required modules with compiled code; modules in pure Python rarely fail to import."""
BYTES_PER_GIB = 1 << 30
LIMIT_FILES = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files with the memory limit of control groups, versions 2 and 1."""
QUOTA_FILE = Path("/sys/fs/cgroup/cpu.max")  # CPU quota of control groups, version 2.


@dataclass(frozen=True)
class FeatureCheck:
    """The state of one feature.

    Attributes:
        feature: its purpose.
        state: ok, missing, broken (installed, but does not work), or low.
        found: version, path or number, or why it does not work.
        remedy: what to do; empty if nothing.
        required: whether `burg-drake evaluate` needs it.
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
class OptionalFeature:
    """An optional feature, installed by an extra of burg_drake.

    Attributes:
        name: name of the extra.
        feature: its purpose.
        package: package whose version is shown.
        modules: imported as a test: compiled ones, which fail most often and load fast.
    """

    name: str
    feature: str
    package: str
    modules: str


OPTIONAL_FEATURES = (
    OptionalFeature("mujoco", "second opinion by MuJoCo", "mujoco", "mujoco"),
    OptionalFeature("gpu", "many trials at once on a card", "mujoco-warp", "warp"),
    OptionalFeature("ui", "scene editor (burg-drake setup)", "viser", "msgspec"),
    OptionalFeature("parquet", "tables in Parquet", "pyarrow", "pyarrow.lib"),
    OptionalFeature("benchmark", "benchmarks of grasp planners", "msgpack", "websockets"),
    OptionalFeature("frame", "results in pandas", "pandas", "pandas"),
    OptionalFeature("dask", "clusters over Dask", "distributed", "msgpack"),
    OptionalFeature("jobqueue", "batch systems (SLURM, PBS)", "dask-jobqueue", "cryptography"),
    OptionalFeature("usd", "export to USD", "usd-core", "pxr.Usd"),
)
"""Optional features, and the packages that they need."""
BLENDER_EXTRA = OptionalFeature("blender", "photorealistic images (Blender)", "bpy", "bpy")
"""Photorealistic rendering, by a Blender program or by the package bpy."""


def all_checks() -> list[FeatureCheck]:
    """All checks, in the order of the table."""
    installed = [extra for extra in OPTIONAL_FEATURES if installed_version(extra.package)]
    tried = ["pydrake.common", COMPILED_MODULES, *(extra.modules for extra in installed)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # each starts a process; results are cached
        list(pool.map(import_error, tried))
    names = [extra.name for extra in installed]
    gpu = "NVIDIA" if Path("/dev/nvidia0").exists() else "no NVIDIA card"
    return [
        *(_check_python(), _check_drake(), _check_packages(), _check_cores_and_memory()),
        *(_check_disk(), _check_cache(), _check_renderer(), _check_allocator()),
        *(_check_extra(extra, names) for extra in OPTIONAL_FEATURES),
        *(_check_blender(names), _check_ros(), _check_cameras(), _check_browser()),
        FeatureCheck("GPU", "ok", f"{gpu}; none is needed, physics runs on the processor"),
    ]


def _check_python() -> FeatureCheck:
    min_python = (3, 11)
    found = platform.python_version()
    if sys.version_info[:2] >= min_python:
        return FeatureCheck("Python", "ok", found, required=True)
    oldest = ".".join(map(str, min_python))
    return FeatureCheck("Python", "low", found, f"install Python {oldest} or later", required=True)


def _check_drake() -> FeatureCheck:
    feature = "simulation (Drake)"
    found = installed_version("drake")
    if missing := missing_import_libraries():
        lacking = f"lacks {', '.join(missing)}"
        return FeatureCheck(feature, "broken", lacking, _libraries_remedy(missing), True)
    if error := import_error("pydrake.common"):
        remedy = f"{pip_install()} drake"
        if not found:
            return FeatureCheck(feature, "missing", "", remedy, True)
        return FeatureCheck(feature, "broken", error, remedy, True)
    return FeatureCheck(feature, "ok", f"drake {found or 'of unknown version'}", required=True)


def _check_packages() -> FeatureCheck:
    feature = "packages it always needs"
    if unmet := unmet_requirements():
        remedy = f"{pip_install()} --upgrade burg-drake"
        return FeatureCheck(feature, "missing", ", ".join(unmet), remedy, True)
    if error := import_error(COMPILED_MODULES):
        remedy = f"{pip_install()} --force-reinstall burg-drake"
        return FeatureCheck(feature, "broken", error, remedy, True)
    found = f"numpy {installed_version('numpy')}, scipy {installed_version('scipy')}, ..."
    return FeatureCheck(feature, "ok", found, required=True)


def _check_cores_and_memory() -> FeatureCheck:
    min_memory = 2.0  # GiB. A worker takes 0.3 to 0.5 GiB.
    memory = usable_memory() / BYTES_PER_GIB
    found = f"{usable_cores():g} cores, {memory:.1f} GiB of memory"
    if memory < min_memory:
        return FeatureCheck("processor", "low", found, "use --workers 1")
    return FeatureCheck("processor", "ok", found)


def _check_disk() -> FeatureCheck:
    min_free = 1.0  # GiB.
    here = Path.cwd()
    free = shutil.disk_usage(here).free / BYTES_PER_GIB
    if not can_write_in(here):
        return FeatureCheck(
            "disk", "broken", f"{here} cannot be written to", "work in another folder"
        )
    if free < min_free:
        return FeatureCheck("disk", "low", f"{free:.1f} GiB free here", "free some space")
    return FeatureCheck("disk", "ok", f"{free:.0f} GiB free here")


def _check_cache() -> FeatureCheck:
    try:
        from burg_drake.core import BurgError, cache_folder
    except ImportError as error:  # numpy is broken; another check reports it
        return FeatureCheck("cache", "broken", str(error))
    remedy = "set BURG_DRAKE_CACHE to a folder"
    try:
        folder = cache_folder()
    except BurgError as error:
        return FeatureCheck("cache", "broken", str(error), remedy)
    if folder is None:
        return FeatureCheck("cache", "ok", "off, by BURG_DRAKE_CACHE")
    if not can_write_in(folder):
        return FeatureCheck("cache", "broken", f"{folder} cannot be written to", remedy)
    return FeatureCheck("cache", "ok", f"{folder_bytes(folder) / 1e6:.0f} MB in {folder}")


def _libraries_remedy(missing: list[str]) -> str:
    return (
        apt_command(missing)
        if shutil.which("apt-get")
        else "install with the package manager of this system"
    )


def _check_renderer() -> FeatureCheck:
    feature = "camera images (Drake's renderer)"
    if missing := missing_render_libraries():
        return FeatureCheck(feature, "missing", ", ".join(missing), _libraries_remedy(missing))
    return FeatureCheck(feature, "ok")


def _check_allocator() -> FeatureCheck:
    feature = "faster memory (mimalloc)"
    if sys.platform != "linux":
        return FeatureCheck(feature, "ok", "not used on this system")
    from burg_drake.core import worker_preload

    if missing_useful_libraries():
        library = SystemLibrary.atomic
        return FeatureCheck(feature, "missing", library, _libraries_remedy([library]))
    if found := worker_preload().get(AllocatorSettings.preload_variable):
        return FeatureCheck(feature, "ok", Path(found.rpartition(":")[2]).name)
    remedy = f"{pip_install()} cmeel-mimalloc"
    return FeatureCheck(feature, "missing", "trials are a quarter slower", remedy)


def _check_extra(extra: OptionalFeature, installed: list[str]) -> FeatureCheck:
    remedy = install_command(extra.name, [name for name in installed if name != extra.name])
    found = installed_version(extra.package)
    if found is None:
        return FeatureCheck(extra.feature, "missing", "", remedy)
    if unmet := unmet_requirements(extra.name):
        return FeatureCheck(extra.feature, "broken", f"needs {', '.join(unmet)}", remedy)
    if error := import_error(extra.modules):
        return FeatureCheck(extra.feature, "broken", error, remedy)
    return FeatureCheck(extra.feature, "ok", f"{extra.package} {found}")


def _check_blender(installed: list[str]) -> FeatureCheck:
    variable = "BURG_DRAKE_BLENDER"
    bpy_pythons = ((3, 11), (3, 13))  # Python versions for which bpy has wheels.
    feature = BLENDER_EXTRA.feature
    if given := os.environ.get(variable):
        if program := shutil.which(given):
            return FeatureCheck(feature, "ok", program)
        remedy = f"set {variable} to a Blender, or to a Python that has bpy"
        return FeatureCheck(feature, "broken", f"{variable}={given} is not a program", remedy)
    major, minor = sys.version_info[:2]
    if importlib.util.find_spec("bpy") is None and (major, minor) not in bpy_pythons:
        found = f"bpy has no wheel for Python {major}.{minor}"
        return FeatureCheck(feature, "missing", found, f"install Blender and set {variable} to it")
    return _check_extra(BLENDER_EXTRA, installed)


def _check_ros() -> FeatureCheck:
    from burg_drake.ros import CLIENT_LIBRARIES, ROS_1_HINT, ROS_2_HINT, SYSTEM_PACKAGES

    feature = "ROS node (burg-drake ros)"
    for number, client in sorted(CLIENT_LIBRARIES.items(), reverse=True):
        places = [str(SYSTEM_PACKAGES)] if (SYSTEM_PACKAGES / client).is_dir() else []
        if places or importlib.util.find_spec(client):
            path = f"sys; sys.path += {places!r}; import {client}"
            if error := import_error(path):
                return FeatureCheck(feature, "broken", error, (ROS_1_HINT, ROS_2_HINT)[number - 1])
            return FeatureCheck(feature, "ok", f"ROS {number} ({client})")
    return FeatureCheck(feature, "missing", "", f"{ROS_2_HINT}; {ROS_1_HINT}")


def _check_cameras() -> FeatureCheck:
    feature = "cameras"
    if sys.platform != "linux":
        return FeatureCheck(feature, "ok", "burg-drake camera list finds them")
    found = sorted(str(path) for path in Path("/dev").glob("video*"))
    if not found:
        return FeatureCheck(feature, "missing", "", "plug one in; photos and videos need none")
    closed = [path for path in found if not os.access(path, os.R_OK | os.W_OK)]
    if closed:
        remedy = "sudo usermod -aG video $USER, then log in again"
        return FeatureCheck(feature, "broken", f"no permission for {', '.join(closed)}", remedy)
    return FeatureCheck(feature, "ok", ", ".join(found))


def _check_browser() -> FeatureCheck:
    programs = ("chromium", "chromium-browser", "google-chrome", "firefox", "microsoft-edge")
    if sys.platform == "darwin":
        return FeatureCheck("browser", "ok", "the system's")
    found = next(filter(None, map(shutil.which, (*programs, "safari"))), None)
    if found is None:
        remedy = "open pages on another computer; --html writes files"
        return FeatureCheck("browser", "missing", "", remedy)
    return FeatureCheck("browser", "ok", found)


def doctor_summary(checks: list[FeatureCheck]) -> Iterator[str]:
    """The summary of all checks, in one or two lines."""
    prevented = [check.feature for check in checks if check.prevents_evaluation]
    missing = [check.feature for check in checks if check.state != "ok" and not check.required]
    if prevented:
        yield f"burg-drake evaluate cannot run: see {', '.join(prevented)} above."
    else:
        yield "burg-drake evaluate has all that it needs. Try: burg-drake demo"
    if missing:
        yield "Install the rest only if you want the feature."


def usable_cores() -> float:
    """Number of cores that this process may use, by machine, affinity and control group."""
    cores = float(len(os.sched_getaffinity(0))) if sys.platform == "linux" else os.cpu_count() or 1
    try:
        quota, period = QUOTA_FILE.read_text().split()
        return min(cores, int(quota) / int(period))
    except (OSError, ValueError):  # none, or `max`
        return cores


def usable_memory() -> int:
    """Memory that this process may use [bytes], by machine and control group."""
    found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for path in LIMIT_FILES:
        try:
            found = min(found, int(Path(path).read_text()))
        except (OSError, ValueError):  # none, or `max`
            continue
    return found


def can_write_in(folder: Path) -> bool:
    """Whether files can be created in a folder, or the folder in its nearest existing parent."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def folder_bytes(folder: Path) -> int:
    """Total size of the files directly in a folder."""
    total = 0
    for entry in folder.iterdir() if folder.is_dir() else ():
        try:
            total += entry.stat().st_size
        except OSError:  # removed meanwhile, by another process
            continue
    return total


def add_doctor_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake doctor`."""
    parser.epilog = options.examples_text(
        "burg-drake doctor",
        "burg-drake doctor --json",
        "",
        "It changes nothing and does not use the network. Exit code 1 if `evaluate` cannot run.",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run_doctor(arguments: argparse.Namespace) -> int:
    """Prints the table of checks; returns 1 if something that `evaluate` needs is missing."""
    checks = all_checks()
    if arguments.json:
        found = {"burg_drake": __version__, "checks": [asdict(check) for check in checks]}
        print(json.dumps(found, indent=2))
    else:
        width = max(len(check.feature) for check in checks)
        print(f"burg_drake {__version__}\n")
        for check in checks:
            state = "optional" if check.state == "missing" and not check.required else check.state
            print(f"{state:<8}  {check.feature:<{width}}  {check.found}".rstrip())
            if check.remedy:
                print(f"{'':<8}  {'':<{width}}  -> {check.remedy}")
        print("", *doctor_summary(checks), sep="\n")
    return 1 if any(check.prevents_evaluation for check in checks) else 0
