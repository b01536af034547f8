"""What the formats of other projects have to know of a hand, from its document and model."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core.paths import NO_PACKAGES, Packages
from burg_drake.formats.common import Gripper, GripperJoint
from burg_drake.station.document import Hand, Station
from burg_drake.station.world.hand_check import check_hand


def gripper_of(
    hand: Hand, path: Path, document: Path | None = None, packages: Packages = NO_PACKAGES
) -> Gripper:
    """A hand as `formats` knows it; its tips are where the pads of its model end.

    Args:
        hand: the document.
        path: the model file.
        document: the document's file, for messages.
        packages: what a station says of packages.

    Raises:
        InvalidInputError: the document does not fit the model.
    """
    figures = check_hand(hand, path, document, packages)
    return Gripper(
        name=hand.name,
        body=hand.body,
        X_HG=hand.X_HG.matrix(),
        tip=figures.pad_bounds[1][2],
        opening=hand.opening,
        joints=tuple(GripperJoint(f.joint, f.closed, f.open) for f in hand.fingers),
    )


def station_gripper(station: Station) -> Gripper:
    """The hand of a station; see `gripper_of`."""
    return gripper_of(station.hand, station.hand_model, station.hand_path, station.packages)
