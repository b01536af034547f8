"""The machine: processors, memory, disk, cache, cameras, browser, as the operating system tells."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

GIB = 1 << 30
CGROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
CGROUP_CPU = Path("/sys/fs/cgroup/cpu.max")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "microsoft-edge", "safari")


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
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)
