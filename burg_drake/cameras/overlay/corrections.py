"""What is left to do with an object that was placed by hand, as words and arrows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from burg_drake.cameras.overlay.style import OverlayStyle
from burg_drake.cameras.placement import ExtraObject, Placement
from burg_drake.core import Array

PlacementVerdict = Literal["placed", "off", "uncertain", "not_seen"]

COLORS: dict[PlacementVerdict, tuple[int, int, int]] = {
    "placed": (70, 230, 120),
    "off": (255, 110, 70),
    "uncertain": (255, 205, 70),
    "not_seen": (190, 195, 200),
}
"""Of outlines, arrows and texts."""

ARROW = 0.035
"""Length of an arrow that stands for less [m]: one of a millimetre would not be seen."""
HEAD = 0.010
"""Length of the two strokes of an arrow's head [m], at most 0.4 of the arrow."""
ARC_RADIUS, ARC = 0.030, math.radians(80.0)
"""Of the arrow that says which way to turn [m, rad]."""
PARTS = 12
"""Straight lines that an arc is made of."""


@dataclass(frozen=True, eq=False)
class Mark:
    """What is drawn for one object.

    Attributes:
        verdict: how it stands.
        text: in words; empty if there is nothing to say.
        lines: (N, 2, 3) arrows in S [m].
    """

    verdict: PlacementVerdict
    text: str
    lines: Array


def mark(placement: Placement, style: OverlayStyle, height: float) -> Mark:
    """What is left to do with an object.

    Args:
        placement: how it stands.
        style: has the tolerances.
        height: at which arrows are drawn, z in S [m].
    """
    nothing = np.empty((0, 2, 3))
    uncertain = placement.status == "uncertain"
    if placement.displacement is None:
        return (
            Mark("uncertain", "?", nothing) if uncertain else Mark("not_seen", "not seen", nothing)
        )
    move = -np.array(placement.displacement)
    turn = -(placement.angle or 0.0)
    far, turned = math.hypot(*move) > style.tolerance, abs(turn) > style.angle_tolerance
    verdict: PlacementVerdict = "off" if far or turned else "placed"
    if uncertain:
        verdict = "uncertain"
    target = (placement.target.matrix() @ (*(placement.reference or (0.0, 0.0, 0.0)), 1.0))[:3]
    target[2] = height
    lines = [nothing]
    if far:
        lines.append(_arrow(target, np.array([*move, 0.0])))
    if turned:
        lines.append(_turn(target, turn))
    return Mark(verdict, _text(placement, uncertain), np.concatenate(lines))


def ring(extra: ExtraObject) -> Array:
    """(N, 2, 3) lines on the board around something that is no object of the scene, in S [m]."""
    around = np.linspace(0.0, 2.0 * np.pi, 2 * PARTS + 1)
    radius = max(0.6 * extra.width, HEAD)
    x, y = extra.position
    points = np.column_stack(
        [x + radius * np.cos(around), y + radius * np.sin(around), np.zeros_like(around)]
    )
    return np.stack([points[:-1], points[1:]], axis=1)


def _text(placement: Placement, uncertain: bool) -> str:
    """Distance and turn, of an uncertain object with a question mark and standard deviations."""
    far_sd = placement.displacement_sd if uncertain else None
    turn_sd = placement.angle_sd if uncertain else None
    far = 1e3 * math.hypot(*(placement.displacement or (0.0, 0.0)))
    text = _number(far, None if far_sd is None else 1e3 * math.hypot(*far_sd)) + " mm"
    if placement.angle is not None:
        turn = abs(math.degrees(placement.angle))
        text += f" {_number(turn, None if turn_sd is None else math.degrees(turn_sd))}°"
    return f"? {text}" if uncertain else text


def _number(value: float, sd: float | None) -> str:
    text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
    return text if sd is None else f"{text}±{_number(sd, None)}"


def _arrow(target: Array, move: Array) -> Array:
    """To the target, along a move, drawn longer than that where it is short."""
    length = float(np.linalg.norm(move))
    drawn = max(length, ARROW)
    along = move / length
    return np.concatenate([[[target - drawn * along, target]], _head(target, along, 0.4 * drawn)])


def _turn(center: Array, angle: float) -> Array:
    """An arc about the vertical, with a head at its end."""
    around = math.copysign(1.0, angle) * np.linspace(-ARC / 2, ARC / 2, PARTS + 1) - math.pi / 2
    radial = np.column_stack([np.cos(around), np.sin(around), np.zeros_like(around)])
    points = center + ARC_RADIUS * radial
    lines = np.stack([points[:-1], points[1:]], axis=1)
    along = points[-1] - points[-2]
    return np.concatenate([lines, _head(points[-1], along / np.linalg.norm(along), HEAD)])


def _head(tip: Array, along: Array, length: float) -> Array:
    across = np.array([-along[1], along[0], 0.0])
    length = min(length, HEAD)
    back = tip - length * along
    return np.array([[back + 0.6 * length * across, tip], [back - 0.6 * length * across, tip]])
