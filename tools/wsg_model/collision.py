"""Collision geometry: boxes for body and fingers, and the pads."""

from __future__ import annotations

from tools.robot_model.shapes import PAD, Box, Shape
from tools.wsg_model.figures import (
    ADAPTER,
    BODY,
    FINGER_BREADTH,
    FINGER_HEIGHT,
    FINGER_THICKNESS,
    JAW_HEIGHT,
    PAD_CENTER,
    PAD_HEIGHT,
    PAD_THICKNESS,
)

GAP = 0.0005
"""Between body and base jaws, and between the closed base jaws on either side [m]."""
BEAM_THICKNESS = 0.010
"""Finger along x, its pad apart [m]."""
JAW_BREADTH = 0.030
"""Base jaw along y [m]."""

BODY_SHAPES: tuple[Shape, ...] = (
    Box("body", BODY, (0.0, 0.0, BODY[2] / 2)),
    Box("adapter", (ADAPTER[0], ADAPTER[0], ADAPTER[1]), (0.0, 0.0, -ADAPTER[1] / 2)),
)
"""Collision shapes of the gripper without its fingers, in H."""

FINGER_SHAPES: tuple[Box, ...] = (
    Box(
        PAD,
        (PAD_THICKNESS, FINGER_BREADTH, PAD_HEIGHT),
        (PAD_THICKNESS / 2, 0.0, PAD_CENTER),
    ),
    Box(
        "beam",
        (BEAM_THICKNESS, FINGER_BREADTH, FINGER_HEIGHT - JAW_HEIGHT),
        (FINGER_THICKNESS - BEAM_THICKNESS / 2, 0.0, (FINGER_HEIGHT + JAW_HEIGHT) / 2),
    ),
    Box(
        "jaw",
        (FINGER_THICKNESS - GAP, JAW_BREADTH, JAW_HEIGHT - GAP),
        ((FINGER_THICKNESS + GAP) / 2, 0.0, (JAW_HEIGHT + GAP) / 2),
    ),
)
"""Collision shapes of the finger on the side of +x, in its own frame."""
