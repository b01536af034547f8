"""Refuses what looks finished and is not: whoever judges may end too soon."""

from __future__ import annotations

from burg_drake.core import SimulationError, listing
from burg_drake.evaluation.store import Campaign, Run


def require_judged(run: Run) -> None:
    """Refuses a run in which grasps that are judged here are open.

    Raises:
        SimulationError: there are such grasps.
    """
    left = [id for id in run.mine if id not in run.verdicts]
    if left:
        raise SimulationError(
            f"{len(left)} of {len(run.mine)} grasps have no verdict yet, such as "
            f"{left[0]}; the results so far are kept: run the same command to continue"
        )


def require_scenes_judged(campaign: Campaign) -> None:
    """Refuses a run over many scenes in which scenes are open; those that failed are not.

    Raises:
        SimulationError: there are such scenes.
    """
    ended = ("done", "empty", "failed")
    states = campaign.states
    left = [
        name for name in campaign.names if name not in states or states[name].state not in ended
    ]
    if left:
        raise SimulationError(
            f"{len(left)} of {len(campaign.names)} scenes are not complete ("
            f"{listing(left)}); the results so far are kept: run the same command to"
            " continue"
        )
