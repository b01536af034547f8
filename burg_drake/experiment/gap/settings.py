"""Which steps the gap is measured in."""

from __future__ import annotations

from dataclasses import dataclass, field

from burg_drake.core import InvalidInputError, setting
from burg_drake.core.grasps import Mode
from burg_drake.experiment.gap.placement_noise import PlacementNoise


@dataclass(frozen=True, kw_only=True)
class GapSettings:
    """Which steps there are.

    Attributes:
        last: the last mode; `arm` where there is an arm, else `hand`, if None.
        noise: of the objects' places. The hand goes where it was planned to go.
        samples: number of displaced scenes; 0 leaves the step out.
    """

    last: Mode | None = None
    noise: PlacementNoise = field(default_factory=PlacementNoise)
    samples: int = setting(
        5, "number of displaced scenes; 0 leaves the step out", metavar="K", low=0
    )

    def __post_init__(self) -> None:
        if self.samples < 0:
            raise InvalidInputError(f"samples is {self.samples}; give 0 or more")
