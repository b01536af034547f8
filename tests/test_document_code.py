"""The Python of all pages runs as it is printed, one block after the other, with small numbers.

What a comment of a page can say about a block stands in `pages`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from burg_drake.apps.cli import main
from burg_drake.evaluation.workers import LocalExecutor
from burg_drake.system_libraries import missing_render_libraries
from tests.evaluation.inline_executor import Inline
from tests.pages import PAGES, ROOT, blocks

SMALL = """\
version: 1
name: small
library: household
instances:
- {object: mug, X_SO: {translation: [0.125, 0.109, 0.0], rpy_deg: [0.0, 0.0, 140.0]}}
- {object: box, X_SO: {translation: [0.475, 0.115, 0.0], rpy_deg: [0.0, 0.0, 75.0]}}
"""
SIX = {'load_scene("tabletop_six")': "load_scene('small.yaml')"}
"""Two of its objects, where they are."""
SMALLER = {
    "README": {
        **SIX,
        '=100, engine="standard")': "=1, engine='screening', only=['mug'])",
        "scene, station, 50, ": "scene, station, 8, ",
        "scene, station, 500)": "scene, station, 1, only=['mug', 'box'])",
        "burg.reach(scene, station, grasps)": "burg.reach(scene, station, grasps, workers=1)",
        "AdvanceTo(plan.duration)": "AdvanceTo(0.1)",
        '"runs/best", grasps=best)': '"runs/best", grasps=best, settings=settings)',
    },
    "arms": SIX,
    "reach": {
        **SIX,
        "motion=low))\nrun": "motion=low, grasps_per_object=1, only=['mug']))\nrun",
    },
    "scenes": {
        '"tabletop_six"), burg.load_station("panda_tabletop")\nfor': "'small.yaml'), station\nfor",
        '"close", 1000, workers=2)': '"close", 1)',
        "size=(0.594, 0.420)), height": "size=(0.1, 0.1)), height",
        "count_grasps(scene, station)": "count_grasps(scene, station, grasps_per_object=3)",
        "duration=0.5)": "duration=0.05)",
    },
}
"""What is printed, and what is run in its place, as it is quick."""
HOLDS = {
    "dataset": ["measured.shape == (480, 640) and ((measured > 0.2) & (measured < 2.0)).any()"],
    "README": [
        "isinstance(plan, burg.Plan) and burg.load_plan('plan.json')",
        "result.outcome in set(burg.Outcome)",
        "len(judged.column('blocker')) == 8",
        "burg.load_run('runs/python').complete and burg.load_run('runs/best').complete",
        "burg.load_scene('breakfast.yaml').instances",
    ],
    "scenes": ["plant.Finalize() or plant.num_bodies() == 1 + 6 + 1"],
}
"""What is true after a page has run."""
RUN = [page for page in PAGES if any(block.runs for block in blocks(page))]


@pytest.mark.usefixtures("judged_here")
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "camera" in page.read_text("utf-8") and missing_render_libraries():
        pytest.skip("the renderer's system libraries are missing")
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text(SMALL)
    monkeypatch.setattr(LocalExecutor, "judge", lambda self, *jobs: Inline().judge(*jobs))
    monkeypatch.setattr("burg_drake.evaluation.run.scene_processes.preparers", lambda workers: 0)
    names: dict[str, Any] = {}
    for block in blocks(page, SMALLER.get(page.stem, {})):
        if not block.runs:
            continue
        if block.language == "python":
            exec(compile(block.module, str(page), "exec"), names)
        elif block.remark.startswith("file "):
            Path(block.remark.removeprefix("file ")).write_text(block.code, "utf-8")
        else:
            codes = [main(arguments) for arguments in block.commands()]
            assert codes and not any(codes)
    for fact in HOLDS.get(page.stem, []):
        assert eval(fact, names), fact
