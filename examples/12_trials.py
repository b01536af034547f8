"""Trials on a robot: chosen from a run, recorded one by one, and held against the simulation.

In place of the robot another engine tries the grasps here, with steps that are too coarse.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import burg_drake as burg

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder)
    simulated, tried = path / "simulated", path / "tried"
    scene, station = burg.load_scene("tabletop_close"), burg.load_station("panda_tabletop")
    grasps = burg.sample_grasps(scene, station, 4, only=["mug", "box"])
    for out, engine in ((simulated, "standard"), (tried, "screening")):
        settings = burg.EvaluationSettings(engine=engine, mode="hand")
        burg.evaluate(scene, station, out, grasps=grasps, settings=settings, progress=False)

    chosen = burg.trials.SelectionSettings(per_object=3)
    sheet = burg.trials.plan_trials(simulated, settings=chosen, out=path / "trials.yaml")
    print(f"{len(sheet.trials)} trials, the first one of {sheet.trials[0].grasp}")
    book, robot = burg.trials.TrialBook(path / "trials.yaml"), burg.load_run(tried)
    for trial in sheet.trials:
        book.record(trial.number, outcome=robot.row(trial.grasp)["outcome"], operator="engine")

    found = burg.trials.compare(simulated, path / "trials.yaml").judgement
    for name in ("accuracy", "precision", "recall"):
        figure = getattr(found.selected, name)
        if figure.value is None:
            print(f"{name}: not defined, {figure.reason}")
        else:
            print(f"{name}: {figure.value:.2f}, from {figure.low:.2f} to {figure.high:.2f}")
