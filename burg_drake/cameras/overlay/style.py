"""How an overlay looks."""

from __future__ import annotations

import math
from dataclasses import dataclass

from burg_drake.core import DEGREES, MILLIMETRES, InvalidInputError, setting


@dataclass(frozen=True, kw_only=True)
class OverlayStyle:
    """What is drawn of a scene over an image.

    Attributes:
        opacity: of the objects' surfaces, 0 (outlines alone) to 1.
        outline_width: of the outlines [pixels]; inner lines are thinner.
        names: write each object's name.
        footprints: draw where objects touch the board.
        errors: draw how far each object stands from its place, where a placement check is given.
        tolerance: displacement up to which an object counts as placed [m].
        angle_tolerance: the same for its turn [rad].
        shown: instances that are drawn, as if there were no others; all if None.
    """

    opacity: float = setting(
        0.45,
        "opacity of the drawn objects, 0 (outlines) to 1",
        metavar="X",
        low=0,
        high=1,
        noun="a number",
    )
    outline_width: float = 2.0
    names: bool = True
    footprints: bool = True
    errors: bool = True
    tolerance: float = setting(
        1e-3,
        "objects within this distance of their target are green",
        unit=MILLIMETRES,
        metavar="X",
        above=0,
    )
    angle_tolerance: float = setting(
        math.radians(1.0),
        "objects within this angle of their target are green",
        unit=DEGREES,
        name="tolerance_deg",
        metavar="X",
        above=0,
    )
    shown: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.opacity <= 1.0:
            raise InvalidInputError(f"opacity {self.opacity:g} of an overlay must be 0 to 1")
        if not 0.0 <= self.outline_width <= 20.0:
            raise InvalidInputError(
                f"outline_width {self.outline_width:g} of an overlay must be 0 to 20 pixels"
            )
        if min(self.tolerance, self.angle_tolerance) < 0.0:
            raise InvalidInputError("tolerances of an overlay must be at least 0")
