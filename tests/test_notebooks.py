"""Notebooks of the documents run from top to bottom, and are stored without outputs."""

from __future__ import annotations

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.hang_guard import HANG_GUARD
from tests.pages import ROOT

NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
SMALLER = {
    "sample_grasps(scene, station, 20)": "sample_grasps(scene, station, 2)",
    'engine=\\"reference\\"': 'engine=\\"standard\\"',
}
"""What is printed, once, and what is run in its place, as it is quick."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert not cell.outputs and cell.execution_count is None, (
                f"{path.name}: clear all outputs before you save it"
            )


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "PYTHONSAFEPATH" not in os.environ:  # the checkout, and not an installed wheel
        monkeypatch.setenv("PYTHONPATH", str(ROOT))
    text = path.read_text("utf-8")
    for printed, small in SMALLER.items():
        assert text.count(printed) == 1, printed
        text = text.replace(printed, small)
    notebook = nbformat.reads(text, as_version=4)
    folder = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=HANG_GUARD, kernel_name="python3", resources=folder).execute()
    shown = [
        output.data["text/html"]
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "display_data"
    ]
    assert any("Grasp evaluation" in page for page in shown)
    assert any("MeshCat" in page for page in shown)
    assert (tmp_path / "board.pdf").stat().st_size
