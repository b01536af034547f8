"""What a run lacks and why: objects with fewer grasps than asked, objects with no trial."""

from __future__ import annotations

from collections import Counter

import numpy as np

from burg_drake.core.outcome import Outcome, Stage
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.shortfall import SELF, TABLE, shortfall
from burg_drake.evaluation.table import Columns

CAUSES = 3
"""So many outcomes are named."""
HIT = {Outcome.COLLISION_TARGET: SELF, Outcome.COLLISION_TABLE: TABLE}
REMEDY_OF_ARM = "another station or place on the board may help; mode `hand` leaves the arm out"
REMEDIES = {
    Stage.CLEAR: "sample grasps at which the hand is clear, which is the default",
    Stage.REACHABLE: REMEDY_OF_ARM,
    Stage.PLANNED: REMEDY_OF_ARM,
    Stage.EXECUTED: "the table of results has the reasons",
}
"""What would help, by the stage that stopped most grasps."""
NO_LIFT = (Outcome.HAND_COLLISION_LIFT, Outcome.LIFT_LINE)
REMEDY_OF_LIFT = "a shorter lift (--least-lift-mm) or a retreat first (--retreat-mm) may help"


def run_notes(run: Run) -> tuple[str, ...]:
    """A sentence for each instance with fewer grasps than asked, and for each object of which
    nothing could be executed, once all of its grasps are judged."""
    return (*_shortfalls(run), *_unexecuted(run))


def _shortfalls(run: Run) -> list[str]:
    asked = run.document.grasps.per_object
    if asked is None:
        return []
    found = Counter(run.candidates.instance.tolist())
    parts = run.candidates.grasps.provenance.get("parts", {})
    notes = (shortfall(name, asked, part, found[name]) for name, part in parts.items())
    return [note for note in notes if note]


def _unexecuted(run: Run) -> list[str]:
    columns, notes = run.results, []
    for name, count in run.document.grasps.objects.items():
        mine = columns["object"] == name
        outcomes = columns["outcome"][mine]
        tried = np.isin(outcomes, [o.value for o in Outcome if o.stage is Stage.EXECUTED])
        executed = tried & (outcomes != Outcome.SIMULATION_FAILED)
        if count and len(outcomes) == count and not executed.any():
            notes.append(_unexecuted_note(name, columns, mine))
    return notes


def _unexecuted_note(name: str, columns: Columns, mine: np.ndarray) -> str:
    causes = Counter(
        zip(columns["outcome"][mine].tolist(), columns["blocker"][mine].tolist(), strict=True)
    )
    stages = Counter(columns["stage"][mine].tolist())
    named = causes.most_common(CAUSES)
    parts = [f"{_words(Outcome(what), body)} in {count:,}" for (what, body), count in named]
    rest = int(mine.sum()) - sum(count for _, count in named)
    parts += [f"others in {rest:,}"] if rest else []
    remedy = REMEDIES[Stage(stages.most_common(1)[0][0])]
    if Outcome(named[0][0][0]) in NO_LIFT:
        remedy = f"{REMEDY_OF_LIFT}; {remedy}"
    count = int(mine.sum())
    grasps = f"{count:,} grasp{'' if count == 1 else 's'}"
    return f"{name}: nothing executed of {grasps}: {', '.join(parts)}; {remedy}"


def _words(outcome: Outcome, blocker: str) -> str:
    if outcome.stage is Stage.CLEAR:
        return f"the open hand hits {HIT.get(outcome, blocker)}"
    return outcome.value.replace("_", " ") + (f" ({blocker})" if blocker else "")
