"""The Python of README.md runs as it is printed, one block after the other, with small numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import burg_drake as burg
from burg_drake.evaluation.store.run_folder import load_run

README = Path(__file__).parents[1] / "README.md"
NOT_RUN = "<!-- not run by tests: needs files of yours -->"
"""On the line before a block."""
SMALL = {
    "grasps_per_object=100)": "grasps_per_object=1, engine='screening', workers=1)",
    "scene, station, 50, ": "scene, station, 8, ",
    "scene, station, 500)": "scene, station, 1)",
    "burg.reach(scene, station, grasps)": "burg.reach(scene, station, grasps, workers=1)",
    "AdvanceTo(plan.duration)": "AdvanceTo(0.1)",
    '"runs/best", grasps=best)': '"runs/best", grasps=best, engine="screening", workers=1)',
}
"""What makes it quick."""


def blocks() -> list[str]:
    """The Python blocks that run."""
    found = re.findall(r"([^\n]*)\n```python\n(.*?)```\n", README.read_text("utf-8"), re.DOTALL)
    return [code for before, code in found if before != NOT_RUN]


def test_every_block_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "\n".join(blocks())
    for printed, small in SMALL.items():
        assert code.count(printed) == 1, printed
        code = code.replace(printed, small)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, str(README), "exec"), names)
    assert isinstance(names["plan"], burg.Plan) and (tmp_path / "plan.json").exists()
    assert names["result"].outcome in set(burg.Outcome)  # type: ignore[attr-defined]
    assert len(names["judged"].column("blocker")) == 8  # type: ignore[attr-defined]
    assert all(load_run(tmp_path / "runs" / name).complete for name in ("python", "best"))


def test_what_does_not_run_can_be_compiled_and_says_why() -> None:
    text = README.read_text("utf-8")
    assert text.count("```python\n") == len(blocks()) + text.count(NOT_RUN)
    for code in re.findall(r"```python\n(.*?)```\n", text, re.DOTALL):
        compile(code, str(README), "exec")
