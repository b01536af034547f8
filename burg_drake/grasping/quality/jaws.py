"""What the analysis of a grip needs to know of a parallel hand: opening, force, pads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.core import InvalidInputError
from burg_drake.core.paths import NO_PACKAGES, Packages

if TYPE_CHECKING:
    from burg_drake.station.document import Hand

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Jaws:
    """Two flat, compliant pads that close symmetrically along x of the grasp frame G.

    Attributes:
        opening: smallest and largest distance between the pads [m].
        force: with which each pad presses [N].
        y, z: what the faces of the pads cover of G [m].
        foundation: pressure of a pad for each metre that it is indented [Pa/m]: its elastic modulus
            over the depth of its elastic layer.
    """

    opening: Interval
    force: float
    y: Interval
    z: Interval
    foundation: float

    def __post_init__(self) -> None:
        for name in ("opening", "y", "z"):
            low, high = getattr(self, name)
            if not low < high:
                raise InvalidInputError(
                    f"Jaws.{name} goes from {low:g} to {high:g} m; the second number must be"
                    " the larger one"
                )
        if self.opening[0] < 0.0:
            raise InvalidInputError(f"Jaws.opening starts at {self.opening[0]:g} m; give 0 or more")
        for name in ("force", "foundation"):
            if not getattr(self, name) > 0.0:
                raise InvalidInputError(f"Jaws.{name} is {getattr(self, name):g}; give more than 0")

    @property
    def pad_area(self) -> float:
        """Area of a pad's face [m^2]."""
        return (self.y[1] - self.y[0]) * (self.z[1] - self.z[0])


PANDA_JAWS = Jaws(
    opening=(0.0, 0.08),
    force=40.0,
    y=(-0.00875, 0.00875),
    z=(-0.009, 0.0095),
    foundation=1e7 / 0.0076,
)
"""The built-in Franka Hand: rubber tip 17.5 x 15.2 x 18.5 mm (franka_ros, franka_hand.xacro), its
centre 0.25 mm past G; the modulus and grip force of the built-in model."""


def jaws_of(hand: Hand, path: Path, packages: Packages = NO_PACKAGES) -> Jaws:
    """Reads the jaws of a hand.

    Args:
        hand: the document.
        path: the hand's model file.
        packages: what a station says of packages.

    Raises:
        InvalidInputError: the document does not fit the model.
    """
    from burg_drake.station.world import check_hand

    figures = check_hand(hand, path, packages=packages)
    (_, y_low, z_low), (_, y_high, z_high) = figures.pad_bounds
    return Jaws(
        opening=hand.opening,
        force=hand.force,
        y=(y_low, y_high),
        z=(z_low, z_high),
        foundation=figures.pad_modulus / (0.5 * min(figures.pad_size)),
    )
