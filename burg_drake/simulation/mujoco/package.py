"""The package mujoco, which need not be installed."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from burg_drake.core import MissingDependencyError


def require_mujoco() -> None:
    """Says how to install the package, if it is missing.

    Raises:
        MissingDependencyError: it is.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise MissingDependencyError(
            "engine mujoco needs the package mujoco; install it with"
            " pip install 'burg-drake[mujoco]'"
        )


def load_mujoco() -> Any:
    """The module `mujoco`. What it warns of is read from its data: it writes no log file.

    Raises:
        MissingDependencyError: it is not installed.
    """
    require_mujoco()
    module = importlib.import_module("mujoco")
    module.set_mju_user_warning(_ignore)
    return module


def _ignore(message: str) -> None:
    """Takes a warning."""
