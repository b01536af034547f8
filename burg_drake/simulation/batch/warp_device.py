"""The devices of Warp that trials run on, and the versions of its packages."""

from __future__ import annotations

import fcntl
import importlib.metadata
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.core import InvalidInputError, MissingDependencyError, list_names

if TYPE_CHECKING:
    import warp as wp

REQUIRED_VERSIONS = {"mujoco-warp": "4.0.0", "warp-lang": "1.19.0"}
"""`fixed_order` replaces private functions of these versions."""


def require_warp() -> None:
    """Requires the packages of parallel worlds, in the versions for which they are written.

    Raises:
        MissingDependencyError: they are missing, or others are installed.
    """
    for package, version in REQUIRED_VERSIONS.items():
        try:
            found = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found = ""
        if found != version:
            here = f"; {found} is installed" if found else ", which is not installed"
            raise MissingDependencyError(
                f"engine mujoco-gpu needs {package} {version}{here}; install it with"
                " pip install 'burg-drake[gpu]'"
            )


def find_devices(name: str | None = None) -> list[wp.Device]:
    """Finds a device by its name, or all cards.

    Args:
        name: `cuda:0` and so on, or `cpu`; all cards if None.

    Raises:
        MissingDependencyError: see `require_warp`.
        InvalidInputError: there is no such device, no card, or its driver is too old.
    """
    require_warp()
    import warp as wp

    wp.config.quiet = True
    wp.config.log_level = wp.LOG_ERROR
    with _without_stderr():  # There Warp says that a machine has no card.
        wp.init()
    known = {device.alias: device for device in wp.get_devices()}
    cards = [device for device in known.values() if device.is_cuda]
    if name is None and not cards:
        raise InvalidInputError(
            "engine mujoco-gpu needs an NVIDIA card, and there is none here; use engine mujoco, or"
            " give device cpu to try it without a card"
        ).about("device")
    if name is not None and name not in known:
        raise InvalidInputError(
            f"there is no device {name!r} here; there is {list_names(list(known))}"
        ).about("device")
    chosen = cards if name is None else [known[name]]
    if chosen[0].is_cuda and not wp.is_conditional_graph_supported():
        raise InvalidInputError(
            "engine mujoco-gpu needs an NVIDIA driver that supports CUDA 12.4 or later; update the"
            " driver, or use engine mujoco"
        ).about("engine")
    return chosen


def kernels_are_compiled(device: wp.Device) -> bool:
    """Whether a batch of trials has run on a device of `find_devices`, so that its kernels are in
    Warp's cache; others may still have to be compiled, as some depend on the number of joints."""
    return _compiled_file(device).exists()


def record_compilation(device: wp.Device) -> None:
    """Records in Warp's cache that all kernels of a batch are compiled for a device."""
    file = _compiled_file(device)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()


def _compiled_file(device: wp.Device) -> Path:
    """File that says so. It is in the folder of the kernels of trials, so that it goes with them if
    the cache is cleared or they change."""
    import warp as wp

    from burg_drake.simulation.batch import trial_kernels

    module = wp.get_module(trial_kernels.__name__).get_module_identifier()
    target = f"sm{device.arch}" if device.is_cuda else "cpu"
    return Path(wp.config.kernel_cache_dir, module, f"batch_compiled_{target}")


@contextmanager
def _without_stderr() -> Iterator[None]:
    """Discards what libraries write to standard error meanwhile."""
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


@contextmanager
def claimed(devices: Sequence[wp.Device]) -> Iterator[wp.Device]:
    """Waits until no other process of this machine uses one of the devices, and claims it."""
    between_tries = 0.02  # Seconds.
    if not devices[0].is_cuda:
        yield devices[0]
        return
    with ExitStack() as files:
        locks = [files.enter_context(_lock_file(device).open("a")) for device in devices]
        while True:
            for device, lock in zip(devices, locks, strict=True):
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    continue
                yield device
                return
            time.sleep(between_tries)


def _lock_file(card: wp.Device) -> Path:
    return Path(tempfile.gettempdir()) / f"burg_drake_{os.getuid()}_{card.uuid}.lock"


def describe_devices(devices: Sequence[wp.Device]) -> str:
    """Names of devices, and for cards the versions of CUDA: the newest one that their driver
    supports, and the one that Warp is built with."""
    import warp as wp

    if not devices[0].is_cuda:
        return "cpu"
    supported, built = (
        ".".join(map(str, version))
        for version in (wp.get_cuda_driver_version(), wp.get_cuda_toolkit_version())
    )
    names = list_names(sorted({device.name for device in devices}))
    return f"{names} (driver supports CUDA {supported}, Warp is built with CUDA {built})"
