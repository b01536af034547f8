"""What a run asks about a grasp beside the clearance of the hand: its mode."""

from __future__ import annotations

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import MODES, Mode
from burg_drake.station.document import Station


def mode_for(station: Station, asked: Mode | None = None) -> Mode:
    """The mode of a run.

    Args:
        station: where it takes place.
        asked: what the user wants; None for `reach` where there is an arm, else `hand`.

    Raises:
        InvalidInputError: there is no such mode, or it needs an arm that the station lacks.
    """
    has_arm = station.document.arm is not None
    if asked is None:
        return "reach" if has_arm else "hand"
    if asked not in MODES:
        raise InvalidInputError(f"mode is {asked!r}; give {', '.join(MODES[:-1])} or {MODES[-1]}")
    if asked != "hand" and not has_arm:
        raise InvalidInputError(
            f"mode {asked!r} needs an arm, which station {station.name!r} lacks; give mode 'hand'"
        )
    return asked
