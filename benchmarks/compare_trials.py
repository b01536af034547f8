"""Trials "on the robot" to try `burg-drake compare` with: a second simulation plays reality.

    python benchmarks/compare_trials.py RUN -o trials.yaml [--per-object 10] [--offset-mm 2]
        [--turn-deg 0] [--seed 0]

Chooses grasps of a run in mode `hand`, half of each object's from those that were lifted and half
from the others as far as there are enough, and executes them again with the engine `screening`
where each object stands off its target by normally distributed offsets and turns. Outcomes and
offsets go into a trials file, some as not attempted, some without a measured placement, as it
happens in a laboratory.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.core import GraspSet, Outcome, RealOutcome
from burg_drake.evaluation import EvaluationSettings, Run, evaluate
from burg_drake.experiment import (
    ObjectPlace,
    RealTrial,
    Selection,
    Stratum,
    TrialSheet,
    grasp_content,
    make_source_run,
    save_trials,
)


def main() -> None:
    """Writes a trials file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", metavar="RUN")
    parser.add_argument("-o", "--output", type=Path, default=Path("trials.yaml"))
    parser.add_argument("--per-object", type=int, default=10)
    parser.add_argument("--offset-mm", type=float, default=2.0)
    parser.add_argument("--turn-deg", type=float, default=0.0, help="about each axis")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    sheet = make_sheet(
        burg.load_run(arguments.run),
        arguments.output.absolute().parent,
        arguments.per_object,
        arguments.offset_mm,
        arguments.turn_deg,
        arguments.seed,
    )
    save_trials(sheet, arguments.output)
    print(f"{len(sheet.trials)} trials in {arguments.output}")


def make_sheet(
    run: Run, folder: Path, per_object: int, offset_mm: float, turn_deg: float, seed: int
) -> TrialSheet:
    """Chooses, executes and records."""
    rng = np.random.default_rng(seed)
    strata, chosen = choose(run, per_object, rng)
    offsets = rng.normal(0.0, offset_mm, (len(chosen), 2))
    turns = np.radians(rng.normal(0.0, turn_deg, (len(chosen), 3)))
    ended = execute(run, [row for row, _ in chosen], offsets, turns)
    order = rng.permutation(len(chosen))
    trials = [
        record(run, number, *chosen[k], offsets[k], ended[k], rng)
        for number, k in enumerate(order.tolist(), 1)
    ]
    return TrialSheet(
        created="2026-05-04T16:30:00+02:00",
        runs={"a": make_source_run(run, folder)},
        selection=Selection(per_object=per_object, balance="outcome", seed=seed),
        strata=strata,
        trials=tuple(trials),
    )


def choose(
    run: Run, per_object: int, rng: np.random.Generator
) -> tuple[dict[str, Stratum], list[tuple[int, str]]]:
    """Rows of the run with the keys of their strata."""
    groups: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row, outcome in enumerate(run.results["outcome"].tolist()):
        label = "success" if outcome == Outcome.LIFTED else "failure"
        groups[str(run.results["object"][row]), label].append(row)
    strata, chosen = {}, []
    for (name, label), rows in sorted(groups.items()):
        wanted = per_object // 2
        picked = rng.permutation(rows)[:wanted].tolist()
        key = f"a-{name}-{label}"
        strata[key] = Stratum(
            run="a",
            object=name,
            label=label,
            population=len(rows),
            selected=len(picked),
            wanted=wanted,
        )
        chosen += [(row, key) for row in picked]
    return strata, chosen


def execute(run: Run, rows: list[int], offsets: np.ndarray, turns: np.ndarray) -> list[Outcome]:
    """What becomes of each grasp where its object stands off by an offset [mm], and the hand is
    turned by a rotation vector [rad]."""
    scene, grasps = run.scene(), run.candidates
    index = {id: k for k, id in enumerate(grasps.id)}
    moved: dict[str, list[np.ndarray]] = defaultdict(list)
    asked: dict[str, list[int]] = defaultdict(list)
    for k, row in enumerate(rows):
        name = str(run.results["instance"][row])
        X_OG = grasps.grasps.X_OG[index[str(run.results["id"][row])]].copy()
        R_SO = scene.instance(name).X_SO.matrix()[:3, :3]
        X_OG[:3, 3] -= R_SO.T @ [*offsets[k] * 1e-3, 0.0]
        X_OG[:3, :3] = X_OG[:3, :3] @ Rotation.from_rotvec(turns[k]).as_matrix()
        moved[name].append(X_OG)
        asked[name].append(k)
    given = {
        name: GraspSet.create(np.array(poses), object=scene.instance(name).object)
        for name, poses in moved.items()
    }
    ended = [Outcome.NO_CONTACT] * len(rows)
    with tempfile.TemporaryDirectory() as folder:
        real = evaluate(
            scene,
            run.station(),
            folder + "/real",
            settings=EvaluationSettings(engine="screening", mode="hand"),
            grasps=given,
            progress=False,
        )
        outcome = dict(zip(real.results["id"].tolist(), real.results["outcome"], strict=True))
    for name, ks in asked.items():
        for k, id in zip(ks, given[name].id.tolist(), strict=True):
            ended[k] = Outcome(outcome[f"{name}-{id}"])
    return ended


def record(
    run: Run,
    number: int,
    row: int,
    stratum: str,
    offset: np.ndarray,
    ended: Outcome,
    rng: np.random.Generator,
) -> RealTrial:
    """A trial as a person would enter it."""
    results, grasps = run.results, run.candidates
    id, instance = str(results["id"][row]), str(results["instance"][row])
    k = grasps.id.index(id)
    known = ended.value in RealOutcome.__members__.values()
    outcome = RealOutcome(ended.value) if known else RealOutcome.PROTECTIVE_STOP
    if rng.random() < 0.04:
        outcome = RealOutcome.NOT_ATTEMPTED
    place = ObjectPlace(
        status="measured",
        offset_mm=(round(float(offset[0]), 2), round(float(offset[1]), 2)),
        offset_sd_mm=(0.2, 0.2),
    )
    return RealTrial(
        number=number,
        block=1,
        run="a",
        grasp=id,
        content=grasp_content(instance, grasps.grasps.X_OG[k], float(grasps.grasps.width[k])),
        instance=instance,
        object=str(results["object"][row]),
        simulated=Outcome(results["outcome"][row]),
        stratum=stratum,
        outcome=outcome,
        time="2026-05-04T16:30:00+02:00",
        note="the object turned in the hand" if outcome is RealOutcome.SLIPPED else "",
        photo=f"photos/{number:03d}.png",
        placement={instance: place} if rng.random() < 0.85 else {},
    )


if __name__ == "__main__":
    main()
