"""The camera that a verb looks through, and what is known of its optics."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics


def chosen_intrinsics(arguments: argparse.Namespace) -> Intrinsics:
    """Those that --intrinsics names, or that the simulated camera of --camera has.

    Raises:
        InvalidInputError: neither.
    """
    from burg_drake.cameras.optics import SIMULATED, load_intrinsics

    if arguments.intrinsics is not None:
        return load_intrinsics(arguments.intrinsics)
    if not arguments.camera.startswith(SIMULATED):
        raise InvalidInputError(
            f"camera {arguments.camera} needs --intrinsics FILE; burg-drake camera calibrate makes"
            " one"
        )
    return load_intrinsics(arguments.camera)
