"""What the formats of other projects have to know of a hand, from its document and model."""

from __future__ import annotations

from pathlib import Path

from burg_drake.formats.grasp_format import Gripper, GripperJoint
from burg_drake.station.hand import Hand
from burg_drake.station.hand_check import check_hand


def gripper_of(hand: Hand, path: Path, document: Path | None = None) -> Gripper:
    """A hand as `formats` knows it; its tips are where the pads of its model end.

    Args:
        hand: the document.
        path: the model file.
        document: the document's file, for messages.

    Raises:
        InvalidInputError: the document does not fit the model.
    """
    figures = check_hand(hand, path, document)
    return Gripper(
        name=hand.name,
        body=hand.body,
        X_HG=hand.X_HG.matrix(),
        tip=figures.pad_bounds[1][2],
        opening=hand.opening,
        joints=tuple(GripperJoint(f.joint, f.closed, f.open) for f in hand.fingers),
    )
