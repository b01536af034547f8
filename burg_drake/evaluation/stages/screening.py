"""The first stages of a station's judge, which are asked about many grasps at once, and what they
need of the station."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import Array
from burg_drake.core.grasps import LIFT_HEIGHT, Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages.judge import Decision, Screen
from burg_drake.scene.document import Scene
from burg_drake.station.document import GraspMotion, Station

if TYPE_CHECKING:
    from burg_drake.evaluation.stages.lift_room import LiftRoom
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.motion.lines import ReachSettings
    from burg_drake.motion.reach import ArmReach, Reach

HAND_BATCH = 512
"""A grasp takes about 0.025 ms in such a batch."""
ARM_BATCH = 128
"""As many as `ArmReach` judges together."""


def hand_screen(
    clearance: HandClearance, X_WO: Mapping[str, Array], room: LiftRoom | None = None
) -> Screen:
    """The stage `clear`.

    Args:
        clearance: of the open hand in the scene.
        X_WO: (4, 4) poses of the free instances by name.
        room: says how far clear hands can lift, if no later stage does.
    """

    def ask(grasps: Sequence[Candidate]) -> list[Decision]:
        places: dict[str, list[int]] = {}
        for place, grasp in enumerate(grasps):
            places.setdefault(grasp.instance, []).append(place)
        decisions = [Decision()] * len(grasps)
        for instance, chosen in places.items():
            X_WG = placed([grasps[k] for k in chosen], X_WO)
            found = clearance.check_all(instance, X_WG)
            lifts = np.full(len(chosen), np.nan)
            clear = np.flatnonzero([answer.outcome is None for answer in found])
            if room is not None and len(clear):
                width = np.array([grasps[chosen[k]].width for k in clear])
                lifts[clear] = room.length(instance, X_WG[clear], width)
            for k, answer, lift in zip(chosen, found, lifts.tolist(), strict=True):
                margins = {"overlap": answer.overlap, "clearance": answer.clearance}
                if math.isfinite(lift):
                    margins[LIFT_HEIGHT] = lift
                decisions[k] = Decision(answer.outcome, blocker=answer.blocker, margins=margins)
        return decisions

    return Screen(Stage.CLEAR, ask, HAND_BATCH)


def arm_screen(reach: ArmReach, X_WO: Mapping[str, Array], *, motions: bool = False) -> Screen:
    """The stages `reachable` and `planned`, which are asked about together.

    Args:
        reach: the arm in the scene.
        X_WO: (4, 4) poses of the free instances by name.
        motions: whether later stages need the motions that are found.
    """

    def ask(grasps: Sequence[Candidate]) -> list[Decision]:
        found = reach.check_all(
            [grasp.instance for grasp in grasps],
            placed(grasps, X_WO),
            np.array([grasp.width for grasp in grasps]),
        )
        return [_decision(answer, motions) for answer in found]

    return Screen(Stage.REACHABLE, ask, ARM_BATCH)


def placed(grasps: Sequence[Candidate], X_WO: Mapping[str, Array]) -> Array:
    """(N, 4, 4) grasps in the world.

    One by one: products of stacked matrices may differ from single ones in the last bit.
    """
    return np.array([X_WO[grasp.instance] @ grasp.X_OG for grasp in grasps]).reshape(-1, 4, 4)


def _decision(answer: Reach, motions: bool) -> Decision:
    margins = {
        "arm_clearance": answer.clearance,
        "joint_excess": answer.excess,
        LIFT_HEIGHT: answer.lift,
    }
    return Decision(
        answer.outcome,
        blocker=answer.blocker,
        margins={name: float(v) for name, v in margins.items() if math.isfinite(v)},
        q_grasp=_floats(answer.q_grasp),
        q_pregrasp=_floats(answer.q_pregrasp),
        motion=answer.witness if motions else None,
    )


def _floats(q: Array | None) -> tuple[float, ...]:
    return () if q is None else tuple(q.tolist())


def hand_alone(scene: Scene, station: Station) -> tuple[HandClearance, dict[str, Array]]:
    """What `hand_screen` takes, where there is no trial of the hand that has it."""
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.station.diagram import build_station_diagram

    diagram = build_station_diagram(scene, station, robot="hand")
    return HandClearance(diagram), {name: diagram.X_WO(name) for name in scene.instances}


def arm_reach(
    scene: Scene, station: Station, motion: GraspMotion, *, exact: bool = True
) -> ArmReach:
    """The arm in the scene.

    Args:
        scene, station: where.
        motion: of the hand, as in a trial.
        exact: see `ReachSettings`.
    """
    from burg_drake.motion.reach import ArmReach

    return ArmReach(scene, station, settings=arm_settings(motion, exact=exact))


def arm_settings(motion: GraspMotion, *, exact: bool = True) -> ReachSettings:
    """How the arm is asked before a trial; see `arm_reach`."""
    from burg_drake.motion.lines import ReachSettings

    return ReachSettings(motion=motion, exact=exact)
