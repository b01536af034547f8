"""Python packages: whether they are there, whether they can be imported, how to get them.

Nothing is imported here. A package that is installed and broken may end the process that imports
it, so each is tried in a process of its own.
"""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

OWN_PACKAGE = "burg-drake"
IMPORT_TIMEOUT = 60.0  # seconds


def version(package: str) -> str | None:
    """The installed version of a package; None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


@functools.cache
def import_error(modules: str) -> str | None:
    """Why modules cannot be imported, in one line; None if they can.

    Args:
        modules: as after `import`.
    """
    try:
        tried = subprocess.run(
            [sys.executable, "-c", f"import {modules}"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=IMPORT_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"import {modules} takes more than {IMPORT_TIMEOUT:g} s"
    if tried.returncode < 0:
        return f"import {modules} ends the process (signal {-tried.returncode})"
    lines = tried.stderr.strip().splitlines() or ["no reason given"]
    return lines[-1] if tried.returncode else None


def unmet_requirements(extra: str = "") -> list[str]:
    """What burg_drake, or an extra of it, needs and this environment does not have.

    Returns:
        Such as `mujoco>=3.10` and `viser>=1.1,<1.2 (1.3.0 is installed)`.
    """
    unmet = []
    for requirement in _requirements(extra):
        name, bounds = re.fullmatch(r"([\w.-]+)(?:\[.*?\])?\s*(.*)", requirement).groups()  # type: ignore[union-attr]
        found = version(name)
        if found is None:
            unmet.append(requirement)
        elif not _is_within(found, bounds):
            unmet.append(f"{requirement} ({found} is installed)")
    return unmet


def _requirements(extra: str) -> list[str]:
    """What is declared for an extra, or for all if it is empty; none in a checkout on the path."""
    try:
        declared = importlib.metadata.requires(OWN_PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    found = []
    for requirement in declared:
        needed, _, marker = requirement.partition(";")
        named = re.search(r"extra == ['\"](.*?)['\"]", marker)
        if (named[1] if named else marker) == extra:
            found.append(needed.strip())
    return found


def _is_within(found: str, bounds: str) -> bool:
    """Whether a version is within bounds such as `>=1.1,<1.2`."""
    limits = re.findall(r"(>=|<)\s*([\d.]+)", bounds)
    ours = _numbers(found)
    return all((ours >= _numbers(v)) == (operator == ">=") for operator, v in limits)


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", text.partition("+")[0]))


def how_to_install(extra: str, installed: list[str]) -> str:
    """The command that brings an extra into the environment that this process runs in.

    Args:
        extra: such as `mujoco`.
        installed: extras that are there, and that uv would remove.
    """
    if _made_by_pipx():
        return f"pipx inject {OWN_PACKAGE} {' '.join(map(_quoted, _requirements(extra)))}"
    if _made_by_uv_tool():
        return f"uv tool install '{OWN_PACKAGE}[{','.join([*installed, extra])}]'"
    return f"{pip_install()} '{OWN_PACKAGE}[{extra}]'"


def pip_install() -> str:
    """The command that installs packages into the environment that this process runs in."""
    if _made_by_pipx():
        return f"pipx runpip {OWN_PACKAGE} install"
    if _made_by_uv_tool():
        return f"uv pip install --python {sys.prefix}"
    return "pip install" if importlib.util.find_spec("pip") else "uv pip install"


def _made_by_pipx() -> bool:
    return Path(sys.prefix, "pipx_metadata.json").exists()


def _made_by_uv_tool() -> bool:
    return Path(sys.prefix, "uv-receipt.toml").exists()


def _quoted(requirement: str) -> str:
    return f"'{requirement}'"
