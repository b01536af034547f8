from __future__ import annotations

from burg_drake.core.outcome import Outcome, Stage


def test_stored_values_never_change():
    """Results files hold these texts; add new ones, do not rename."""
    assert [str(outcome) for outcome in Outcome][:15] == [
        "collision_target",
        "collision_table",
        "collision_clutter",
        "collision_background",
        "no_ik",
        "arm_collision",
        "no_contact",
        "one_finger",
        "closed_empty",
        "slipped",
        "blocked",
        "dropped",
        "lifted",
        "lifted_disturbed",
        "simulation_failed",
    ]
    assert [str(stage) for stage in Stage][:3] == ["clear", "reachable", "executed"]


def test_each_outcome_is_decided_by_one_stage():
    by_stage = {stage: {o for o in Outcome if o.stage is stage} for stage in Stage}
    assert by_stage[Stage.CLEAR] == {
        Outcome.COLLISION_TARGET,
        Outcome.COLLISION_TABLE,
        Outcome.COLLISION_CLUTTER,
        Outcome.COLLISION_BACKGROUND,
    }
    assert by_stage[Stage.REACHABLE] == {Outcome.NO_IK, Outcome.ARM_COLLISION}
    assert sum(map(len, by_stage.values())) == len(Outcome)
    assert Outcome.LIFTED in by_stage[Stage.EXECUTED]
