"""The state of a live session as JSON, for the page."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from burg_drake.cameras.live import (
    LiveSession,
    Picture,
    ViewActions,
    placement_summary,
    placing_order,
    pose_line,
    position_sd,
)
from burg_drake.cameras.overlay import OverlayStyle
from burg_drake.cameras.placement import Placement, PlacementCheck


def status(live: LiveSession, actions: ViewActions, after: int = 0) -> dict[str, Any]:
    """All that the page shows beside the picture.

    Args:
        live: the session.
        actions: on it.
        after: events up to this number are left out.

    Returns:
        Plain data without NaN; what is not known is None.
    """
    scene, recording = live.processor.scene, actions.recording
    style = live.processor.style
    return {
        "scene": {"name": scene.name, "objects": placing_order(scene)},
        "source": {
            "name": live.source.name,
            "live": live.source.live,
            "state": live.reader.state,
            "fault": live.reader.fault,
        },
        "frames": live.counts.frames,
        "settings": asdict(live.settings),
        "tolerance": {
            "mm": 1e3 * style.tolerance,
            "deg": math.degrees(style.angle_tolerance),
        },
        "picture": None if live.picture is None else _picture(live, live.picture),
        "recording": recording
        and {
            "path": str(recording.path),
            "seconds": recording.frames / recording.frames_per_second,
        },
        "checking": actions.checking,
        "placement": None if live.placement is None else _placement(live.placement, style),
        "events": [asdict(event) for event in live.events.after(after)],
    }


def _picture(live: LiveSession, picture: Picture) -> dict[str, Any]:
    sight, board = picture.located, live.processor.scene.board
    estimate = sight.estimate
    return {
        "number": picture.number,
        "name": sight.frame.name,
        "time": sight.frame.time,
        "valid": estimate.valid,
        "doubt": estimate.reason if estimate.valid else "",
        "line": pose_line(estimate, board),
        "markers": len(estimate.ids),
        "of_markers": len(board.layout.ids),
        "reprojection_error": _known(estimate.reprojection_error),
        "position_sd_mm": _known(1e3 * position_sd(estimate)),
        "p_SC_mm": [round(1e3 * x, 2) for x in estimate.X_SC[:3, 3]] if estimate.valid else None,
        "scale": _known(estimate.scale),
        "rate": live.rate,
        "milliseconds": picture.milliseconds,
    }


def _placement(check: PlacementCheck, style: OverlayStyle) -> dict[str, Any]:
    return {
        "reason": check.reason,
        "summary": placement_summary(check),
        "method": check.method,
        "taken": check.taken,
        "objects": {name: placement_row(placed, style) for name, placed in check.instances.items()},
        "extra": [
            {"xy_mm": [round(1e3 * c, 1) for c in e.position], "wide_mm": round(1e3 * e.width, 1)}
            for e in check.extra
        ],
    }


def placement_row(placed: Placement, style: OverlayStyle) -> dict[str, Any]:
    """One object's row: distance and turn, with their standard deviations."""
    off = None if placed.displacement is None else 1e3 * math.hypot(*placed.displacement)
    turn = None if placed.angle is None else math.degrees(placed.angle)
    sd = placed.displacement_sd
    within = (
        off is not None
        and off <= 1e3 * style.tolerance
        and abs(turn or 0.0) <= math.degrees(style.angle_tolerance)
    )
    return {
        "status": placed.status,
        "reason": placed.reason,
        "within": within,
        "mm": off,
        "xy_mm": placed.displacement and [1e3 * d for d in placed.displacement],
        "sd_mm": None if sd is None else 1e3 * math.hypot(*sd),
        "deg": turn,
        "sd_deg": None if placed.angle_sd is None else math.degrees(placed.angle_sd),
        "seen": placed.seen,
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
