"""The Python of all pages runs as printed, one block after the other.

`pages` tells what comments of a page can replace, add or leave out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from burg_drake.apps import main
from burg_drake.evaluation import LocalExecutor
from burg_drake.system_libraries import missing_render_libraries
from tests.evaluation.inline_executor import Inline
from tests.evaluation.scenes_here import ScenesHere
from tests.pages import PAGES, ROOT, blocks

SMALL = """\
version: 1
name: small
library: household
instances:
- {object: mug, X_SO: {translation: [0.125, 0.109, 0.0], rpy_deg: [0.0, 0.0, 140.0]}}
- {object: box, X_SO: {translation: [0.475, 0.115, 0.0], rpy_deg: [0.0, 0.0, 75.0]}}
"""
RUN = [page for page in PAGES if any(block.runs for block in blocks(page))]


@pytest.mark.usefixtures("judged_here")
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "camera" in page.read_text("utf-8") and missing_render_libraries():
        pytest.skip("the renderer's system libraries are missing")
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text(SMALL)
    monkeypatch.setattr(LocalExecutor, "judge", lambda self, *jobs: Inline().judge(*jobs))
    monkeypatch.setattr("burg_drake.evaluation.many_scenes.SceneProcesses", ScenesHere)
    names: dict[str, Any] = {}
    for block in blocks(page):
        if not block.runs:
            continue
        if block.language == "python":
            exec(compile(block.module, str(page), "exec"), names)
        elif block.remark.startswith("file "):
            Path(block.remark.removeprefix("file ")).write_text(block.code, "utf-8")
        else:
            codes = [main(arguments) for arguments in block.commands()]
            assert codes and not any(codes)
