from __future__ import annotations

import pickle
import re
from pathlib import Path

from burg_drake.core import Outcome, Stage


def test_stored_values_never_change():
    """Results files hold these texts; add new ones, do not rename."""
    assert {str(outcome) for outcome in Outcome} == {
        "collision_target",
        "collision_table",
        "collision_clutter",
        "collision_background",
        "hand_collision_approach",
        "hand_collision_retreat",
        "hand_collision_lift",
        "no_ik",
        "joint_limit",
        "arm_collision",
        "approach_line",
        "retreat_line",
        "lift_line",
        "no_path",
        "no_contact",
        "one_finger",
        "closed_empty",
        "slipped",
        "blocked",
        "dropped",
        "lifted",
        "lifted_disturbed",
        "lifted_turned",
        "simulation_failed",
        "reachable",
    }
    assert [str(stage) for stage in Stage] == ["clear", "reachable", "planned", "executed"]


def test_each_outcome_is_decided_by_one_stage():
    by_stage = {stage: {o for o in Outcome if o.stage is stage} for stage in Stage}
    assert by_stage[Stage.CLEAR] == {
        Outcome.COLLISION_TARGET,
        Outcome.COLLISION_TABLE,
        Outcome.COLLISION_CLUTTER,
        Outcome.COLLISION_BACKGROUND,
    }
    assert by_stage[Stage.REACHABLE] == {
        Outcome.HAND_COLLISION_APPROACH,
        Outcome.HAND_COLLISION_RETREAT,
        Outcome.HAND_COLLISION_LIFT,
        Outcome.NO_IK,
        Outcome.JOINT_LIMIT,
        Outcome.ARM_COLLISION,
    }
    assert by_stage[Stage.PLANNED] == {
        Outcome.APPROACH_LINE,
        Outcome.RETREAT_LINE,
        Outcome.LIFT_LINE,
        Outcome.NO_PATH,
        Outcome.REACHABLE,
    }
    assert sum(map(len, by_stage.values())) == len(Outcome)
    assert Outcome.LIFTED in by_stage[Stage.EXECUTED]


def test_each_outcome_says_what_it_means():
    assert len({outcome.meaning for outcome in Outcome if outcome.meaning}) == len(Outcome)
    assert pickle.loads(pickle.dumps(Outcome.NO_IK)) is Outcome("no_ik") is Outcome.NO_IK


def test_the_page_lists_every_outcome_at_its_stage() -> None:
    page = Path(__file__).parents[2] / "docs" / "concepts" / "outcomes.md"
    listed: dict[str, str] = {}
    stage = ""
    for first, names in re.findall(r"^\| (\w*) ?\| (\**`.+?) \|", page.read_text("utf-8"), re.M):
        stage = first or stage
        listed |= dict.fromkeys(re.findall(r"`(\w+)`", names), stage)
    assert listed == {outcome.value: outcome.stage.value for outcome in Outcome}
