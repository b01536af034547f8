"""What `burg-drake ar` tells a script in the end."""

from __future__ import annotations

import sys
from typing import Any

from burg_drake.apps.ar.session_status import placement_row
from burg_drake.apps.camera import extra_line
from burg_drake.cameras.live import LiveSession, ViewActions, pose_line
from burg_drake.cameras.overlay import OverlayStyle
from burg_drake.cameras.placement import PlacementCheck


def finish(live: LiveSession, actions: ViewActions, *, check: bool, snapshot: str | None) -> None:
    """Tells what was found, and does what is to be done with the last frame that gave a pose.

    Args:
        live: the session, closed.
        actions: on it.
        check: measure how far objects are off.
        snapshot: folder for a snapshot, if one is wanted.
    """
    located, counts = live.last_located, live.counts
    if located is None:
        return
    if counts.frames > 1:
        print(f"{live.source.name}: {counts.valid} of {counts.frames} frames gave a pose")
    estimate = located.estimate
    print(f"{located.frame.name}: {pose_line(estimate, live.processor.scene.board)}")
    if estimate.valid:
        x, y, z = 1e3 * estimate.X_SC[:3, 3]
        print(
            f"camera at x {x:.2f}, y {y:.2f}, z {z:.2f} mm from the board's origin, reprojection"
            f" error {estimate.reprojection_error:.3f} px"
        )
    placement = None
    if check and estimate.valid:
        placement = live.processor.check(located)
        for line in placement_lines(placement, live.processor.style):
            print(line)
    if snapshot is not None:
        actions.snapshot(snapshot, live.picture_of(located, placement))


def placement_exit_code(live: LiveSession) -> int:
    """The exit code of a script; says why if no frame gave a pose."""
    if live.counts.valid:
        return 0
    reason = live.counts.reason or live.reader.fault or "no image arrived"
    print(f"burg-drake: no frame gave a pose: {reason}", file=sys.stderr)
    return 1


def placement_lines(check: PlacementCheck, style: OverlayStyle) -> list[str]:
    """A placement check in words, a line an object."""
    if not check.instances:
        return [f"placement: {check.reason}"]
    width = max(map(len, check.instances))
    return [
        f"  {name:{width}}  {_words(placement_row(placed, style))}"
        for name, placed in check.instances.items()
    ] + [f"  {extra_line(extra)}" for extra in check.extra]


def _words(row: dict[str, Any]) -> str:
    if row["mm"] is None:
        return ": ".join(filter(None, (row["status"].replace("_", " "), row["reason"])))
    x, y = row["xy_mm"]
    words = f"{row['mm']:5.2f} mm off (x {x:+.2f}, y {y:+.2f}{_spread(row['sd_mm'])})"
    if row["deg"] is not None:
        words += f", rotated by {row['deg']:+.2f}{_spread(row['sd_deg'], '')} deg"
    if row["status"] != "measured":
        return f"{words}; {row['status']}: {row['reason']}"
    return f"{words}; {'placed' if row['within'] else 'off its target'}"


def _spread(sd: float | None, before: str = ",") -> str:
    """A standard deviation behind its value; nothing where it is not known."""
    return "" if sd is None else f"{before} ± {sd:.2f}"
