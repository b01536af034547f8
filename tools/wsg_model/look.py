"""Looks of the gripper and of the finger on the side of +x; no mesh is borrowed."""

from __future__ import annotations

from tools.robot_model.obj import Part
from tools.robot_model.solids import plate, rod
from tools.robot_model.surface import part
from tools.wsg_model.collision import BEAM_THICKNESS, GAP, JAW_BREADTH
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

EXACT = 1e-5
"""Allowed deviation of simplified surfaces [m]."""


def body_parts() -> list[Part]:
    """Housing with a panel on both sides, guide rail in the front face, adapter plate."""
    x, y, z = BODY[0] / 2, BODY[1] / 2, BODY[2]
    outline = [(-x, 0.0), (x, 0.0), (x, z - 0.008), (x - 0.008, z), (0.008 - x, z), (-x, z - 0.008)]
    slot = plate(_rectangle(-x + 0.003, x - 0.003, 0.0105), (0, 1), z - 0.006, z + 0.01)
    housing = plate(outline, (0, 2), -y, y, bevel=0.0015) - slot
    panel = [(-x + 0.012, 0.010), (x - 0.012, 0.010), (x - 0.012, 0.048), (-x + 0.012, 0.048)]
    rail = _rectangle(-x + 0.003, x - 0.003, 0.0105)
    return [
        part(housing, "cap", tolerance=EXACT),
        *(
            part(plate(panel, (0, 2), *sides, corner=0.004), "shell", tolerance=EXACT)
            for sides in ((y - 0.001, y + 0.0003), (-y - 0.0003, -y + 0.001))
        ),
        part(plate(rail, (0, 1), z - 0.0065, z - 0.003), "dark", tolerance=EXACT),
        part(
            rod((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), ADAPTER[0] / 2, ADAPTER[1], bevel=0.001),
            "metal",
            tolerance=EXACT,
        ),
    ]


def finger_parts() -> list[Part]:
    """Base jaw, finger that tapers behind its pad, pad with its face at x = 0."""
    back, beam = FINGER_THICKNESS, FINGER_THICKNESS - BEAM_THICKNESS
    root, tip = JAW_HEIGHT, FINGER_HEIGHT
    low, high = PAD_CENTER - PAD_HEIGHT / 2, PAD_CENTER + PAD_HEIGHT / 2
    jaw = [(GAP, GAP), (back, GAP), (back, root), (GAP, root)]
    bar = [(beam, root), (back, root), (back, tip - 0.020), (back - 0.004, tip), (beam, tip)]
    pad = [(0.0, low + 0.001), (0.001, low), (PAD_THICKNESS, low), (PAD_THICKNESS, high)]
    pad += [(0.001, high), (0.0, high - 0.001)]
    half = FINGER_BREADTH / 2
    return [
        part(
            plate(jaw, (0, 2), -JAW_BREADTH / 2, JAW_BREADTH / 2, bevel=0.001),
            "dark",
            tolerance=EXACT,
        ),
        part(plate(bar, (0, 2), -half, half, bevel=0.0007), "metal", tolerance=EXACT),
        part(plate(pad, (0, 2), -half, half), "rubber", tolerance=EXACT),
    ]


def _rectangle(low: float, high: float, half: float) -> list[tuple[float, float]]:
    return [(low, -half), (high, -half), (high, half), (low, half)]
