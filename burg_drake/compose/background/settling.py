"""Settling in physics as a proposal: what would move, and how far, to be accepted or dropped."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from burg_drake.compose.background.process import ProgressCallback
from burg_drake.scene.document import Scene, SceneDocument
from burg_drake.station.document import Station

if TYPE_CHECKING:
    from burg_drake.simulation.rest import Displacement

MIN_MOTION = 5e-4
"""What moves by less stays, for people [m]."""
MIN_TURN_DEG = 0.1


@dataclass(frozen=True)
class SettlingProposal:
    """What would become of a scene.

    Attributes:
        start: the scene that it is made of; accepted only while the session still has it.
        document: the scene as it would be, without what fell off the table.
        displacements: how far each object came.
        moving: instances that still move, and how fast: in words.
        fallen: instances that fell off the table.
        duration: simulated time [s].
    """

    start: SceneDocument
    document: SceneDocument
    displacements: Mapping[str, Displacement]
    moving: Mapping[str, str]
    fallen: tuple[str, ...]
    duration: float

    label = "settle"


@dataclass(frozen=True)
class Settle:
    """The task of a worker process.

    Attributes:
        scene: to settle.
        station: where it stands.
        time_limit: simulated time allowed [s].
    """

    scene: Scene
    station: Station
    time_limit: float

    def __call__(self, report: ProgressCallback) -> SettlingProposal:
        from burg_drake.simulation.settling import settle_scene

        passed = 0.0

        def progress(time: float, moving: int) -> None:
            nonlocal passed
            passed += time
            report(min(passed / self.time_limit, 1.0), f"{moving} moving after {passed:.1f} s")

        report(0.0, "building the scene")
        settled = settle_scene(
            self.scene, self.station, time_limit=self.time_limit, progress=progress
        )
        moving = {
            name: f"{v.speed * 1e3:.2f} mm/s, {math.degrees(v.turning):.2f} deg/s"
            for name, v in settled.moving.items()
        }
        return SettlingProposal(
            self.scene.document,
            settled.scene.document,
            dict(settled.displacements),
            moving,
            settled.fallen,
            settled.duration,
        )


def moved_names(
    proposal: SettlingProposal, distance: float = MIN_MOTION, angle_deg: float = MIN_TURN_DEG
) -> list[str]:
    """Instances that would move further, or turn by more, than given [m, degrees]."""
    return [
        name
        for name, d in proposal.displacements.items()
        if d.distance > distance or math.degrees(d.angle) > angle_deg
    ]
