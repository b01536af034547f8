"""What commands need to know of the world around a scene: the station, contact, and how objects may
move."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from burg_drake.compose.document.checker import SceneChecker
from burg_drake.compose.document.state import State
from burg_drake.core import FieldError
from burg_drake.core.paths import require_name
from burg_drake.station.document import MODEL_NAMES, Station


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a command is applied in.

    Attributes:
        station: where the scene stands.
        planar: objects that are moved keep their tilt, and their height unless they are raised.
        path: of the scene's file, for messages.
        checker: knows what touches what.
    """

    station: Station
    planar: bool
    path: Path
    checker: SceneChecker

    def taken_names(self, state: State) -> Collection[str]:
        """Names that a new instance may not have."""
        return {*state.instances, *MODEL_NAMES, *self.station.document.background}

    def require_unused(self, name: str, state: State) -> None:
        """Refuses a name for an instance.

        Raises:
            FieldError: it is not a name, or something else is called so.
        """
        require_name(name)
        if name in state.instances:
            raise FieldError(f"name {name!r} is used already; choose another one")
        if name in self.taken_names(state):
            raise FieldError(
                f"name {name!r} is used by station {self.station.name!r}; choose another one"
            )
