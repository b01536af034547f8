"""The main job on a small scale: judge grasps of a scene in parallel, read the results."""

from __future__ import annotations

import tempfile
from pathlib import Path

import burg_drake as burg

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run"
    few = burg.EvaluationSettings(grasps_per_object=2)
    burg.evaluate("tabletop_six", "panda_tabletop", path, settings=few, progress=False)

    run = burg.load_run(path)  # as one would at any later time, on any machine
    print(f"{len(run.verdicts)} grasps, judged with Drake {run.document.versions['drake']}")
    for outcome in sorted(set(run.results["outcome"])):
        print(f"{(run.results['outcome'] == outcome).sum():4d} {outcome}")
    for id in run.best(3):
        row = run.row(id)
        print(f"{id}: {1e3 * row['clearance']:.1f} mm of room, held with {row['pad_force']:.1f} N")
    print(f"table: {run.table_path.name}, report: {run.report_path.name}")
